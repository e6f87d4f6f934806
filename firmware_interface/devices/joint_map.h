#pragma once

#include "common/core/status.h"

namespace tumbler {

/// Converts between a joint and the shaft whose angle its drive measures:
///
///   drive angle = direction * gear_ratio * (joint angle - zero_offset)                   (1)
///   joint torque = direction * gear_ratio * drive torque
///
/// The second follows from the first, since power is the same on both sides.
struct JointMap {
  /// +1, or -1 where the drive turns against the joint.
  float direction = 1;
  /// > 0: turns of the drive's shaft per turn of the joint. It is 1 where the drive accounts for
  /// its own gear, as T-Motor's AK drives do.
  float gear_ratio = 1;
  /// The joint's angle when the drive reads zero.
  float zero_offset_rad = 0;

  [[nodiscard]] float ToDrivePosition(float joint_rad) const noexcept {
    return direction * gear_ratio * (joint_rad - zero_offset_rad);
  }
  [[nodiscard]] float ToJointPosition(float drive_rad) const noexcept {
    return direction * drive_rad / gear_ratio + zero_offset_rad;
  }
  [[nodiscard]] float ToDriveVelocity(float joint_rad_s) const noexcept {
    return direction * gear_ratio * joint_rad_s;
  }
  [[nodiscard]] float ToJointVelocity(float drive_rad_s) const noexcept {
    return direction * drive_rad_s / gear_ratio;
  }
  [[nodiscard]] float ToDriveTorque(float joint_nm) const noexcept {
    return direction * joint_nm / gear_ratio;
  }
  [[nodiscard]] float ToJointTorque(float drive_nm) const noexcept {
    return direction * gear_ratio * drive_nm;
  }
  /// Converts a stiffness or damping. At the shaft the torque is smaller and the angle larger by
  /// the ratio, so the gain is smaller by its square.
  [[nodiscard]] float ToDriveGain(float joint_gain) const noexcept {
    return joint_gain / (gear_ratio * gear_ratio);
  }
  [[nodiscard]] float ToJointGain(float drive_gain) const noexcept {
    return drive_gain * (gear_ratio * gear_ratio);
  }

  /// @retval kInvalidArgument  a value is outside what its comment allows, or not finite.
  [[nodiscard]] constexpr Status Validate() const noexcept {
    const auto is_finite = [](float x) { return 0.0F * x == 0; };
    const bool valid = (direction == 1 || direction == -1) && gear_ratio > 0 &&
                       is_finite(gear_ratio) && is_finite(zero_offset_rad);
    return valid ? Status::kOk : Status::kInvalidArgument;
  }
};

}  // namespace tumbler
