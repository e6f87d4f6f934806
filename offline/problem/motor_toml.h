#pragma once

#include <string>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// The most dry friction that a joint has in a simulation [N m].
inline constexpr double kLargestDryFriction = 5;

/// Sets the motors of a task's joints, in the problem and in its scene: their friction, their
/// torque-speed curve, and the limits of velocity that follow from it.
/// @param root  the task, whose `[motor]` may be missing: then nothing changes.
/// @pre The problem has its joints with their limits.
/// @throws FileError  with file, line, key, value and allowed values.
void ReadMotors(TomlTable& root, Problem& problem);

/// Checks that a motor has both speeds of a torque-speed curve or neither, in order.
/// @param table  gave them to the joint.
/// @throws FileError  with file, line, key, value and allowed values.
void CheckTorqueSpeedCurve(const TomlTable& table, const std::string& joint,
                           double base_speed_rad_s, double no_load_speed_rad_s);

/// The keys, for docs/formats.md.
KeyTable MotorKeyTable();

}  // namespace tumbler
