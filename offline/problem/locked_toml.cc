#include "offline/problem/locked_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>

#include "common/core/index.h"
#include "common/files/file_keys.h"
#include "offline/problem/task_keys.h"

namespace tumbler {

LockedJoints ReadLocked(TomlTable& root) {
  LockedJoints locked;
  std::optional<TomlTable> table = root.OptionalTable("locked");
  if (!table) return locked;
  for (const std::string& name : table->Keys())
    locked.emplace(name, table->Number(name, kTaskPlace));
  return locked;
}

void CheckLocked(TomlTable& root, const LockedJoints& locked, const Robot& robot) {
  if (locked.empty()) return;
  const TomlTable table = root.Table("locked");
  for (const auto& [name, position_rad] : locked) {
    const auto found = std::ranges::find(robot.locked, name, &LockedJoint::name);
    if (found == robot.locked.end()) {
      std::string names;
      for (const LockedJoint& lock : robot.locked) names += (names.empty() ? "" : ", ") + lock.name;
      for (std::size_t j = Index(robot.root_dofs); j < robot.tree.dofs.size(); ++j)
        names += (names.empty() ? "" : ", ") + robot.tree.dofs[j].name;
      table.Fail(name, fmt::format("is no joint of the robot that moves; its joints: {}", names));
    }
  }
  for (const LockedJoint& joint : robot.locked) {
    if (const auto asked = locked.find(joint.name);
        asked != locked.end() && asked->second != joint.position_rad) {
      table.Fail(
          joint.name,
          fmt::format("is {}, but it follows '{}', with which it is at {}; leave "
                      "it out",
                      MessageNumber(asked->second), joint.with, MessageNumber(joint.position_rad)));
    }
    const RobotJointLimits& limits = joint.limits;
    if (joint.position_rad >= limits.lower_rad && joint.position_rad <= limits.upper_rad) continue;
    const bool follows = !joint.with.empty();
    const std::string& asked = follows ? joint.with : joint.name;
    table.Fail(asked,
               fmt::format("is {}{}; allowed: where the robot's file lets it be, {} ... {}",
                           MessageNumber(locked.at(asked)),
                           follows ? fmt::format(", which puts '{}', which follows it, at {}",
                                                 joint.name, MessageNumber(joint.position_rad))
                                   : "",
                           MessageNumber(limits.lower_rad), MessageNumber(limits.upper_rad)));
  }
}

}  // namespace tumbler
