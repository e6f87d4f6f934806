#pragma once

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>

namespace tumbler::testing {

inline std::string ReadFile(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot read " + path.string());
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline void WriteFile(const std::filesystem::path& path, const std::string& text) {
  std::ofstream stream(path, std::ios::binary);
  stream << text;
  if (!stream.flush()) throw std::runtime_error("cannot write " + path.string());
}

/// The text with the first `from` after the first `after` replaced; both must be there.
inline std::string Replaced(std::string text, const std::string& from, const std::string& to,
                            const std::string& after = "") {
  const std::size_t start = text.find(after);
  const std::size_t at = start == std::string::npos ? start : text.find(from, start);
  if (at == std::string::npos) throw std::runtime_error("the text lacks '" + from + "'");
  return text.replace(at, from.size(), to);
}

/// The number of the line, from 1, in which the first `part` begins.
inline int LineOf(const std::string& text, const std::string& part) {
  const std::size_t at = text.find(part);
  if (at == std::string::npos) throw std::runtime_error("the text lacks '" + part + "'");
  return 1 + static_cast<int>(
                 std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

inline std::string ShippedTask() {
  return ReadFile(TUMBLER_SOURCE_DIR "/primitives/tasks/handstand.toml");
}
inline std::string ShippedRobot() {
  return ReadFile(TUMBLER_SOURCE_DIR "/primitives/robots/tumbler.urdf");
}

/// The shipped task made small: on both feet, the legs move a little, and the pitch is to stay. It
/// is solved in a fraction of a second.
inline std::string QuickTask() {
  std::string text = ShippedTask();
  text = Replaced(text, "leg1 = 0.0, leg2 = 0.0", "leg1 = -1.2, leg2 = 1.3");
  text = Replaced(text, "target = 1.5707963267948966", "target = 0.0");
  text = Replaced(text, "duration_s = 1.2", "duration_s = 0.5");
  text = Replaced(text, "settle_s = 0.3", "settle_s = 0.1");
  text = Replaced(text, "seed = 1",
                  "seed = 1\nbatch = 8\nmax_samples = 8\nrefine = 2\nspread_rad = 0.3");
  return Replaced(text, "[solver]",
                  "[solver]\nscreen_evaluations = 10\nfinalists = 2\nmax_evaluations = 25");
}

/// The same with a global search that goes on until it is stopped.
inline std::string EndlessSearch() {
  return Replaced(QuickTask(), "batch = 8\nmax_samples = 8",
                  "batch = 1000000\nmax_samples = 1000000");
}

/// A folder with a task and its robot, laid out as in `primitives/`; it is gone after the test.
class TaskFolder {
 public:
  explicit TaskFolder(const std::string& task, const std::string& robot = ShippedRobot()) {
    std::string pattern = (std::filesystem::temp_directory_path() / "tumbler_task_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
    root_ = pattern;
    std::filesystem::create_directories(root_ / "tasks");
    std::filesystem::create_directories(root_ / "robots");
    WriteFile(task_file(), task);
    WriteFile(robot_file(), robot);
  }
  ~TaskFolder() { std::filesystem::remove_all(root_); }
  TaskFolder(const TaskFolder&) = delete;
  TaskFolder& operator=(const TaskFolder&) = delete;

  [[nodiscard]] std::filesystem::path task_file() const { return root_ / "tasks" / "task.toml"; }
  [[nodiscard]] std::filesystem::path robot_file() const {
    return root_ / "robots" / "tumbler.urdf";
  }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const {
    return root_ / name;
  }
  /// Every file and folder in it.
  [[nodiscard]] std::set<std::string> Listing() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root_))
      names.insert(std::filesystem::relative(entry.path(), root_).string());
    return names;
  }

 private:
  std::filesystem::path root_;
};

}  // namespace tumbler::testing
