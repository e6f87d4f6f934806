#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <string>

#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// Checks that a key of a task's table is the name of a joint of its robot.
/// @throws FileError  with file, line, key and the joints.
template <class Robot>
void RequireJointOf(const TomlTable& table, const std::string& name, const Robot& robot) {
  if (robot.FindDof(name) >= robot.root_dofs) return;
  for (const LockedJoint& lock : robot.locked) {
    if (lock.name == name)
      table.Fail(name, "is locked, so nothing moves it; leave it out here, or out of `locked`");
  }
  std::string names;
  for (std::size_t j = static_cast<std::size_t>(robot.root_dofs); j < robot.tree.dofs.size(); ++j)
    names += (names.empty() ? "" : ", ") + robot.tree.dofs[j].name;
  table.Fail(name, fmt::format("is not a joint of the robot; its joints: {}", names));
}
inline void RequireJoint(const TomlTable& table, const std::string& name, const Problem& problem) {
  if (problem.space) return RequireJointOf(table, name, problem.space->scene.robot);
  RequireJointOf(table, name, problem.scene.robot);
}

}  // namespace tumbler
