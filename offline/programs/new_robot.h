#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "common/core/capacity.h"

namespace tumbler {

/// A file of a new robot's folder.
struct NewFile {
  std::string path;  ///< In the folder, such as `tasks/rise.toml`.
  std::string text;
};

/// The name of a new robot: small letters, digits and dashes, a letter first, at most 32.
[[nodiscard]] bool IsRobotName(const std::string& name);

/// The most motors of a new robot's arm. With more of them it would tip its foot over.
inline constexpr int kNewRobotJointsMax = std::min(8, kMaxJoints);

/// The largest rate at which a bus of 1 Mbit/s carries the drives of a new robot, of 1000, 500, 250
/// and 100 Hz.
[[nodiscard]] int NewRobotRate(int joints);

/// Everything that a robot needs before it moves in simulation, each file with comments: robot,
/// two tasks, a sequence of their motions, drives, twin, and a page that says what to do with them.
/// The robot is an arm of `joints` links on a foot. It rises from the ground and lies down again;
/// lying, it stays where it is without torque.
/// @pre IsRobotName(name), and joints in 1 ... kNewRobotJointsMax.
[[nodiscard]] std::vector<NewFile> NewRobot(const std::string& name, int joints);

}  // namespace tumbler
