#pragma once

#include <cstdint>

namespace tumbler {

/// The size of the stack [bytes].
[[nodiscard]] std::uint32_t StackSize() noexcept;
/// The most of the stack [bytes] that was in use since the processor started or `RepaintStack` was
/// called. Bytes that were never touched still hold a pattern.
[[nodiscard]] std::uint32_t StackUsed() noexcept;
/// Writes the pattern to the part of the stack that is not in use now. @returns how much is in use
/// [bytes].
std::uint32_t RepaintStack() noexcept;

}  // namespace tumbler
