#pragma once

#include <pybind11/pybind11.h>

#include <optional>
#include <string>

#include "common/files/temporary_folder.h"

namespace tumbler {

/// A motion's file. A primitive that Python holds is written into a folder that lives as long as
/// this object.
class MotionPath {
 public:
  /// @param motion  a path, or a Primitive.
  explicit MotionPath(const pybind11::object& motion);

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::optional<TemporaryFolder> folder_;
  std::string path_;
};

}  // namespace tumbler
