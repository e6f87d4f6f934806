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

/// |x|, without a library: one instruction.
[[nodiscard]] constexpr float Magnitude(float x) noexcept { return __builtin_fabsf(x); }

/// Smallest integer >= x, for 0 <= x < 2^31.
[[nodiscard]] constexpr std::int64_t CeilTicks(float x) noexcept {
  const auto whole = static_cast<std::int64_t>(x);
  return static_cast<float>(whole) < x ? whole + 1 : whole;
}

}  // namespace tumbler
