#pragma once

#include <cstdint>

namespace tumbler {

/// Whether x is neither NaN nor infinite.
[[nodiscard]] constexpr bool IsFinite(float x) noexcept { return 0.0F * x == 0; }

/// Zero if all are finite, else NaN, as 0 x is for each.
template <typename... Floats>
[[nodiscard]] constexpr float ZeroIfFinite(Floats... x) noexcept {
  return ((0.0F * x) + ... + 0.0F);
}
/// Whether all are finite, at the price of one comparison.
template <typename... Floats>
[[nodiscard]] constexpr bool AreFinite(Floats... x) noexcept {
  return ZeroIfFinite(x...) == 0;
}

/// Whether x is within [min, max]; false for NaN.
[[nodiscard]] constexpr bool InRange(float x, float min, float max) noexcept {
  return x >= min && x <= max;
}

/// Whether x is above zero and finite.
[[nodiscard]] constexpr bool IsPositive(float x) noexcept { return x > 0 && IsFinite(x); }

/// x clamped to [low, high]. Unlike std::clamp, gives `low` for NaN.
[[nodiscard]] constexpr float ClampOrLow(float x, float low, float high) noexcept {
  const float y = x > low ? x : low;
  return y < high ? y : high;
}

/// What a float loses of the product of an integer and a float: a factor - float(n) factor, to
/// float's precision, for n factor < 2^50. Dekker's product, by halves that have exact products
/// [T. J. Dekker, A Floating-Point Technique for Extending the Available Precision, 1971].
[[nodiscard]] constexpr float LostInProduct(std::int64_t n, float factor) noexcept {
  constexpr float kSplit = 4097;  // 2^12 + 1
  const auto whole = static_cast<float>(n);
  const float whole_high = kSplit * whole - (kSplit * whole - whole);
  const float whole_low = whole - whole_high;
  const float factor_high = kSplit * factor - (kSplit * factor - factor);
  const float factor_low = factor - factor_high;
  const float lost = whole_low * factor_low -
                     (((whole * factor - whole_high * factor_high) - whole_low * factor_high) -
                      whole_high * factor_low);
  return lost + static_cast<float>(n - static_cast<std::int64_t>(whole)) * factor;
}

/// |x|, without a library: one instruction.
[[nodiscard]] constexpr float Magnitude(float x) noexcept { return __builtin_fabsf(x); }

/// Smallest integer >= x, for 0 <= x < 2^31.
[[nodiscard]] constexpr std::int64_t CeilTicks(float x) noexcept {
  const auto whole = static_cast<std::int64_t>(x);
  return static_cast<float>(whole) < x ? whole + 1 : whole;
}

}  // namespace tumbler
