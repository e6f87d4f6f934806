// A motion that starts where another one leaves the robot: its start pose, the refusals, and that
// its primitive needs no other file.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <string>

#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "tests/support/files.h"
#include "tests/support/motion_cost.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Program;
using testing::QuickTask;
using testing::ReadFile;
using testing::Replaced;
using testing::ShippedRobot;
using testing::TaskFolder;
using testing::WriteFile;

/// A motion of both legs, a little away from home.
struct Before {
  Task task = ParseTask(QuickTask(), "task.toml", ShippedRobot(), "robot.urdf");
  SolveOutcome outcome = Solve(task.problem, {});
  PrimitiveFile file = MakePrimitiveFile(task, outcome, outcome.solutions.front());
};
const PrimitiveFile& TheOneBefore() {
  static const Before before;
  return before.file;
}

/// A task back home, from the shape in which that motion ends.
std::string TaskBack() {
  std::string text =
      Replaced(QuickTask(), "leg1 = -1.5707963267948966, leg2 = 1.5707963267948966", "START");
  text = Replaced(text, "leg1 = -1.2, leg2 = 1.3",
                  "leg1 = -1.5707963267948966, leg2 = 1.5707963267948966");
  text = Replaced(text, "START", "leg1 = -1.2, leg2 = 1.3");
  return Replaced(text, "name = \"handstand\"", "name = \"back\"");
}

std::string Refusal(const std::string& task, const PrimitiveFile& before,
                    const std::string& robot = ShippedRobot()) {
  const TaskFolder folder(task, robot);
  try {
    LoadTask(folder.task_file(), before, "before.toml");
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(StartFrom, TakesTheSimulatedExitAndNotTheIdealPose) {
  const PrimitiveFile& before = TheOneBefore();
  const TaskFolder folder(TaskBack());
  const Problem ideal = LoadTask(folder.task_file()).problem;
  const Task task = LoadTask(folder.task_file(), before, "before.toml");
  EXPECT_EQ(task.problem.start_q[0], before.exit.root_x_m);
  EXPECT_EQ(task.problem.start_q[1], before.exit.root_z_m);
  EXPECT_EQ(task.problem.start_q[2], before.exit.root_pitch_rad);
  EXPECT_EQ(task.problem.start_q[3], -1.2);
  EXPECT_EQ(task.problem.start_q[4], 1.3);
  EXPECT_NE(task.problem.start_q[0], ideal.start_q[0]) << "or this test could not fail";
}

TEST(StartFrom, ThePrimitiveIsWholeByItself) {
  const TaskFolder folder(TaskBack());
  const Task task = LoadTask(folder.task_file(), TheOneBefore(), "before.toml");
  const SolveOutcome outcome = Solve(task.problem, {});
  const Solution& best = outcome.solutions.front();
  const PrimitiveFile file =
      ParsePrimitive(ToToml(MakePrimitiveFile(task, outcome, best)), "back.toml");
  EXPECT_EQ(file.provenance.start_file, "before.toml");
  EXPECT_EQ(file.provenance.start_hash, ContentHash(TheOneBefore()));
  // The file alone gives the same problem again. Its entry, not the pose in the task, is the start.
  const Problem again = TaskOf(file).problem;
  EXPECT_EQ(again.start_q, task.problem.start_q);
  EXPECT_EQ(testing::CostOf(again, best.x), file.provenance.objective);
  const MotionSummary summary = Summarize(again, best.x);
  EXPECT_EQ(summary.exit.root_x_m, file.exit.root_x_m);
  EXPECT_EQ(summary.exit.root_pitch_rad, file.exit.root_pitch_rad);
  // So it does when the next primitive is made from it.
  EXPECT_EQ(ToToml(MakePrimitiveFile(TaskOf(file), outcome, best)), ToToml(file));
}

TEST(StartFrom, AJointElsewhereIsRefusedByNameAndAmount) {
  const std::string text =
      Refusal(Replaced(TaskBack(), "leg2 = 1.3", "leg2 = 1.25"), TheOneBefore());
  EXPECT_THAT(text, AllOf(HasSubstr("task.toml:"), HasSubstr("start.joints_rad.leg2: is 1.25 rad"),
                          HasSubstr("'handstand' (before.toml) has it at 1.3 rad"),
                          HasSubstr("0.05 rad apart; allowed: <= 1e-06 rad")));
}

TEST(StartFrom, ARobotUpsideDownIsRefusedByThePitch) {
  PrimitiveFile before = TheOneBefore();
  before.exit.root_pitch_rad += 3.0;
  EXPECT_THAT(Refusal(TaskBack(), before), AllOf(HasSubstr("start.pitch_rad: is 0 rad"),
                                                 HasSubstr("rad apart; allowed: <= 0.3 rad")));
}

TEST(StartFrom, AnotherRobotIsRefused) {
  const std::string heavier = Replaced(ShippedRobot(), "mass value=\"1.0\"", "mass value=\"1.1\"");
  EXPECT_THAT(Refusal(TaskBack(), TheOneBefore(), heavier),
              AllOf(HasSubstr("before.toml: provenance.robot_urdf: is not the robot of the task"),
                    HasSubstr("make the primitive again")));
}

TEST(StartFrom, AnotherGroundIsRefused) {
  EXPECT_THAT(
      Refusal(Replaced(TaskBack(), "mu = ", "mu = 0.4  # "), TheOneBefore()),
      HasSubstr("before.toml: provenance.task_toml: has other [contact], [[obstacle]] or slope"));
  EXPECT_THAT(
      Refusal(Replaced(TaskBack(), "point_m = [0.0, 0.0]", "point_m = [0.0, 0.1]"), TheOneBefore()),
      HasSubstr("has other [contact], [[obstacle]] or slope"));
  EXPECT_THAT(Refusal(Replaced(TaskBack(), "root = ", "slope_rad = 0.05\nroot = "), TheOneBefore()),
              HasSubstr("or slope"));
}

TEST(StartFrom, OtherMotorsAreRefused) {
  EXPECT_THAT(Refusal(TaskBack() + "\n[motor]\ndry_friction_nm = 0.1\n", TheOneBefore()),
              HasSubstr("before.toml: provenance.task_toml: has other [motor] or [passive]"));
}

TEST(StartFrom, TheProgramRecordsItAndNamesWhatDoesNotFit) {
  const TaskFolder folder(TaskBack());
  WriteFile(folder / "before.toml", ToToml(TheOneBefore()));
  const auto run = [&folder](const std::string& from, const std::string& to) {
    Program program({testing::ProgramPath("tumbler optimize"), folder.task_file(), "--start-from",
                     folder / from, "--out", folder / to});
    const int status = program.Wait();
    return std::pair(status, program.text());
  };
  ASSERT_EQ(run("before.toml", "back.toml").first, 0);
  const PrimitiveFile back = LoadPrimitive(folder / "back.toml");
  EXPECT_EQ(back.entry.root_x_m, TheOneBefore().exit.root_x_m);
  EXPECT_EQ(back.provenance.start_file, folder / "before.toml");
  // It ends at home, and the same task does not start there.
  const auto [status, text] = run("back.toml", "further.toml");
  EXPECT_EQ(status, 1);
  EXPECT_THAT(text, AllOf(HasSubstr("start.joints_rad.leg1"), HasSubstr("'back'")));
  EXPECT_FALSE(std::filesystem::exists(folder / "further.toml"));
  // The motion that it starts from must not be overwritten.
  EXPECT_EQ(run("before.toml", "before.toml").first, 1);
  EXPECT_EQ(ReadFile(folder / "before.toml"), ToToml(TheOneBefore()));
}

TEST(Guess, TheProgramSolvesFromItAndRecordsIt) {
  const TaskFolder folder(Replaced(QuickTask(), "duration_s = 0.5", "duration_s = 0.55"));
  WriteFile(folder / "known.toml", ToToml(TheOneBefore()));
  const auto run = [&folder](std::vector<std::string> options) {
    std::vector<std::string> line = {testing::ProgramPath("tumbler optimize"), folder.task_file(),
                                     "--guess", folder / "known.toml"};
    line.insert(line.end(), options.begin(), options.end());
    Program program(line);
    const int status = program.Wait();
    return std::pair(status, program.text());
  };
  ASSERT_EQ(run({"--out", folder / "new.toml"}).first, 0);
  const PrimitiveFile made = LoadPrimitive(folder / "new.toml");
  EXPECT_EQ(made.provenance.guess_file, folder / "known.toml");
  EXPECT_EQ(made.provenance.guess_hash, ContentHash(TheOneBefore()));
  EXPECT_LT(made.provenance.evaluations, 30) << "a search alone would take 8, and 2 solves 50";
  // The file alone gives the same file again.
  EXPECT_EQ(TaskOf(made).guess_hash, made.provenance.guess_hash);

  const auto [status, text] = run({"--seed", "3"});
  EXPECT_EQ(status, 1);
  EXPECT_THAT(text, AllOf(HasSubstr("--guess"), HasSubstr("--seed")));
  // What it starts from must not be overwritten.
  EXPECT_EQ(run({"--out", folder / "known.toml"}).first, 1);
  EXPECT_EQ(ReadFile(folder / "known.toml"), ToToml(TheOneBefore()));
}

}  // namespace
}  // namespace tumbler
