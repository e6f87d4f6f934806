#pragma once

namespace tumbler {

/// What a frame of the drives carries that a simulation has without a drives file: magnitudes, at
/// the joint. They are the ranges of bgkatz's MIT firmware and of an AK80-9. A motion whose limits
/// are wider is refused by what plays it, and needs a drives file.
struct CarriedByDrives {
  float position_rad = 12.5F;
  float velocity_rad_s = 50;
  float torque_nm = 18;
  float kp_nm_per_rad = 500;
  float kd_nm_s_per_rad = 5;
};
inline constexpr CarriedByDrives kDefaultDrives;

}  // namespace tumbler
