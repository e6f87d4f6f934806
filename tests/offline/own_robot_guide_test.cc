// A new robot moves by the commands of docs/own-robot.md, and its files are usable with any number
// of motors.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Outcome;
using testing::ReadFile;
using testing::RunInShell;
using testing::SourcePath;

/// The commands of the first block of the page.
std::vector<std::string> DocumentedCommands() {
  std::vector<std::string> commands;
  std::istringstream page(ReadFile(SourcePath("docs/own-robot.md")));
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("    ")) {
      commands.push_back(line.substr(4));
    } else if (!commands.empty()) {
      break;
    }
  }
  return commands;
}

/// Runs a command line in a folder.
Outcome In(const std::string& folder, const std::string& command_line) {
  return RunInShell("cd '" + folder + "' && " + command_line);
}

TEST(OwnRobotGuide, ItsCommandsMakeARobotMove) {
  const testing::TemporaryFolder folder;
  const std::vector<std::string> commands = DocumentedCommands();
  ASSERT_GE(commands.size(), 4U);
  EXPECT_LE(commands.size(), 6U);
  std::string all = "set -e\n";
  for (const std::string& command : commands) all += command + '\n';
  const Outcome outcome = In(folder / "", all);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(
      ReadFile(SourcePath("docs/own-robot.md")),
      HasSubstr("  4 motions, 2 complete cycles; the robot where it should be after each\n"));
  EXPECT_THAT(
      outcome.text,
      HasSubstr("  4 motions, 2 complete cycles; the robot where it should be after each\n"));
  EXPECT_THAT(outcome.text, HasSubstr("without torque, 3 s later: the robot stays"));
  EXPECT_TRUE(std::filesystem::exists(folder / "dipper/report/index.html"));
  // What the program says, and what the folder's own page says, are these commands.
  const std::string told = In(folder / "", "tumbler-new other --joints 1").text;
  const std::string page = ReadFile(folder / "dipper/README.md");
  for (std::size_t i = 2; i < commands.size(); ++i) {
    EXPECT_THAT(page, HasSubstr("    " + commands[i] + "\n"));
    EXPECT_THAT(testing::Replaced(told, "other.toml", "dipper.toml"),
                HasSubstr("    " + commands[i] + "\n"));
  }
}

TEST(OwnRobotGuide, FilesOfAnyNumberOfMotorsAreUsable) {
  for (int joints = 1; joints <= 8; ++joints) {
    const testing::TemporaryFolder folder;
    const std::string arguments = "a-robot --joints " + std::to_string(joints);
    ASSERT_EQ(In(folder / "", "tumbler-new " + arguments).exit_code, 0);
    const std::string made = folder / "a-robot";
    const Outcome model = In(made, "tumbler-model check a-robot.urdf");
    EXPECT_EQ(model.exit_code, 0) << model.text;
    EXPECT_THAT(model.text, HasSubstr("tumbler-optimize takes it"));
    // A task that is usable gets as far as its results, which cannot be written here.
    for (const char* task : {"rise", "lie"}) {
      const Outcome loaded =
          In(made, std::string("tumbler-optimize tasks/") + task + ".toml --out .");
      EXPECT_EQ(loaded.text, "error: .: is a directory, not a file\n") << joints;
    }
    const Outcome drives = In(made, "tumbler-bench sim read --drives drives.toml");
    EXPECT_EQ(drives.exit_code, 0) << drives.text;
    EXPECT_THAT(drives.text, HasSubstr("mit " + std::to_string(joints)));
  }
}

TEST(TumblerNew, ReplacesNothingAndLeavesNothingBehind) {
  const testing::TemporaryFolder folder;
  std::filesystem::create_directory(folder / "taken");
  testing::WriteFile(folder / "taken/precious", "keep me");
  EXPECT_THAT(In(folder / "", "tumbler-new taken").text, HasSubstr("taken: is there already"));
  EXPECT_EQ(In(folder / "", "tumbler-new taken").exit_code, 1);
  EXPECT_EQ(ReadFile(folder / "taken/precious"), "keep me");
  for (const char* arguments :
       {"Big", "../up", "-x", "a/b", "''", "ok --joints 0", "ok --joints 9"}) {
    EXPECT_EQ(In(folder / "", std::string("tumbler-new ") + arguments).exit_code, 1) << arguments;
  }
  const Outcome full = In(folder / "", "ulimit -f 1; tumbler-new full");
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.text, HasSubstr("File too large"));
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder / ""))
    left.push_back(entry.path().filename().string());
  EXPECT_THAT(left, ::testing::ElementsAre("taken"));
}

}  // namespace
}  // namespace tumbler
