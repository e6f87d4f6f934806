#pragma once

#include "firmware_interface/devices/drive_range.h"

namespace tumbler {

// What protocols have in common whose setpoints carry the gains of the drive's law,
// torque = kp (position - q) + kd (velocity - qdot) + torque.

/// A setpoint at the drive's shaft.
struct ImpedanceCommand {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float kp_nm_per_rad = 0;
  float kd_nm_s_per_rad = 0;
  float torque_nm = 0;  ///< Feed-forward.
};

/// The ranges of its fields on the wire, compiled into the drive's firmware. They differ between
/// models, firmware versions and published tables; verify them on the bench: with wrong ranges a
/// drive obeys, scaled.
struct ImpedanceRanges {
  DriveRange position_rad;
  DriveRange velocity_rad_s;
  DriveRange kp_nm_per_rad;
  DriveRange kd_nm_s_per_rad;
  DriveRange torque_nm;

  /// Beyond this magnitude of a range's end the arithmetic of codes could overflow.
  static constexpr float kLargest = 1e6F;

  /// Whether those of position, velocity and torque contain zero, those of gains begin at exactly
  /// zero, and none reaches beyond kLargest.
  [[nodiscard]] constexpr bool AreValid() const noexcept {
    return position_rad.ContainsZeroWithin(kLargest) &&
           velocity_rad_s.ContainsZeroWithin(kLargest) && torque_nm.ContainsZeroWithin(kLargest) &&
           kp_nm_per_rad.BeginsAtZeroWithin(kLargest) &&
           kd_nm_s_per_rad.BeginsAtZeroWithin(kLargest);
  }
  /// Those that every protocol has.
  [[nodiscard]] constexpr ShaftRanges Shaft() const noexcept {
    return {position_rad, velocity_rad_s, torque_nm};
  }
};

}  // namespace tumbler
