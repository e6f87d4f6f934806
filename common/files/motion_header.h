#pragma once

#include <string>

#include "common/files/sequence_toml.h"

namespace tumbler {

/// The text of a C++ header that holds a motion, for a microcontroller that has neither files nor a
/// heap:
///
///   namespace NAMESPACE {
///   inline constexpr std::string_view kSource, kSourceHash;           // file and its HashOfText
///   inline constexpr std::array<tumbler::Primitive<float>, N> kPrimitives;
///   inline constexpr tumbler::SequenceGraph<float> kGraph;
///   }
///
/// Primitives and graph are those of `ToRuntime`, bit for bit (floats are hexadecimal), as
/// `Executor::Configure` takes them. The header includes `common/core/primitive.h` and
/// `common/core/sequence.h`, and needs no library.
/// @param file            a motion that `LoadMotion` has proved.
/// @param source_text     the text of its file, whose hash goes into the header.
/// @param namespace_name  identifiers joined by `::`; empty: `motion_` and the motion's name.
/// @throws std::invalid_argument  when a primitive does not fit single precision (`ToRuntime`), or
/// `namespace_name` is no namespace.
std::string ToHeader(const SequenceFile& file, const std::string& source_text,
                     const std::string& namespace_name = "");

}  // namespace tumbler
