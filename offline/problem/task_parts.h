#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// The parts of a task that are the same in the plane and in space. Each reads them into a problem,
/// whose scene has its robot already, and throws a FileError with file, line, key, value and
/// allowed range.

/// Name, duration, settle phase, and the bounds of a duration that is free.
void ReadNameAndTimes(TomlTable& root, Problem& problem);

/// The joints with a motor: their limits, and where they start and end. They become prescribed.
/// @pre passive joints are known.
void ReadActuatedJoints(TomlTable& root, Problem& problem);

/// `[spline]`.
void ReadSpline(TomlTable& root, Problem& problem);

/// The joints' velocities at the ends of the motion.
void ReadEndVelocities(TomlTable& root, Problem& problem);

/// Adds every `[[cost]]` to the problem.
/// @param read  reads one.
void ReadCosts(TomlTable& root, const std::function<CostTerm(TomlTable&)>& read, Problem& problem);

/// `[tolerances]`, `[search]` and `[solver]`.
void ReadSettings(TomlTable& root, Problem& problem);

/// Checks that there are not too many pairs of obstacle and shape, and shapes to touch with.
/// @param ignored  why shapes of the robot are not used.
void CheckObstacles(TomlTable& root, std::size_t obstacles, std::size_t shapes,
                    const std::vector<IgnoredShape>& ignored);

/// Sets the steps that the task leaves out, by the problem's advisable one.
void SetStepsByAdvice(TomlTable& root, Problem& problem);

/// Checks that a rollout has no more steps than memory and patience allow: a gradient keeps what it
/// needs of each.
void CheckSteps(TomlTable& root, const Problem& problem);

/// The keys of these parts, for docs/formats.md.
std::vector<KeyRow> NameKeyRows();
std::vector<KeyRow> SplineKeyRows();

}  // namespace tumbler
