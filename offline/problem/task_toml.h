#pragma once

#include <string>

#include "offline/problem/problem.h"

namespace tumbler {

/// A task with the texts that it came from, which go into the primitive.
struct Task {
  Problem problem;
  std::string task_file;
  std::string task_text;
  std::string robot_file;
  std::string robot_text;
};

/// Reads a task file and the URDF that it names (relative to the task's folder), and finds the
/// start pose. The format is described in docs/formats.md. @throws FileError with file, line, key,
/// value and allowed range.
Task LoadTask(const std::string& path);

/// The same from texts, as a primitive carries them: `robot_text` stands for the file that the task
/// names.
Task ParseTask(const std::string& task_text, const std::string& task_name,
               const std::string& robot_text, const std::string& robot_name);

/// Lowers the robot on the obstacles with its joints held, root at the given x and pitch, until it
/// is at rest.
/// @returns all positions at rest. @throws std::runtime_error when it has not come to rest within 5
/// s, with where it was.
std::vector<double> RestPose(const Problem& problem, double x_m, double pitch_rad);

}  // namespace tumbler
