#pragma once

#include <memory>
#include <string>

#include "common/files/primitive_toml.h"

namespace tumbler {

/// A primitive as Python has it: what its file says, and what the executor makes of it.
struct LoadedPrimitive {
  explicit LoadedPrimitive(PrimitiveFile content);

  PrimitiveFile file;
  /// Null where the primitive does not fit the executor's numbers.
  std::unique_ptr<const Primitive<float>> runtime;
  std::string misfit;  ///< The reason then.
};

/// Whether two primitives are the same: the hash of their files' contents.
bool SamePrimitive(const LoadedPrimitive& a, const LoadedPrimitive& b);

using PrimitivePointer = std::shared_ptr<const LoadedPrimitive>;

}  // namespace tumbler
