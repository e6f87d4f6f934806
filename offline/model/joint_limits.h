#pragma once

#include <limits>

namespace tumbler {

/// Limits of one joint, from the URDF; infinite where the file has none. Metres where prismatic.
struct RobotJointLimits {
  double lower_rad = -std::numeric_limits<double>::infinity();
  double upper_rad = std::numeric_limits<double>::infinity();
  double velocity_rad_s = std::numeric_limits<double>::infinity();
  double effort_nm = std::numeric_limits<double>::infinity();
};

}  // namespace tumbler
