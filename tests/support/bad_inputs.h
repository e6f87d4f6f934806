#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tumbler::testing {

/// A task or a robot with one mistake, and the message about it.
struct BadInput {
  std::string name;     ///< Name of its file, such as `duration_zero.toml`.
  std::string text;     ///< The whole file.
  std::string message;  ///< Without folders. `good.toml` is the good task with this robot.
  [[nodiscard]] bool is_task() const { return name.ends_with(".toml"); }
};

/// The task and the robot from which the others are made.
[[nodiscard]] std::string GoodTask();
[[nodiscard]] std::string GoodRobot();

/// All mistakes of `tests/data/bad_inputs/mistakes.txt`, which describes its own format.
/// @throws std::runtime_error  naming the input whose edits do not fit the good file.
[[nodiscard]] std::vector<BadInput> BadInputs();

/// Writes the good task and robot and all bad ones into an existing folder.
void WriteBadInputs(const std::filesystem::path& folder);

}  // namespace tumbler::testing
