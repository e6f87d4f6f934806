#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/core/primitive.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// The root's pitch among all degrees of freedom.
inline constexpr std::size_t kPitchOfRoot = 2;

/// A start pose that does not come from the task.
struct StartPose {
  const PrimitivePose* pose;
  const Primitive<double>* primitive;  // has the joints of the pose
  std::string from;                    // names it in messages
  bool own = false;                    // whether it is the entry of a primitive made from this task
};

/// Checks that the joints of a given pose are those of the task, and are where the task starts.
/// @param start    the task's `[start]`.
/// @param problem  has the joints with their starts.
/// @throws FileError naming the joint, both positions or velocities, and the amount.
void CheckGivenJoints(TomlTable& start, const StartPose& given, const Problem& problem);

/// Reads where each passive joint starts [rad]: by `start.joints_rad`, or where its spring is
/// slack.
/// @throws FileError where a joint may not be there, or `end.joints_rad` names one.
std::vector<double> ReadPassiveStart(TomlTable& root, const Scene& scene);

/// Reads `[start]`: sets the problem's pose and rates of the root at the start, and brings the
/// robot to rest where the task leaves its height open.
/// @param root           the task, of which everything but `[start]` was read.
/// @param given          the pose in which the motion begins instead of the task's, which has to
///                       agree with it.
/// @param passive_start  of each passive joint [rad].
/// @param problem        has the joints with their starts, obstacles and contact law.
/// @throws FileError where the robot cannot start so.
void ReadStart(TomlTable& root, TomlTable& start, const std::optional<StartPose>& given,
               std::span<const double> passive_start, Problem& problem);

}  // namespace tumbler
