#pragma once

#include <string>
#include <vector>

#include "common/key_table.h"
#include "common/primitive_toml.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// A task with the texts that it came from, which go into the primitive.
struct Task {
  Problem problem;
  std::string task_file;
  std::string task_text;
  std::string robot_file;
  std::string robot_text;
  std::string start_file;  ///< The primitive whose exit is the start pose; empty: the task's own.
  std::string start_hash;  ///< Its coefficients_hash.
};

/// How far apart a joint may be where one primitive leaves it and the task starts it: rounding of a
/// decimal text, no more. The executor holds the joint there; it does not travel.
inline constexpr double kStartJointTolerance = 1e-6;

/// The same for the root's pitch. It only tells a start in the task's shape from one in another
/// (upside down, or with leg roles exchanged): the pose itself is taken as it is.
inline constexpr double kStartPitchTolerance = 0.3;

/// Reads a task file and the URDF that it names (relative to the task's folder), and finds the
/// start pose. The format is described in docs/formats.md. @throws FileError with file, line, key,
/// value and allowed range.
Task LoadTask(const std::string& path);

/// The same, but the motion starts where `before` leaves the robot (its simulated exit: root and
/// joints at rest) rather than in the task's ideal pose.
/// @throws FileError besides, naming joint, quantity and amount, when the exit is not the shape in
/// which the task starts, or was made for another robot or ground.
Task LoadTask(const std::string& path, const PrimitiveFile& before, const std::string& before_path);

/// The same from texts: `robot_text` stands for the file that the task names.
Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name);

/// The task that a primitive was made from, by the texts that it carries. The start pose is the
/// primitive's entry, whatever it was taken from.
Task TaskOf(const PrimitiveFile& file);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> TaskKeyTables();

}  // namespace tumbler
