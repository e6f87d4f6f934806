#pragma once

#include <limits>

namespace tumbler {

/// Limits of one joint by the URDF, with the URDF's names; infinite where the file has none. For a
/// prismatic joint the units are m, m/s and N.
struct RobotJointLimits {
  double lower_rad = -std::numeric_limits<double>::infinity();
  double upper_rad = std::numeric_limits<double>::infinity();
  double velocity_rad_s = std::numeric_limits<double>::infinity();
  double effort_nm = std::numeric_limits<double>::infinity();
};

}  // namespace tumbler
