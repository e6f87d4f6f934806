#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"
#include "offline/model/robot.h"
#include "offline/problem/problem.h"
#include "offline/problem/start_toml.h"
#include "offline/scene/quaternion.h"

namespace tumbler {

/// Reads a task of a robot in space, of which header, `robot`, `root` and `locked` were read.
/// @param robot  with a floating root.
/// @param given  the pose in which the motion begins instead of the task's, which has to agree with
///               it: the entry of a primitive that was made from it, or the exit of another one.
/// @throws FileError  with file, line, key, value and allowed range.
Problem ReadSpaceTask(TomlTable root, const Robot& robot, const std::optional<StartPose>& given);

/// The pose of a robot in space as a primitive's file has it.
PrimitivePose ToPrimitivePose(const SpacePose& pose);
/// The other way.
/// @pre it is in space.
SpacePose ToSpacePose(const PrimitivePose& pose);

/// A quaternion of a file, whose digits leave it a little off unit length.
/// @throws FileError  when they leave it far off.
Quaternion UnitQuaternion(TomlTable& table, std::string_view key, const Quaternion& given);

/// A table `[[obstacle]]` of a file about a robot in space.
/// @throws FileError
Obstacle<Spatial> ReadSpaceObstacle(TomlTable& table);

/// What the file's keys are in space where they are others than in the plane, for docs/space.md.
std::vector<KeyTable> SpaceTaskKeyTables();

}  // namespace tumbler
