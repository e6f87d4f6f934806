#include "offline/problem/passive_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/problem/joint_units.h"
#include "offline/problem/require_joint.h"

namespace tumbler {
namespace {

struct PassiveEntry : PassiveJoint {
  double damping_nm_s_per_rad = 0;
};

constexpr std::array kPassiveKeys = {
    KeyOf<&PassiveJoint::stiffness_nm_per_rad, PassiveEntry>(
        "stiffness_nm_per_rad", {0, 1e6}, "of its spring; N/m where it is prismatic"),
    KeyOf<&PassiveJoint::rest_rad, PassiveEntry>("rest_rad", {-100, 100},
                                                 "where the spring is slack"),
    KeyOf<&PassiveEntry::damping_nm_s_per_rad>("damping_nm_s_per_rad", {0, 30},
                                               "besides the URDF's damping"),
};

}  // namespace

void ReadPassiveJoints(TomlTable& root, Problem& problem) {
  std::optional<TomlTable> all = root.OptionalTable("passive");
  if (!all) return;
  for (const std::string& name : all->Keys()) RequireJoint(*all, name, problem);
  PlanarRobot& robot = problem.scene.robot;
  for (std::size_t i = Index(robot.root_dofs); i < robot.tree.dofs.size(); ++i) {
    Dof<Plane>& dof = robot.tree.dofs[i];
    std::optional<TomlTable> table = all->OptionalTable(dof.name);
    if (!table) continue;
    PassiveEntry entry;
    ReadKeys(*table, kPassiveKeys, entry);
    if (const double friction_nm = robot.dry_friction_nm[i]; friction_nm > 0) {
      all->Fail(
          dof.name,
          fmt::format("has a dry friction of {} {} in the robot's file, which is simulated in "
                      "joints with a motor only; allowed: 0 there, and a damping",
                      MessageNumber(friction_nm), UnitsOf(dof.kind).force));
    }
    entry.dof = static_cast<int>(i);
    dof.damping_nm_s_per_rad += entry.damping_nm_s_per_rad;
    robot.passive.push_back(entry);
  }
  if (robot.joint_count() > 0) return;
  root.Fail("passive", "leaves no joint with a motor; allowed: at least one that is not in it");
}

double SpringStep(const PlanarRobot& robot, std::span<const double> q) {
  HybridDynamics<Plane> dynamics(robot.tree);
  const std::vector<double> zero(q.size());
  const auto accelerations = [&](std::size_t pushed, double torque_nm) {
    std::vector<double> qdd = zero, tau = zero;
    tau[pushed] = torque_nm;
    dynamics.SetState(q, zero);
    dynamics.Solve(qdd, tau);
    return qdd[pushed];
  };
  double fastest = 0;  // [1/s]
  for (const PassiveJoint& joint : robot.passive) {
    const std::size_t dof = Index(joint.dof);
    const double mobility = accelerations(dof, 1) - accelerations(dof, 0);
    fastest = std::max({fastest, std::sqrt(joint.stiffness_nm_per_rad * mobility),
                        robot.tree.dofs[dof].damping_nm_s_per_rad * mobility});
  }
  return fastest > 0 ? 1 / fastest : std::numeric_limits<double>::infinity();
}

KeyTable PassiveKeyTable() {
  return {"offline/problem/passive_toml.cc", "passive", RowsOf(kPassiveKeys)};
}

}  // namespace tumbler
