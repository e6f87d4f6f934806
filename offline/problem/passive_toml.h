#pragma once

#include <span>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// Sets the joints of a task's robot that have no motor, and their springs and dampers.
/// @param root  the task, whose `[passive]` may be missing: then every joint has a motor.
/// @throws FileError  with file, line, key, value and allowed values; also when no joint is left
///                    that has a motor.
void ReadPassiveJoints(TomlTable& root, Problem& problem);

/// The longest integration step that a robot's springs and their dampers allow: the time constant
/// of the fastest. Infinite without them.
/// @param q  positions of all degrees of freedom.
double SpringStep(const PlanarRobot& robot, std::span<const double> q);

/// The keys, for docs/formats.md.
KeyTable PassiveKeyTable();

}  // namespace tumbler
