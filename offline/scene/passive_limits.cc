#include "offline/scene/passive_limits.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/core/index.h"

namespace tumbler {
namespace {

/// A spring that is slack at a limit rests there but for rounding [rad, m].
constexpr double kRest = 1e-6;

}  // namespace

PassiveExcess FarthestPassive(const PlanarRobot& robot, std::span<const double> q) {
  PassiveExcess farthest;
  for (const PassiveJoint& joint : robot.passive) {
    const RobotJointLimits& limits = robot.limits[Index(joint.dof)];
    const double at = q[Index(joint.dof)];
    const double by = std::max(at - limits.upper_rad, limits.lower_rad - at);
    if (by > std::max(farthest.by, kRest)) farthest = {joint.dof, by, at};
  }
  return farthest;
}

std::string Describe(const PassiveExcess& excess, const PlanarRobot& robot) {
  const Dof<Plane>& dof = robot.tree.dofs[Index(excess.dof)];
  const RobotJointLimits& limits = robot.limits[Index(excess.dof)];
  const double limit = excess.at > limits.upper_rad ? limits.upper_rad : limits.lower_rad;
  const char* unit = dof.kind == JointKind::kPrismatic ? "m" : "rad";
  return fmt::format(
      "the joint without a motor '{}' is at {:.4g} {}, beyond its limit of {:.4g} {}", dof.name,
      excess.at, unit, limit, unit);
}

}  // namespace tumbler
