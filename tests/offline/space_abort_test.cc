// What a robot in space comes to when its motion cannot go on.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <string>

#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "offline/certify/certificate.h"
#include "offline/problem/task_toml.h"
#include "offline/studies/abort_check.h"
#include "offline/studies/abort_study.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::ShippedRobot;
using testing::SourcePath;
using testing::TemporaryFolder;

/// The tumbler lets itself fall from a hand's breadth and moves its legs on the way. In space it
/// stays in its plane.
PrimitiveFile Drop(bool in_space) {
  const std::string text =
      std::string(
          "format = \"tumbler-task\"\nversion = 1\nname = \"drop\"\nrobot = "
          "\"tumbler.urdf\"\nduration_s = 0.6\nsettle_s = 0.4\n") +
      (in_space ? "root = \"floating\"\n" : "root = \"planar-xz\"\n") +
      "[start]\nz_m = 0.42\njoints_rad = { leg1 = -1.5707963267948966, leg2 = 1.5707963267948966 "
      "}\n[end]\njoints_rad = { leg1 = -1.2, leg2 = 1.3 }\n[contact]\nstiffness_n_per_m = "
      "1.0e4\ndamping_n_s_per_m = 100.0\nd_on_m = 0.01\nd_off_m = 0.0075\nmu = 0.3\n"
      "v_max_m_per_s = 0.05\n[[cost]]\nterm = \"effort\"\nweight = 1.0e-3\n[[obstacle]]\nname = "
      "\"ground\"\n" +
      (in_space ? "point_m = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]\n"
                : "point_m = [0.0, 0.0]\nnormal = [0.0, 1.0]\n");
  const Task task =
      ParseTask(text, "drop_task.toml", ShippedRobot(), "tumbler.urdf", TaskSpaces::kPlaneAndSpace);
  Solution solution;
  for (const ActuatedJoint& joint : task.problem.joints) {
    const int points = joint.free_points();
    for (int i = 0; i < points; ++i) {
      solution.x.push_back(joint.start_rad +
                           (i + 1.0) / (points + 1.0) * (joint.end_rad - joint.start_rad));
    }
  }
  return MakePrimitiveFile(task, {}, solution);
}

/// Both motions in files.
class DropAborts : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    testing::WriteFile(Path(false), ToToml(Drop(false)));
    testing::WriteFile(Path(true), ToToml(Drop(true)));
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string Path(bool in_space) {
    return (folder_->path() / (in_space ? "space.toml" : "plane.toml")).string();
  }
  static AbortStudy Study(bool in_space) {
    AbortStudy study;
    study.primitive = Path(in_space);
    return study;
  }

 private:
  static std::unique_ptr<TemporaryFolder> folder_;
};
std::unique_ptr<TemporaryFolder> DropAborts::folder_;

AbortTable<double> OneWay(const Primitive<double>& primitive, AbortWay way) {
  AbortTable<double> table;
  table.span_count = 1;
  AbortSpan<double>& span = table.span_storage[0];
  span.until_s = primitive.duration_s;
  span.way = way;
  if (way == AbortWay::kRollOut) span.late_max_s = 0.04;
  if (way != AbortWay::kFold) return table;
  span.limits_share = 0.3;
  for (std::size_t j = 0; j < primitive.motions().size(); ++j)
    span.position_rad[j] = primitive.joints[j].position.control_points().front();
  return table;
}

TEST_F(DropAborts, OfARobotThatStaysInThePlaneEndAsInThePlane) {
  const AbortTrials plane = LoadAbortTrials(Study(false)), space = LoadAbortTrials(Study(true));
  for (const AbortWay way : {AbortWay::kCatch, AbortWay::kFold, AbortWay::kDamp}) {
    for (const AbortCause cause : {AbortCause::kOperatorStop, AbortCause::kLateTick}) {
      SCOPED_TRACE(::testing::Message() << static_cast<int>(way) << ' ' << ToString(cause));
      AbortTrial trial;
      trial.variation = AbortRobot(Study(false), plane.shared(), 0);
      trial.time_s = 0.1;
      trial.cause = cause;
      trial.late_s = 0.01;
      trial.table = OneWay(plane.primitive(), way);
      const AbortOutcome in_plane = plane.Play(trial);
      trial.variation = AbortRobot(Study(true), space.shared(), 0);
      const AbortOutcome in_space = space.Play(trial);
      EXPECT_GT(in_plane.impact_m_s, 0.3) << "it never fell";
      EXPECT_NEAR(in_space.impact_m_s, in_plane.impact_m_s, 1e-3);
      EXPECT_NEAR(in_space.torque_nm, in_plane.torque_nm, 0.05);
      EXPECT_EQ(in_space.link, in_plane.link);
      EXPECT_EQ(in_space.fault, in_plane.fault);
      EXPECT_EQ(in_space.reaction, in_plane.reaction);
      EXPECT_EQ(in_space.rests_as, in_plane.rests_as);
      EXPECT_EQ(in_space.setpoints_outside_limits, 0);
    }
  }
}

TEST_F(DropAborts, ATableIsFoundWrittenAndChecked) {
  AbortStudy study = Study(true);
  study.robots = 2;
  study.step_s = 0.3;
  const AbortResult result = FindAborts(study);
  ASSERT_EQ(result.parts.size(), 2U);
  EXPECT_GT(result.table.span_count, 0);
  double chosen = 0, damped = 0;
  for (const AbortPart& part : result.parts) {
    chosen += part.costs[part.chosen].cost_m_s();
    damped += part.costs.back().cost_m_s();
  }
  EXPECT_LE(chosen, damped) << "damping is one of the ways";
  WriteAborts(result);
  const PrimitiveFile file = LoadPrimitive(study.primitive);
  EXPECT_TRUE(file.primitive.aborts.present());
  EXPECT_TRUE(file.entry.is_in_space());
  study.robots = 4;
  const AbortCheckResult check = CheckAborts(study);
  ASSERT_EQ(check.aborts.size(), 4U);
  EXPECT_EQ(check.outside_limits(), 0);
}

TEST_F(DropAborts, RobotsDifferInAllButTheLengthsOfTheirLinks) {
  AbortStudy study = Study(true);
  study.spreads.start_rate_rad_s = 0.5;
  study.spreads.gain = 0.2;
  const AbortTrials trials = LoadAbortTrials(study);
  AbortTrial trial;
  trial.time_s = 0.1;
  trial.variation = AbortRobot(study, trials.shared(), 0);
  const double model_m_s = trials.Play(trial).impact_m_s;
  trial.variation = AbortRobot(study, trials.shared(), 1);
  EXPECT_NE(trials.Play(trial).impact_m_s, model_m_s);
  study.spreads.length = 0.1;
  try {
    LoadAbortTrials(study);
    ADD_FAILURE() << "accepted";
  } catch (const Refused& refused) {
    EXPECT_THAT(refused.what(), HasSubstr("--length"));
  }
}

TEST(Solo8Aborts, AStopIsCaughtOnTheWayAndItStandsOn) {
  AbortStudy study;
  study.primitive = SourcePath("primitives/solo8/walk.toml");
  study.drives = SourcePath("primitives/solo8/drives.toml");
  const AbortTrials trials = LoadAbortTrials(study);
  AbortTrial trial;
  trial.variation = AbortRobot(study, trials.shared(), 0);
  trial.time_s = 1.0;
  trial.table = OneWay(trials.primitive(), AbortWay::kRollOut);
  const AbortOutcome rolled = trials.Play(trial);
  EXPECT_EQ(rolled.reaction, Reaction::kRollOut);
  EXPECT_EQ(rolled.setpoints_outside_limits, 0);
  EXPECT_NE(rolled.rests_as, "") << "it walks to its end";
}

TEST(Solo8Aborts, WithoutDrivesTheProgramSaysWhichThatAreThereDoNotSuit) {
  const testing::Outcome run = testing::RunProgram(
      {"tumbler", "abort", SourcePath("primitives/solo8/walk.toml"), "--robots", "1"});
  EXPECT_EQ(run.exit_code, 2) << run.text;
  EXPECT_THAT(run.text, HasSubstr("rad/s"));
}

}  // namespace
}  // namespace tumbler
