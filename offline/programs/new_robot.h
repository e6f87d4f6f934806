#pragma once

#include <string>
#include <vector>

namespace tumbler {

/// A file of a new robot's folder.
struct NewFile {
  std::string path;  ///< In the folder, such as `tasks/rise.toml`.
  std::string text;
};

/// The name of a new robot: small letters, digits and dashes, a letter first, at most 32.
[[nodiscard]] bool IsRobotName(const std::string& name);

/// The largest rate at which a bus of 1 Mbit/s carries the drives of a new robot, of 1000, 500 and
/// 250 Hz.
[[nodiscard]] int NewRobotRate(int joints);

/// Everything that a robot needs before it moves in simulation, each file with comments: robot,
/// two tasks, a sequence of their motions, drives, twin, and a page that says what to do with them.
/// The robot is an arm of `joints` links on a foot. It rises from the ground and lies down again;
/// lying, it stays where it is without torque.
/// @pre IsRobotName(name), and joints in 1 ... 8.
[[nodiscard]] std::vector<NewFile> NewRobot(const std::string& name, int joints);

}  // namespace tumbler
