#pragma once

#include <optional>
#include <string>
#include <vector>

namespace tumbler {

/// A robot from MJCF, the files of MuJoCo, as a URDF.
struct MjcfRobot {
  std::string urdf;
  /// For people: what the URDF does not have, such as springs, tendons and planes.
  std::vector<std::string> notes;
};

/// Reads a robot by MuJoCo, in its pose at `qpos0`, where all angles of the URDF are zero. A body
/// that is alone free in the world becomes the root link; else that is the `world`. Shapes that
/// collide with nothing are visual.
/// @param velocity  the limit of all joints [rad/s, m/s], of which MJCF has none.
/// @throws FileError  when MuJoCo does not take the file.
/// @throws std::runtime_error  when this build has no MuJoCo.
MjcfRobot ReadMjcf(const std::string& path, std::optional<double> velocity);

}  // namespace tumbler
