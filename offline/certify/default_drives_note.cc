#include "offline/certify/default_drives_note.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <vector>

#include "common/core/default_drives.h"
#include "common/core/index.h"
#include "offline/problem/joint_units.h"

namespace tumbler {

std::string BeyondDefaultDrives(const Problem& problem) {
  std::vector<std::string> beyond;
  const auto compare = [&beyond](const std::string& of, const char* key, double asked,
                                 float carried, const char* unit) {
    if (std::abs(asked) <= double{carried}) return;
    beyond.push_back(fmt::format("{}{} {:.6g} (of {:.6g} {})", of, key, asked, carried, unit));
  };
  for (const ActuatedJoint& joint : problem.joints) {
    const std::string of = problem.name_of(joint) + ": ";
    const JointUnits units = UnitsOf(problem, joint);
    const JointLimits<double>& limits = joint.limits;
    compare(of, "position_min_rad", limits.position_min_rad, kDefaultDrives.position_rad,
            units.position);
    compare(of, "position_max_rad", limits.position_max_rad, kDefaultDrives.position_rad,
            units.position);
    compare(of, "velocity_max_rad_s", limits.velocity_max_rad_s, kDefaultDrives.velocity_rad_s,
            units.velocity);
    compare(of, "torque_max_nm", limits.torque_max_nm, kDefaultDrives.torque_nm, units.force);
  }
  const DriveGains gains = problem.drive_gains();
  compare("", "kp_nm_per_rad", gains.kp_nm_per_rad, kDefaultDrives.kp_nm_per_rad, "N m/rad");
  compare("", "kd_nm_s_per_rad", gains.kd_nm_s_per_rad, kDefaultDrives.kd_nm_s_per_rad,
          "N m s/rad");
  if (beyond.empty()) return "";
  return fmt::format(
      "asks for more than the drives of a simulation without a drives file carry: {}; give its "
      "[limits] and gains what they carry, or play the motion with a drives file (--drives)",
      fmt::join(beyond, ", "));
}

}  // namespace tumbler
