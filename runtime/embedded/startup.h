#pragma once

#include <cstdint>

namespace tumbler {

/// The stack's whole size, and how much of it was ever used: the start-up code fills it with a
/// pattern, and what still holds it was not touched [bytes].
[[nodiscard]] std::uint32_t StackSize() noexcept;
[[nodiscard]] std::uint32_t StackUsed() noexcept;

}  // namespace tumbler
