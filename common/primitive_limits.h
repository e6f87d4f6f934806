#pragma once

#include <array>
#include <span>

#include "common/primitive.h"

namespace tumbler {

/// The range of one quantity of a joint. Every control point has to be within [min, max].
template <typename Scalar>
struct Bound {
  const char* name;
  const char* unit;
  const char* limit_key;
  std::span<const Scalar> points;
  Scalar min;
  Scalar max;
};

/// The ranges of position, velocity, acceleration and feed-forward torque of a joint.
template <typename Scalar>
std::array<Bound<Scalar>, 4> BoundsOf(const JointMotion<Scalar>& motion) {
  const JointLimits<Scalar>& limits = motion.limits;
  return {{{"position", "rad", "position_min_rad and position_max_rad",
            motion.position.control_points(0), limits.position_min_rad, limits.position_max_rad},
           {"velocity", "rad/s", "velocity_max_rad_s", motion.position.control_points(1),
            -limits.velocity_max_rad_s, limits.velocity_max_rad_s},
           {"acceleration", "rad/s^2", "acceleration_max_rad_s2", motion.position.control_points(2),
            -limits.acceleration_max_rad_s2, limits.acceleration_max_rad_s2},
           {"feed-forward torque", "N m", "torque_max_nm", motion.torque.control_points(0),
            -limits.torque_max_nm, limits.torque_max_nm}}};
}

/// Smallest distances of control points to the limits, over all joints; negative when one is
/// exceeded.
struct LimitMargins {
  double position_rad = 0;
  double velocity_rad_s = 0;
  double acceleration_rad_s2 = 0;
  double torque_nm = 0;  ///< Of the feed-forward spline.
};
LimitMargins MarginsOf(const Primitive<double>& primitive);

}  // namespace tumbler
