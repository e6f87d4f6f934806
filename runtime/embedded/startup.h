#pragma once

#include <cstdint>

namespace tumbler {

/// Of the stack [bytes]: all of it, and how much was in use at most since the processor started or
/// `RepaintStack` was called. What was never touched still holds a pattern.
[[nodiscard]] std::uint32_t StackSize() noexcept;
[[nodiscard]] std::uint32_t StackUsed() noexcept;
/// Puts the pattern back where nothing is in use now. @returns how much is.
std::uint32_t RepaintStack() noexcept;

}  // namespace tumbler
