// A new robot moves by the commands of docs/own-robot.md, and its files are usable with any number
// of motors.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
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
  const std::string told = In(folder / "", "tumbler new other --joints 1").text;
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
    ASSERT_EQ(In(folder / "", "tumbler new " + arguments).exit_code, 0);
    const std::string made = folder / "a-robot";
    const Outcome model = In(made, "tumbler model check a-robot.urdf");
    EXPECT_EQ(model.exit_code, 0) << model.text;
    EXPECT_THAT(model.text, HasSubstr("tumbler optimize takes it"));
    // A task that is usable gets as far as its results, which cannot be written here.
    for (const char* task : {"rise", "lie"}) {
      const Outcome loaded =
          In(made, std::string("tumbler optimize tasks/") + task + ".toml --out .");
      EXPECT_EQ(loaded.text, "tumbler optimize: .: is a directory, not a file\n") << joints;
    }
    const Outcome drives = In(made, "tumbler bench sim read --drives drives.toml");
    EXPECT_EQ(drives.exit_code, 0) << drives.text;
    EXPECT_THAT(drives.text, HasSubstr("mit " + std::to_string(joints)));
  }
}

TEST(TumblerNew, MakesTheFilesOfARobotThatHasAUrdfAndTheyMoveIt) {
  const testing::TemporaryFolder folder;
  const std::string urdf = SourcePath("tests/data/robots/sweeper.urdf");
  const Outcome made = In(folder / "", "tumbler new sweeper --urdf " + urdf);
  EXPECT_EQ(made.exit_code, 0) << made.text;
  EXPECT_THAT(made.text, HasSubstr("note: locked, as no task moves them: grip, shoulder_yaw"));
  EXPECT_THAT(made.text,
              HasSubstr("of which these joints move: shoulder_pitch, elbow. Go on with\n"));
  EXPECT_EQ(ReadFile(folder / "sweeper/sweeper.urdf"), ReadFile(urdf));
  const std::string task = ReadFile(folder / "sweeper/tasks/bend.toml");
  EXPECT_THAT(task, HasSubstr("root = \"planar-xz\""));
  EXPECT_THAT(task, HasSubstr("locked = { grip = 0.005, shoulder_yaw = 0.0 }"));
  EXPECT_THAT(task, HasSubstr("joints_rad = { shoulder_pitch = 0.0, elbow = 0.12 }"));
  EXPECT_THAT(ReadFile(folder / "sweeper/drives.toml"), ::testing::Not(HasSubstr("shoulder_yaw")));
  const Outcome moved =
      In(folder / "sweeper",
         "set -e\n"
         "tumbler optimize tasks/bend.toml --out motions/bend.toml --report report\n"
         "tumbler optimize tasks/unbend.toml --start-from motions/bend.toml --out "
         "motions/unbend.toml\n"
         "tumbler run sim sweeper.toml --cycles 1 --twin twin.toml --record run.rec\n"
         "tumbler view run.rec --out page\n"
         "tumbler record run.rec --mcap run.mcap\n");
  EXPECT_EQ(moved.exit_code, 0) << moved.text;
  EXPECT_THAT(moved.text, HasSubstr("2 motions, 1 complete cycle"));
  // A motion with other joints locked is of another robot.
  testing::WriteFile(folder / "sweeper/tasks/other.toml",
                     testing::Replaced(ReadFile(folder / "sweeper/tasks/unbend.toml"),
                                       "grip = 0.005", "grip = 0.02"));
  EXPECT_THAT(In(folder / "sweeper",
                 "tumbler optimize tasks/other.toml --start-from motions/bend.toml --out o.toml")
                  .text,
              HasSubstr("or locked joints, than the task tasks/other.toml"));
}

TEST(TumblerNew, TheCommandsThatItPrintsMoveARobotThatRestsTilted) {
  const testing::TemporaryFolder folder;
  // Its front feet reach 0.11 m lower than its hind ones, 0.3 m behind them.
  std::string urdf = ReadFile(SourcePath("tests/data/robots/sweeper.urdf"));
  for (const char* side : {"0.1", "-0.1"}) {
    urdf = testing::Replaced(urdf, fmt::format("xyz=\"0.15 {} 0.02\"", side),
                             fmt::format("xyz=\"0.15 {} -0.09\"", side));
  }
  testing::WriteFile(folder / "tilted.urdf", urdf);
  const Outcome made = In(folder / "", "tumbler new tilted --urdf tilted.urdf");
  ASSERT_EQ(made.exit_code, 0) << made.text;
  std::string commands = "set -e\n";
  std::istringstream lines(made.text);
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("    ")) commands += line + '\n';
  const Outcome moved = In(folder / "", commands);
  EXPECT_EQ(moved.exit_code, 0) << moved.text;
  EXPECT_THAT(moved.text, HasSubstr("4 motions, 2 complete cycles; the robot where it should be"));
  for (const char* task : {"bend", "unbend"}) {
    const std::string text = ReadFile(folder / "tilted/tasks/" + task + ".toml");
    const std::size_t pitch = text.find("\npitch_rad = ");
    ASSERT_NE(pitch, std::string::npos);
    EXPECT_NEAR(std::stod(text.substr(pitch + 13)), std::atan2(0.11, 0.3), 0.03) << task;
  }
}

TEST(TumblerNew, FixesARobotThatDoesNotRestOnTheGroundAndRefusesOneThatNoTaskTakes) {
  const testing::TemporaryFolder folder;
  const std::string urdf = ReadFile(SourcePath("tests/data/robots/sweeper.urdf"));
  const auto make = [&](const std::string& name, const std::string& text, const char* more = "") {
    testing::WriteFile(folder / (name + ".urdf"), text);
    return In(folder / "", "tumbler new " + name + " --urdf " + name + ".urdf" + more);
  };
  const Outcome bare = make("bare", testing::ReplacedAll(urdf, "collision>", "visual>"));
  EXPECT_EQ(bare.exit_code, 0) << bare.text;
  EXPECT_THAT(bare.text, HasSubstr("its root link is fixed, as it does not rest on the ground: it "
                                   "has no collision shape to stand on"));
  const Outcome loaded = In(folder / "bare", "tumbler optimize tasks/bend.toml --out .");
  EXPECT_EQ(loaded.text, "tumbler optimize: .: is a directory, not a file\n");
  const Outcome asked =
      make("asked", testing::ReplacedAll(urdf, "collision>", "visual>"), " --root planar-xz");
  EXPECT_EQ(asked.exit_code, 1);
  EXPECT_FALSE(std::filesystem::exists(folder / "asked"));
  const Outcome weak = make("weak", testing::ReplacedAll(urdf, "effort=\"6\"", "effort=\"0\""));
  EXPECT_EQ(weak.exit_code, 1);
  EXPECT_THAT(weak.text, HasSubstr("joint 'shoulder_pitch': limit effort = 0; allowed: > 0 (and 1 "
                                   "more: `tumbler model check` lists all)"));
  EXPECT_FALSE(std::filesystem::exists(folder / "weak"));
}

TEST(TumblerNew, TakesMeshesWithTheRobotAndKeepsEndlessJointsWithinTheirDrives) {
  const testing::TemporaryFolder folder;
  std::string urdf = ReadFile(SourcePath("tests/data/robots/sweeper.urdf"));
  urdf = testing::Replaced(urdf, "<joint name=\"elbow\" type=\"revolute\">",
                           "<joint name=\"elbow\" type=\"continuous\">");
  urdf = testing::Replaced(urdf, "<link name=\"fore\">",
                           "<link name=\"fore\"><visual><geometry><mesh "
                           "filename=\"meshes/arm.stl\"/></geometry></visual>");
  testing::WriteFile(folder / "robot.urdf", urdf);
  std::filesystem::create_directories(folder.path() / "meshes");
  testing::WriteFile(folder / "meshes/arm.stl", "solid arm");
  const Outcome made = In(folder / "", "tumbler new robot --urdf robot.urdf");
  ASSERT_EQ(made.exit_code, 0) << made.text;
  EXPECT_EQ(ReadFile(folder / "robot/meshes/arm.stl"), "solid arm");
  EXPECT_THAT(ReadFile(folder / "robot/tasks/bend.toml"),
              HasSubstr("[limits.elbow]   # within the range of its drive\n"
                        "position_min_rad = -10.0\nposition_max_rad = 10.0\n"));
  const Outcome moved =
      In(folder / "robot",
         "set -e\n"
         "tumbler optimize tasks/bend.toml --out motions/bend.toml\n"
         "tumbler optimize tasks/unbend.toml --start-from motions/bend.toml --out "
         "motions/unbend.toml\n"
         "tumbler run sim robot.toml --cycles 1 --twin twin.toml\n");
  EXPECT_EQ(moved.exit_code, 0) << moved.text;
}

TEST(OwnRobot, OfWhichNoWindowCanBeLookedForKeepsItsMotion) {
  // It stands on one ball, and tips over as it moves.
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "tip.urdf",
                     R"(<robot name="tip">
<link name="base"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
<inertia ixx="0.003" iyy="0.003" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.02"/></geometry></collision></link>
<link name="a"><inertial><mass value="0.5"/>
<inertia ixx="0.003" iyy="0.003" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="spin" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.2"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="50" velocity="5"/></joint></robot>)");
  ASSERT_EQ(In(folder / "", "tumbler new tip --urdf tip.urdf").exit_code, 0);
  const Outcome found =
      In(folder / "tip", "tumbler optimize tasks/bend.toml --out bend.toml --window");
  EXPECT_EQ(found.exit_code, 4) << found.text;
  EXPECT_THAT(found.text, HasSubstr("no window was found: primitive: 'bend' ends with its root in "
                                    "motion"));
  EXPECT_TRUE(std::filesystem::exists(folder / "tip/bend.toml"));
}

TEST(EndlessSequence, IsRefusedWhereItWouldBePlayed) {
  const testing::TemporaryFolder folder;
  for (const char* motion : {"handstand", "downstand", "roll"}) {
    testing::WriteFile(folder / (std::string(motion) + ".toml"),
                       ReadFile(SourcePath(std::string("primitives/nominal/") + motion + ".toml")));
  }
  testing::WriteFile(folder / "gait.toml",
                     testing::ReplacedAll(ReadFile(SourcePath("primitives/nominal/gait.toml")),
                                          "ends_cycle = true", "ends_cycle = false"));
  for (const char* command : {"tumbler run sim gait.toml --cycles 2",
                              "tumbler robustness gait.toml --cycles 1 --robots 1"}) {
    const Outcome outcome = In(folder / "", command);
    EXPECT_EQ(outcome.exit_code, 1) << command;
    EXPECT_THAT(outcome.text, ::testing::ContainsRegex("gait.toml:[0-9]+: node\\[[0-9]\\]: "));
    EXPECT_THAT(outcome.text, HasSubstr("goes round for ever"));
  }
}

TEST(TumblerNew, ReplacesNothingAndLeavesNothingBehind) {
  const testing::TemporaryFolder folder;
  std::filesystem::create_directory(folder / "taken");
  testing::WriteFile(folder / "taken/precious", "keep me");
  EXPECT_THAT(In(folder / "", "tumbler new taken").text, HasSubstr("taken: is there already"));
  EXPECT_EQ(In(folder / "", "tumbler new taken").exit_code, 1);
  EXPECT_EQ(ReadFile(folder / "taken/precious"), "keep me");
  for (const char* arguments :
       {"Big", "../up", "-x", "a/b", "''", "ok --joints 0", "ok --joints 9"}) {
    EXPECT_EQ(In(folder / "", std::string("tumbler new ") + arguments).exit_code, 1) << arguments;
  }
  const Outcome full = In(folder / "", "ulimit -f 1; tumbler new full");
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.text, HasSubstr("File too large"));
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder / ""))
    left.push_back(entry.path().filename().string());
  EXPECT_THAT(left, ::testing::ElementsAre("taken"));
}

}  // namespace
}  // namespace tumbler
