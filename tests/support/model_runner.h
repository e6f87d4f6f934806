#pragma once

#include <fmt/format.h>

#include <sstream>
#include <string>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler::testing {

/// The output of a run of tumbler model.
struct ModelOutcome {
  int status = -1;
  std::string out, err;
};

/// Runs tumbler model in a folder with a robot.
class ModelRunner {
 public:
  explicit ModelRunner(const std::string& robot) { WriteFile(folder_ / "robot.urdf", robot); }

  /// Runs `tumbler model COMMAND robot.urdf ARGUMENTS` in a shell, with this on its standard input.
  [[nodiscard]] ModelOutcome operator()(const std::string& command, const std::string& arguments,
                                        const std::string& input = "") const {
    WriteFile(folder_ / "in", input);
    ModelOutcome run;
    run.status = RunInShell(fmt::format("cd {} && exec <in >out 2>err && exec "
                                        "tumbler model {} robot.urdf {}",
                                        folder_.path().string(), command, arguments))
                     .exit_code;
    run.out = ReadFile(folder_ / "out");
    run.err = ReadFile(folder_ / "err");
    return run;
  }

 private:
  TemporaryFolder folder_;
};

inline std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// The numbers at the beginning of a line.
inline std::vector<double> Numbers(const std::string& line) {
  std::vector<double> numbers;
  std::istringstream stream(line);
  for (double x = 0; stream >> x;) numbers.push_back(x);
  return numbers;
}

}  // namespace tumbler::testing
