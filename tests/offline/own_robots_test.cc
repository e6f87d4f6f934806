// Robots that are not shipped: every search ends either with a motion that does what its task asks
// for, or with status 2 and the reason, and nothing written.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Program;
using testing::ReadFile;
using testing::Replaced;

struct Ending {
  int status = 0;
  std::string text;
  bool written = false;
  PrimitiveFile file;
};

/// The ending of a task in tests/data, with another text.
Ending Optimize(const std::string& task, const std::string& seed) {
  const testing::TemporaryFolder folder;
  const std::string robots = testing::SourcePath("tests/data/robots");
  testing::WriteFile(folder / "task.toml", Replaced(task, "../robots", robots));
  const std::string out = folder / "motion.toml";
  Program program({testing::ProgramPath("tumbler optimize"), folder / "task.toml", "--seed", seed,
                   "--out", out});
  Ending ending;
  ending.status = program.Wait();
  ending.text = program.text();
  ending.written = std::filesystem::exists(out);
  if (ending.written) ending.file = LoadPrimitive(out);
  return ending;
}

void ExpectMotionOrReason(const Ending& ending) {
  if (ending.status == 0) {
    ASSERT_TRUE(ending.written);
    EXPECT_FALSE(ending.file.purpose.empty());
    EXPECT_TRUE(std::ranges::all_of(ending.file.purpose, &PurposeFigure::met));
    return;
  }
  EXPECT_EQ(ending.status, 2) << ending.text;
  EXPECT_FALSE(ending.written);
  EXPECT_THAT(ending.text,
              AllOf(HasSubstr("no motion was found: "), HasSubstr("no file was written")));
}

std::string TaskText(const std::string& name) {
  return ReadFile(testing::SourcePath("tests/data/tasks/" + name));
}

class OwnRobots : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Seeds, OwnRobots, ::testing::Values("7", "11"));

TEST_P(OwnRobots, AHopOfThreeMotorsEndsWithTheHopOrTheReason) {
  ExpectMotionOrReason(
      Optimize(Replaced(TaskText("hop.toml"), "promising = 4", "promising = 4\nmax_samples = 300"),
               GetParam()));
}

TEST_P(OwnRobots, AStepOfFourMotorsEndsWithTheStepOrTheReason) {
  const std::string quick =
      Replaced(TaskText("step.toml"), "max_samples = 1000", "max_samples = 100");
  ExpectMotionOrReason(
      Optimize(Replaced(quick, "max_evaluations = 200", "max_evaluations = 60"), GetParam()));
}

TEST(OwnRobot, AHopOf200MillimetresIsFound) {
  const Ending ending = Optimize(TaskText("hop.toml"), "7");
  ASSERT_EQ(ending.status, 0) << ending.text;
  EXPECT_NEAR(ending.file.exit.root_x_m - ending.file.entry.root_x_m, 0.2, 0.02);
  EXPECT_NEAR(ending.file.exit.root_pitch_rad, 0, 0.05);
}

TEST(OwnRobot, ATargetThatCannotBeMetEndsWithItsName) {
  std::string far = Replaced(TaskText("hop.toml"), "target = 0.2", "target = 5.0");
  far = Replaced(far, "promising = 4", "promising = 4\nmax_samples = 150");
  const Ending ending =
      Optimize(Replaced(far, "max_evaluations = 200", "max_evaluations = 40"), "1");
  EXPECT_EQ(ending.status, 2);
  EXPECT_FALSE(ending.written);
  EXPECT_THAT(ending.text,
              AllOf(HasSubstr("no motion was found: "), HasSubstr("x, settled: asked 5, got")));
}

TEST(OwnRobot, AnAcrobotThatLiesFlatHasNotStoodUp) {
  const Ending ending = Optimize(TaskText("acrobot.toml"), "1");
  EXPECT_EQ(ending.status, 2);
  EXPECT_FALSE(ending.written);
  EXPECT_THAT(ending.text, AllOf(HasSubstr("no motion was found: "),
                                 HasSubstr("pitch, settled: asked 1.5708, got")));
}

TEST(OwnRobot, ThatHasNoShapesIsDrawnAsRods) {
  std::string arm = ReadFile(testing::SourcePath("primitives/acrobot/acrobot.urdf"));
  for (std::size_t at = 0; (at = arm.find("<visual>")) != std::string::npos;)
    arm.erase(at, arm.find("</visual>") + 9 - at);
  ASSERT_EQ(arm.find("<geometry>"), std::string::npos);
  const testing::TaskFolder folder(
      Replaced(TaskText("arm.toml"), "../../../primitives/acrobot/acrobot.urdf",
               "../robots/tumbler.urdf"),
      arm);
  const std::string motion = folder / "arm.toml", record = folder / "arm.rec";
  const auto run = [](const std::vector<std::string>& command) {
    const testing::Outcome outcome = testing::RunProgram(command);
    EXPECT_EQ(outcome.exit_code, 0) << command[0] << "\n" << outcome.text;
  };
  run({"tumbler optimize", folder.task_file(), "--quiet", "--out", motion, "--report",
       folder / "found"});
  run({"tumbler run", "sim", motion, "--record", record});
  run({"tumbler view", record, "--out", folder / "page"});
  run({"tumbler record", record, "--mcap", folder / "arm.mcap"});
  EXPECT_THAT(ReadFile(folder / "found/index.html"), HasSubstr("\"lower\""));
}

TEST(Hopper, JumpsOntoItsStepThroughTheRuntimeAndStaysThere) {
  const std::string folder = testing::SourcePath("primitives/hopper/");
  const testing::Outcome run = testing::RunProgram(
      {"tumbler run", "sim", folder + "hopper.toml", "--twin", folder + "twin.toml"});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(
      run.text,
      AllOf(HasSubstr("completed: hopper on sim"), HasSubstr("z, 2 s later: asked 0.07, got 0.07"),
            ::testing::Not(HasSubstr("MISSED")), ::testing::Not(HasSubstr("FELL"))));
  for (const char* other : {"handstand", "leg1", "tumbler-drives"})
    EXPECT_THAT(run.text, ::testing::Not(HasSubstr(other)));
}

TEST(Hopper, FliesFromTheGroundToTheStep) {
  const PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/hopper/hop_up.toml"));
  double left_ground_s = 0, reached_step_s = 1e9;
  for (const ContactInterval& contact : file.contacts) {
    EXPECT_THAT(contact.shape, ::testing::StartsWith("foot/"));
    if (contact.obstacle == "ground") {
      left_ground_s = std::max(left_ground_s, contact.end_s);
    } else {
      reached_step_s = std::min(reached_step_s, contact.start_s);
    }
  }
  EXPECT_GT(reached_step_s - left_ground_s, 0.05);
  EXPECT_NEAR(file.exit.root_x_m - file.entry.root_x_m, 0.23, 0.02);
  EXPECT_NEAR(file.exit.root_z_m - file.entry.root_z_m, 0.02, 0.002);
}

TEST(Acrobot, SwingsUpThroughTheRuntimeAndArrivesAboveItsBar) {
  const std::string folder = testing::SourcePath("primitives/acrobot/");
  const testing::Outcome run = testing::RunProgram(
      {"tumbler run", "sim", folder + "acrobot.toml", "--twin", folder + "twin.toml"});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text,
              AllOf(HasSubstr("completed: acrobot on sim"),
                    HasSubstr("pitch, settled: asked 3.14159"), ::testing::Not(HasSubstr("MISSED")),
                    ::testing::Not(HasSubstr("NOT")), ::testing::Not(HasSubstr("FELL"))));
  for (const char* other : {"handstand", "leg", "stand", "foot", "ground", "contact"})
    EXPECT_THAT(run.text, ::testing::Not(HasSubstr(other)));
}

TEST(Acrobot, LanesAndTwinMostlyAgreeAndNothingSpeaksOfAGround) {
  const std::string folder = testing::SourcePath("primitives/acrobot/");
  const testing::Outcome study = testing::RunProgram(
      {"tumbler robustness", folder + "acrobot.toml", "--drives", folder + "drives.toml",
       "--robots", "24", "--scale", "0.1", "--compare-lanes", "--quiet"});
  EXPECT_EQ(study.exit_code, 0) << study.text;
  const std::string agree = "lanes and twin agree whether ";
  const std::size_t at = study.text.find(agree);
  ASSERT_NE(at, std::string::npos) << study.text;
  EXPECT_GE(std::stoi(study.text.substr(at + agree.size())), 21) << study.text;
  for (const char* other : {"friction", "stiffness", "damping", "fell", "do not stand"})
    EXPECT_THAT(study.text, ::testing::Not(HasSubstr(other)));
}

}  // namespace
}  // namespace tumbler
