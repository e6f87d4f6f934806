#include "offline/problem/motor_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "offline/problem/require_joint.h"

namespace tumbler {
namespace {

constexpr Range kSpeed{0.01, 1e4};
constexpr std::array kMotorKeys = {
    KeyOf<&Motor::viscous_friction_nm_s_per_rad>("viscous_friction_nm_s_per_rad", {0, 10},
                                                 "besides the URDF's damping"),
    KeyOf<&Motor::dry_friction_nm>("dry_friction_nm", {0, kLargestDryFriction},
                                   "full above 0.05 rad/s, as smooth below it as the ground's")
        .Default("the URDF's friction"),
    KeyOf<&Motor::base_speed_rad_s>(
        "base_speed_rad_s", kSpeed,
        "above the first the torque in the direction of motion falls, to zero at the second, which "
        "no path exceeds")
        .Default("none")
        .Allowed("0.01 ... 10 000; both or neither"),
    KeyOf<&Motor::no_load_speed_rad_s>(
        "no_load_speed_rad_s", kSpeed,
        "above the first the torque in the direction of motion falls, to zero at the second, which "
        "no path exceeds")
        .Default("none")
        .Allowed("0.01 ... 10 000; both or neither"),
};

}  // namespace

void CheckTorqueSpeedCurve(const TomlTable& table, const std::string& joint,
                           double base_speed_rad_s, double no_load_speed_rad_s) {
  const bool base = std::isfinite(base_speed_rad_s), no_load = std::isfinite(no_load_speed_rad_s);
  if (!base && !no_load) return;
  if (base && no_load && no_load_speed_rad_s > base_speed_rad_s) return;
  if (base != no_load) {
    table.Fail(base ? "base_speed_rad_s" : "no_load_speed_rad_s",
               fmt::format("is {} without a {} for joint {}; allowed: both or neither",
                           base ? base_speed_rad_s : no_load_speed_rad_s,
                           base ? "no_load_speed_rad_s" : "base_speed_rad_s", joint));
  }
  table.Fail(table.Has("no_load_speed_rad_s") ? "no_load_speed_rad_s" : "base_speed_rad_s",
             fmt::format("gives joint {} a base speed of {} and a no-load speed of {} rad/s; "
                         "allowed: both or neither, the second above the first",
                         joint, base_speed_rad_s, no_load_speed_rad_s));
}

namespace {

template <class SceneKind>
void ReadMotorsOf(TomlTable& all, SceneKind& scene, Problem& problem) {
  for (const std::string& name : all.Keys()) {
    if (!all.IsTable(name)) continue;
    RequireJoint(all, name, problem);
    if (scene.robot.IsPassive(scene.robot.FindDof(name)))
      all.Fail(name, "is in [passive], so it has no motor; leave out one of the two");
  }
  auto& robot = scene.robot;
  scene.motors.resize(robot.joint_count());
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    ActuatedJoint& joint = problem.joints[j];
    auto& dof = robot.tree.dofs[Index(joint.dof)];
    joint.motor.dry_friction_nm = robot.dry_friction_nm[Index(joint.dof)];
    ReadKeys(all, kMotorKeys, joint.motor);
    std::optional<TomlTable> own = all.OptionalTable(dof.name);
    if (own) ReadKeys(*own, kMotorKeys, joint.motor);
    CheckTorqueSpeedCurve(own ? *own : all, dof.name, joint.motor.base_speed_rad_s,
                          joint.motor.no_load_speed_rad_s);
    joint.limits.velocity_max_rad_s =
        std::min(joint.limits.velocity_max_rad_s, joint.motor.no_load_speed_rad_s);
    dof.damping_nm_s_per_rad += joint.motor.viscous_friction_nm_s_per_rad;
    scene.motors[j] = joint.motor;
  }
}

}  // namespace

void ReadMotors(TomlTable& root, Problem& problem) {
  std::optional<TomlTable> all = root.OptionalTable("motor");
  if (!all) return;
  problem.WithScene([&](auto& scene) { ReadMotorsOf(*all, scene, problem); });
}

KeyTable MotorKeyTable() { return {"offline/problem/motor_toml.cc", "motor", RowsOf(kMotorKeys)}; }

}  // namespace tumbler
