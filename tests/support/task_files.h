#pragma once

#include <filesystem>
#include <string>

#include "tests/support/files.h"

namespace tumbler::testing {

/// The task of a handstand of 1.2 s with twelve control points for each joint, for a TaskFolder.
inline std::string LongHandstandTask() {
  return Replaced(ReadFile(testing::SourcePath("tests/data/tasks/long_handstand.toml")),
                  "../../../primitives/robots", "../robots");
}
inline std::string ShippedRobot() {
  return ReadFile(testing::SourcePath("primitives/robots/tumbler.urdf"));
}

/// That task made small: on both feet, the legs move a little and the pitch has to stay. It
/// is solved in a fraction of a second.
inline std::string QuickTask() {
  std::string text = LongHandstandTask();
  text = Replaced(text, "leg1 = 0.0, leg2 = 0.0", "leg1 = -1.2, leg2 = 1.3");
  text = Replaced(text, "target = 1.5707963267948966", "target = 0.0");
  text = Replaced(text, "duration_s = 1.2", "duration_s = 0.5");
  text = Replaced(text, "settle_s = 0.3", "settle_s = 0.1");
  text = Replaced(text, "seed = 1",
                  "seed = 1\nbatch = 8\nmax_samples = 8\nrefine = 2\nspread_rad = 0.3");
  return Replaced(text, "[solver]",
                  "[solver]\nscreen_evaluations = 10\nfinalists = 2\nmax_evaluations = 25");
}

/// The same task with a global search that goes on until it is stopped.
inline std::string EndlessSearch() {
  return Replaced(QuickTask(), "batch = 8\nmax_samples = 8",
                  "batch = 1000000\nmax_samples = 1000000");
}

/// A folder with a task and its robot, laid out as in `primitives/`.
class TaskFolder : public TemporaryFolder {
 public:
  explicit TaskFolder(const std::string& task, const std::string& robot = ShippedRobot()) {
    std::filesystem::create_directories(path() / "tasks");
    std::filesystem::create_directories(path() / "robots");
    WriteFile(task_file(), task);
    WriteFile(robot_file(), robot);
  }

  [[nodiscard]] std::filesystem::path task_file() const { return path() / "tasks" / "task.toml"; }
  [[nodiscard]] std::filesystem::path robot_file() const {
    return path() / "robots" / "tumbler.urdf";
  }
};

}  // namespace tumbler::testing
