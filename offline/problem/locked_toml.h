#pragma once

#include "common/files/toml_reader.h"
#include "offline/model/robot.h"

namespace tumbler {

/// Reads the joints that a task holds, `[locked]`.
LockedJoints ReadLocked(TomlTable& root);

/// Checks that they are the robot's, and may be where the task holds them.
/// @throws FileError where one is not, or may not.
void CheckLocked(TomlTable& root, const LockedJoints& locked, const Robot& robot);

}  // namespace tumbler
