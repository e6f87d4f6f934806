// A motion for the robots that others, which are tried before it, do not carry.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/solve/guess.h"
#include "offline/solve/robust_search.h"
#include "offline/solve/solver.h"
#include "tests/support/files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::QuickTask;
using testing::Replaced;
using testing::ShippedRobot;

std::string Shipped(const std::string& name) { return testing::SourcePath("primitives/" + name); }

/// The shipped handstand's task, improved for a moment with few robots that differ twice as much.
Task HandstandTask() {
  Task task = LoadTask(Shipped("tasks/handstand.toml"));
  RobustSettings& robust = *task.problem.robust;
  robust.polish_robots = 16;
  robust.polish_rounds = 1;
  robust.generations = 9;
  robust.starts = 8;
  TakeGuess(task, LoadPrimitive(Shipped("handstand.toml")), "handstand.toml");
  return task;
}

TEST(Complement, IsFoundOnRobotsThatTheOtherMotionDoesNotCarry) {
  Task task = HandstandTask();
  const double of_all = SolveRobust(task.problem, {}, task.guess).history.back().cost;
  TakeComplement(task, LoadPrimitive(Shipped("handstand.toml")), "handstand.toml");
  SolveOptions options;
  options.threads = 2;
  const SolveOutcome outcome =
      SolveRobust(task.problem, options, task.guess, nullptr, task.complement);
  // The guess is the motion that fails on all of the robots, and most of these cost it more than 1,
  // because they fall. Of all robots it carries four in five.
  EXPECT_LT(of_all, 0.35);
  ASSERT_FALSE(outcome.history.empty());
  EXPECT_GT(outcome.history.back().cost, 0.5);
  EXPECT_LT(outcome.history.back().cost, 0.95);
  ASSERT_FALSE(outcome.solutions.empty());
  EXPECT_NE(outcome.solutions.front().x, task.guess);
}

/// On both feet, the legs move a little.
Task StandingTask(const std::string& robust = "") {
  const std::string text = QuickTask() + "\n[robust]\nsamples = 16\nstarts = 1\nimproved = 1\n" +
                           "polish_robots = 8\ngenerations = 2\n" + robust;
  return ParseTask(text, "task.toml", ShippedRobot(), "robot.urdf");
}

/// A motion that was found for it, and how.
struct Standing {
  Task task = StandingTask();
  SolveOutcome outcome = SolveRobust(task.problem, {});
  PrimitiveFile file = MakePrimitiveFile(task, outcome, outcome.solutions.front());
};
const Standing& TheStanding() {
  static const Standing standing;
  return standing;
}
const PrimitiveFile& StandingMotion() { return TheStanding().file; }

TEST(Complement, OfAMotionThatCarriesEveryRobotIsRefused) {
  Task task = StandingTask("polish_scale = 0\n");
  TakeComplement(task, StandingMotion(), "standing.toml");
  try {
    SolveRobust(task.problem, {}, {}, nullptr, task.complement);
    FAIL() << "a motion was found for robots that there are none of";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("carry all but 0 of"));
  }
}

TEST(Complement, IsRecordedInThePrimitiveWithWhatItComplements) {
  const PrimitiveFile& before = StandingMotion();
  EXPECT_TRUE(before.provenance.complement_files.empty());
  Task task = StandingTask();
  const SolveOutcome& outcome = TheStanding().outcome;
  TakeComplement(task, before, "one.toml");
  TakeComplement(task, before, "two.toml");
  const PrimitiveFile made = MakePrimitiveFile(task, outcome, outcome.solutions.front());
  const PrimitiveFile read = ParsePrimitive(ToToml(made), "made.toml");
  EXPECT_THAT(read.provenance.complement_files, ::testing::ElementsAre("one.toml", "two.toml"));
  EXPECT_THAT(read.provenance.complement_hashes,
              ::testing::Each(::testing::Eq(ContentHash(before))));
  EXPECT_EQ(TaskOf(read).complement_hashes, read.provenance.complement_hashes);
}

std::string Refusal(Task task, const PrimitiveFile& file) {
  try {
    TakeComplement(task, file, "before.toml");
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Complement, IsRefusedWhereOneIsNotTriedAfterTheOther) {
  const PrimitiveFile& before = StandingMotion();
  EXPECT_EQ(Refusal(StandingTask(), before), "accepted");
  EXPECT_THAT(Refusal(ParseTask(QuickTask(), "task.toml", ShippedRobot(), "robot.urdf"), before),
              HasSubstr("task.toml: robust: is missing"));
  EXPECT_THAT(Refusal(StandingTask("\n[robust.feedback]\nlink = \"leg2_link\"\n"), before),
              HasSubstr("task.toml: robust.feedback: is here"));
  EXPECT_THAT(Refusal(StandingTask("kp_nm_per_rad = 41\n"), before),
              HasSubstr("before.toml: drives: are 100 N m/rad and 5 N m s/rad"));
  EXPECT_THAT(Refusal(StandingTask(), LoadPrimitive(Shipped("handstand_sensor.toml"))),
              HasSubstr("before.toml: feedback: corrects the motion"));
  PrimitiveFile turned = before;
  turned.entry.root_pitch_rad += 3;
  EXPECT_THAT(Refusal(StandingTask(), turned), HasSubstr("before.toml: entry.root_pitch_rad: is "));
  PrimitiveFile without = LoadPrimitive(Shipped("downstand.toml"));
  without.drives.reset();
  without.entry.root_pitch_rad = 0;
  EXPECT_THAT(Refusal(StandingTask(), without),
              HasSubstr("before.toml: joint: 'leg1' begins at 0 rad, and the task's at -1.5708"));
}

}  // namespace
}  // namespace tumbler
