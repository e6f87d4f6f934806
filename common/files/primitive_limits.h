#pragma once

#include <array>
#include <string>

#include "common/core/primitive.h"
#include "common/files/spline_extent.h"

namespace tumbler {

/// The range of one quantity of a joint, and that of its path, which has to be within it.
struct Bound {
  const char* name;
  const char* unit;
  const char* limit_key;
  double min;
  double max;
  Extent path;  ///< For all t.

  [[nodiscard]] bool Holds() const { return path.min >= min && path.max <= max; }
};

/// A bound that does not hold, as `velocity is 20.4 rad/s at 0.312 s; allowed: <= 20 rad/s`.
std::string ToText(const Bound& bound);

/// The ranges of position, velocity, acceleration and feed-forward torque of a joint.
/// @param motion  the path that the joint plays.
/// @param limits  the joint's.
template <typename Scalar>
std::array<Bound, 4> BoundsOf(const JointMotion<Scalar>& motion,
                              const JointLimits<Scalar>& limits) {
  const auto wide = [](Scalar x) { return static_cast<double>(x); };
  return {
      {{"position", "rad", "position_min_rad and position_max_rad", wide(limits.position_min_rad),
        wide(limits.position_max_rad), ExtentOf(motion.position, 0)},
       {"velocity", "rad/s", "velocity_max_rad_s", -wide(limits.velocity_max_rad_s),
        wide(limits.velocity_max_rad_s), ExtentOf(motion.position, 1)},
       {"acceleration", "rad/s^2", "acceleration_max_rad_s2", -wide(limits.acceleration_max_rad_s2),
        wide(limits.acceleration_max_rad_s2), ExtentOf(motion.position, 2)},
       {"feed-forward torque", "N m", "torque_max_nm", -wide(limits.torque_max_nm),
        wide(limits.torque_max_nm), ExtentOf(motion.torque, 0)}}};
}

/// Smallest distances of the paths to the limits, for all t and over all joints; negative when one
/// is exceeded.
struct LimitMargins {
  double position_rad = 0;
  double velocity_rad_s = 0;
  double acceleration_rad_s2 = 0;
  double torque_nm = 0;  ///< Of the feed-forward spline.
};
LimitMargins MarginsOf(const Primitive<double>& primitive);
/// The distances of the control points, which are no larger.
LimitMargins HullMarginsOf(const Primitive<double>& primitive);

}  // namespace tumbler
