#pragma once

#include <cmath>

#include "offline/problem/problem.h"

namespace tumbler {

/// Whether a joint's motor has a torque limit that falls with its speed.
inline bool LimitsTorqueBySpeed(const ActuatedJoint& joint) {
  return std::isfinite(joint.limits.torque_max_nm) && joint.motor.has_curve();
}

/// The number whose size is at most 1 where the torque of such a motor is within its curve
/// (Motor::curve_by_torque).
inline double OnCurve(const ActuatedJoint& joint, double torque_nm, double velocity_rad_s) {
  return joint.motor.curve_by_torque() * (torque_nm / joint.limits.torque_max_nm) +
         joint.motor.curve_by_velocity() * velocity_rad_s;
}

}  // namespace tumbler
