#pragma once

namespace tumbler {

/// The range of a quantity on the wire or of a drive.
struct DriveRange {
  float min = 0;
  float max = 0;

  /// The nearest value inside; `min` for NaN.
  [[nodiscard]] constexpr float Clamp(float x) const noexcept {
    const float above = x > min ? x : min;
    return above < max ? above : max;
  }
  /// Whether zero lies between the ends, and both are of magnitude `largest` at most.
  [[nodiscard]] constexpr bool ContainsZeroWithin(float largest) const noexcept {
    return min >= -largest && min < 0 && max > 0 && max <= largest;
  }
  /// Whether it begins at exactly zero and ends above, at `largest` at most.
  [[nodiscard]] constexpr bool BeginsAtZeroWithin(float largest) const noexcept {
    return min == 0 && max > 0 && max <= largest;
  }
};

/// The ranges of one drive's setpoints, at its shaft. Nothing beyond them is ever encoded.
struct ShaftRanges {
  DriveRange position_rad{-12.5F, 12.5F};
  DriveRange velocity_rad_s{-50.0F, 50.0F};
  DriveRange torque_nm{-18.0F, 18.0F};
};

}  // namespace tumbler
