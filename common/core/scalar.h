#pragma once

#include <bit>
#include <cstdint>

namespace tumbler {

/// What formulas need besides + - * / and <, so that one text of a law serves a double as well as
/// the lanes of vectors (`offline/scene/vectors.h`), which have their own Select, Any and Sqrt.
/// Lanes cannot branch, and get the bits of a double.
///
/// Always inline: sources that are compiled for other vectors must not share a copy.

/// `a` where the condition holds, else `b`.
[[gnu::always_inline]] inline double Select(bool condition, double a, double b) {
  return condition ? a : b;
}
/// Whether a condition holds in any lane.
[[gnu::always_inline]] inline bool Any(bool condition) { return condition; }
[[gnu::always_inline]] inline double Sqrt(double x) { return __builtin_sqrt(x); }
/// 2 to the power of a whole number that ordinary numbers have as exponent.
[[gnu::always_inline]] inline double PowerOfTwo(double k) {
  // 1.5 * 2^52 has the last bit of a whole number where that of an integer is.
  return std::bit_cast<double>((std::bit_cast<std::uint64_t>(k + 6755399441055744.0) + 1023)
                               << 52U);
}

/// The smaller and the larger of two numbers; the second where they are equal or unordered.
template <class S>
[[gnu::always_inline]] inline S Min(const S& a, const S& b) {
  return Select(a < b, a, b);
}
template <class S>
[[gnu::always_inline]] inline S Max(const S& a, const S& b) {
  return Select(b < a, a, b);
}
template <class S>
[[gnu::always_inline]] inline S Clamp(const S& x, const S& low, const S& high) {
  return Min(Max(x, low), high);
}

}  // namespace tumbler
