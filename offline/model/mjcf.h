#pragma once

#include <optional>
#include <string>

#include "offline/model/urdf_writer.h"

namespace tumbler {

/// Reads a robot of MJCF, the files of MuJoCo, by MuJoCo, in its pose at `qpos0`, where all angles
/// of the URDF are zero. A body that is alone free in the world becomes the root link; else that is
/// the `world`. Shapes that collide with nothing are visual. What is left out is noted, such as
/// springs, tendons and planes.
/// @param velocity  the limit of all joints [rad/s, m/s], of which MJCF has none.
/// @throws FileError  when MuJoCo does not take the file.
/// @throws std::runtime_error  when this build has no MuJoCo.
TranslatedRobot ReadMjcf(const std::string& path, std::optional<double> velocity);

}  // namespace tumbler
