// The second look at a motion: what a finer simulation makes of it, and whether it does what its
// task asks for.

#include "offline/certificate/second_look.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "offline/problem/task_toml.h"
#include "offline/rollout/rollout.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::QuickTask;
using testing::Replaced;
using testing::ShippedRobot;

Problem ProblemOf(const std::string& task) {
  return ParseTask(task, "task.toml", ShippedRobot(), "robot.urdf").problem;
}

/// The legs go straight from start to end.
std::vector<double> Straight(const Problem& problem) {
  std::vector<double> x;
  for (const ActuatedJoint& joint : problem.joints) {
    const int free = joint.free_points();
    for (int i = 1; i <= free; ++i)
      x.push_back(joint.start_rad + i * (joint.end_rad - joint.start_rad) / (free + 1));
  }
  return x;
}

TEST(SecondLook, HoldsEachTargetBesideItsResultAlsoTwoSecondsLater) {
  const Problem problem = ProblemOf(QuickTask());
  const SecondLook look = LookAgain(problem, Straight(problem));
  std::vector<std::string> names;
  for (const PurposeFigure& figure : look.purpose) names.push_back(figure.name);
  EXPECT_THAT(names, ::testing::ElementsAre("pitch, settled", "pitch, 2 s later",
                                            "pitch_rate, settled", "speed of the root, 2 s later"));
  EXPECT_TRUE(look.purpose_met()) << look.Missed();
  EXPECT_EQ(look.Missed(), "");
}

TEST(SecondLook, AMotionThatHardlyMovesTheRobotMissesATargetFarAway) {
  const Problem problem = ProblemOf(Replaced(QuickTask(), "target = 0.0", "target = 1.5"));
  const SecondLook look = LookAgain(problem, Straight(problem));
  EXPECT_FALSE(look.purpose_met());
  EXPECT_THAT(look.Missed(), HasSubstr("pitch, settled: asked 1.5, got "));
  EXPECT_THAT(look.Missed(), HasSubstr("rad (within 0.05)"));
}

TEST(SecondLook, AToleranceOfTheTaskDecides) {
  const auto met = [](const std::string& tolerance) {
    const Problem problem =
        ProblemOf(Replaced(QuickTask(), "target = 0.0", "target = 1.5\ntolerance = " + tolerance));
    return LookAgain(problem, Straight(problem)).purpose_met();
  };
  EXPECT_FALSE(met("1.3"));
  EXPECT_TRUE(met("1.7"));
}

TEST(SecondLook, TermsWithoutWeightOrTargetAskForNothing) {
  std::string text = Replaced(QuickTask(), "weight = 10.0", "weight = 0.0");
  text = Replaced(text, "target = 0.0", "target = 1.5");
  const Problem problem = ProblemOf(text);
  const SecondLook look = LookAgain(problem, Straight(problem));
  ASSERT_EQ(look.purpose.size(), 2U);
  EXPECT_EQ(look.purpose[0].name, "pitch_rate, settled");
  EXPECT_TRUE(look.purpose_met()) << look.Missed();
}

TEST(SecondLook, AMotionThatIsNotToEndAtRestIsNotAskedToRest) {
  const Problem problem = ProblemOf(
      Replaced(QuickTask(), "when = \"settled\"\nweight = 1.0", "when = \"end\"\nweight = 1.0"));
  EXPECT_FALSE(EndsAtRest(problem));
  for (const PurposeFigure& figure : LookAgain(problem, Straight(problem)).purpose)
    EXPECT_THAT(figure.name, ::testing::Not(HasSubstr("later")));
}

TEST(SecondLook, AResultThatIsNotANumberMisses) {
  PurposeFigure figure{"pitch, settled", "rad", 0, std::numeric_limits<double>::quiet_NaN(), 10};
  EXPECT_FALSE(figure.met());
}

TEST(SecondLook, SeesTheTorqueOfAnImpactAtLeastAsWellAsTheSolversStep) {
  // The finer step has all instants of the solver's among its own, up to its own error.
  const Problem problem = ProblemOf(QuickTask());
  const std::vector<double> x = Straight(problem);
  double coarse = 0;
  Rollout(problem, problem.solver.step_s).Visit(x, 0, [&](const MotionSample& sample) {
    for (const double torque : sample.torque) coarse = std::max(coarse, std::abs(torque));
  });
  EXPECT_GT(LookAgain(problem, x).peak_torque_nm, 0.99 * coarse);
}

}  // namespace
}  // namespace tumbler
