#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tumbler::testing {

/// A task or a robot with one mistake, and what is said of it.
struct BadInput {
  std::string name;     ///< of its file, such as `duration_zero.toml`
  std::string text;     ///< the whole file
  std::string message;  ///< without folders; `good.toml` is the good task with this robot
  [[nodiscard]] bool is_task() const { return name.ends_with(".toml"); }
};

/// The task and the robot that the others are made from.
[[nodiscard]] std::string GoodTask();
[[nodiscard]] std::string GoodRobot();

/// All of `tests/data/bad_inputs/mistakes.txt`, which explains itself.
/// @throws std::runtime_error  naming the input whose edits do not fit the good file.
[[nodiscard]] std::vector<BadInput> BadInputs();

/// Writes the good two and all bad ones into a folder that is there.
void WriteBadInputs(const std::filesystem::path& folder);

}  // namespace tumbler::testing
