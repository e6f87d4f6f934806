#pragma once

#include <cstddef>

namespace tumbler {

/// A count or number that is an int in mathematics, as the index of a container. Not negative.
constexpr std::size_t Index(int i) noexcept { return static_cast<std::size_t>(i); }

}  // namespace tumbler
