#pragma once

#include <string>

#include "common/sequence_toml.h"

namespace tumbler {

/// A motion as a C++ header, for a microcontroller that has neither files nor a heap:
///
///   namespace NAMESPACE {
///   inline constexpr std::string_view kSource, kSourceHash;           // file and its HashOfText
///   inline constexpr std::array<tumbler::Primitive<float>, N> kPrimitives;
///   inline constexpr tumbler::SequenceGraph<float> kGraph;
///   }
///
/// They are what `ToRuntime` gives, bit for bit (floats are hexadecimal), and what
/// `Executor::Configure` takes. The header needs `common/primitive.h` and `common/sequence.h` and
/// nothing linked.
/// @param file            as `LoadMotion` gives it: proved.
/// @param source_text     the text of its file, whose hash goes into the header.
/// @param namespace_name  identifiers joined by `::`; empty: `motion_` and the motion's name.
/// @throws std::invalid_argument  when a primitive does not fit single precision (`ToRuntime`), or
/// the namespace is none.
std::string ToHeader(const SequenceFile& file, const std::string& source_text,
                     const std::string& namespace_name = "");

}  // namespace tumbler
