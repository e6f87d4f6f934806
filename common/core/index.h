#pragma once

#include <array>
#include <cstddef>

namespace tumbler {

/// A count or number that is an int in mathematics, as the index of a container. Not negative.
constexpr std::size_t Index(int i) noexcept { return static_cast<std::size_t>(i); }

/// An array whose places are ints, as indices in mathematics are; none is negative.
template <class T, int kSize>
struct IntArray : std::array<T, Index(kSize)> {
  using Base = std::array<T, Index(kSize)>;
  using Base::operator[];
  constexpr T& operator[](int i) noexcept { return Base::operator[](Index(i)); }
  constexpr const T& operator[](int i) const noexcept { return Base::operator[](Index(i)); }
};

}  // namespace tumbler
