// What a task asks for at given times and of points of links: reading it, judging it, and finding a
// motion that does it.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "tests/support/bad_inputs.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using testing::GoodRobot;
using testing::GoodTask;
using ::testing::HasSubstr;
using testing::Replaced;

/// A task for half a second on both feet, in which the legs move a little.
std::string QuickTask() {
  std::string text = Replaced(GoodTask(), "leg1 = 0.0, leg2 = 0.0", "leg1 = -1.2, leg2 = 1.3");
  text = Replaced(text, "target = 1.5707963267948966", "target = 0.0");
  text = Replaced(text, "duration_s = 1.2", "duration_s = 0.5");
  return Replaced(text, "settle_s = 0.3", "settle_s = 0.1");
}

/// The same with another term.
std::string WithTerm(const std::string& term) {
  return Replaced(QuickTask(), "[contact]", "[[cost]]\n" + term + "\n[contact]");
}
/// A term of the foot's middle of leg 1, which hinges 0.15 m right of the middle and is 0.2 m long.
std::string FootTerm(const std::string& of, const std::string& when, const std::string& target) {
  return "term = \"terminal\"\nof = \"" + of + "\"\nlink = \"leg1_link\"\npoint_m = [0.2, 0.0]\n" +
         when + "\ntarget = " + target + "\nweight = 10.0\n";
}

Problem ProblemOf(const std::string& task) {
  return ParseTask(task, "task.toml", GoodRobot(), "robot.urdf").problem;
}

/// The height of that point by hand.
double FootHeight(const std::vector<double>& q) {
  return q[1] + 0.15 * std::sin(q[2]) + 0.2 * std::sin(q[2] + q[3]);
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

/// A motion at a time, by a rollout with a step that is its own.
std::vector<double> PositionsAt(const Problem& problem, const std::vector<double>& x,
                                double time_s) {
  Problem plain = problem;
  plain.cost = {CostTerm{CostTerm::Kind::kEffort, CostTerm::When::kThroughout, 1}};
  std::vector<double> before, after;
  double before_s = 0, after_s = 0;
  Rollout(plain, problem.solver.step_s / 64).Visit(x, 0, [&](const MotionSample& sample) {
    if (sample.time_s <= time_s) before = sample.q, before_s = sample.time_s;
    if (sample.time_s >= time_s && after.empty()) after = sample.q, after_s = sample.time_s;
  });
  const double part = after_s > before_s ? (time_s - before_s) / (after_s - before_s) : 0;
  for (std::size_t i = 0; i < before.size(); ++i) before[i] += part * (after[i] - before[i]);
  return before;
}

TEST(TimedPurpose, TermsAreReadWithTheirTimesAndPoints) {
  const Problem problem =
      ProblemOf(WithTerm(FootTerm("point_z_rate", "time_s = 0.25", "0.5") + "tolerance = 0.3\n"));
  const CostTerm& term = problem.cost.back();
  EXPECT_EQ(term.when, CostTerm::When::kTime);
  EXPECT_EQ(term.time_s, 0.25);
  EXPECT_EQ(term.of(), PurposeTarget::Of::kPointZRate);
  EXPECT_EQ(term.point.link, "leg1_link");
  EXPECT_EQ(term.tolerance, 0.3);
  const auto tolerance_of = [](const char* of) {
    return ProblemOf(WithTerm(FootTerm(of, "time_s = 0.25", "0"))).cost.back().tolerance;
  };
  EXPECT_EQ(tolerance_of("point_x"), CostTerm::kLengthTolerance_m);
  EXPECT_EQ(tolerance_of("point_x_rate"), CostTerm::kRateTolerance);
}

TEST(TimedPurpose, ATimeAtTheEndIsTheEnd) {
  const auto when = [](const std::string& time) {
    return ProblemOf(WithTerm(FootTerm("point_z", "time_s = " + time, "0"))).cost.back().when;
  };
  EXPECT_EQ(when("0.5"), CostTerm::When::kEnd);
  EXPECT_EQ(when("0.6"), CostTerm::When::kSettled);
  EXPECT_EQ(when("0.4999"), CostTerm::When::kTime);
}

TEST(TimedPurpose, APitchOnTheWayIsNotThePitchThatTheMotionSettlesAt) {
  std::string text = Replaced(QuickTask(), "when = \"settled\"\ntarget = 0.0", "time_s = 0.3");
  EXPECT_FALSE(ProblemOf(text).target_pitch_rad);
  EXPECT_EQ(ProblemOf(QuickTask()).target_pitch_rad, 0.0);
}

TEST(TimedPurpose, IsJudgedByAFinerSimulation) {
  const Problem problem = ProblemOf(
      WithTerm(FootTerm("point_z", "time_s = 0.2375", "0.013") +
               "\n[[cost]]\nterm = \"terminal\"\nof = \"pitch\"\ntime_s = 0.53\nweight = 1.0\n"));
  const std::vector<double> x = Straight(problem);
  const SecondLook look = LookAgain(problem, x);
  std::vector<std::string> names;
  for (const PurposeFigure& figure : look.purpose) names.push_back(figure.name());
  ASSERT_THAT(names, ElementsAre("pitch, settled", "pitch, 2 s later", "pitch_rate, 2 s later",
                                 "point_z of leg1_link at (0.2, 0), at 0.2375 s",
                                 "pitch, at 0.53 s", "speed of the root, 2 s later"));
  EXPECT_NEAR(look.purpose[3].result, FootHeight(PositionsAt(problem, x, 0.2375)), 1e-6);
  EXPECT_NEAR(look.purpose[4].result, PositionsAt(problem, x, 0.53)[2], 1e-6);
  EXPECT_TRUE(look.acceptable()) << look.Objections();
}

TEST(TimedPurpose, OfAPointAtRestHoldsTwoSecondsLater) {
  const Problem problem = ProblemOf(WithTerm(FootTerm("point_x", "when = \"settled\"", "0.2")));
  const SecondLook look = LookAgain(problem, Straight(problem));
  std::vector<std::string> names;
  for (const PurposeFigure& figure : look.purpose) names.push_back(figure.name());
  EXPECT_THAT(names, ElementsAre("pitch, settled", "pitch, 2 s later", "pitch_rate, 2 s later",
                                 "point_x of leg1_link at (0.2, 0), settled",
                                 "point_x of leg1_link at (0.2, 0), 2 s later",
                                 "speed of the root, 2 s later"));
}

TEST(TimedPurpose, AMotionThatMissesItIsNotAcceptable) {
  const Problem problem = ProblemOf(WithTerm(FootTerm("point_z", "time_s = 0.25", "0.1")));
  const SecondLook look = LookAgain(problem, Straight(problem));
  EXPECT_FALSE(look.acceptable());
  EXPECT_THAT(look.Objections(),
              HasSubstr("point_z of leg1_link at (0.2, 0), at 0.25 s: asked 0.1, got 0.02"));
  EXPECT_THAT(look.Objections(), HasSubstr(" m (within 0.02)"));
}

/// The robot stands on both feet before and after.
TEST(TimedPurpose, AFootThatIsToBeHighAtATimeIsLiftedThereAndThen) {
  Problem problem = ProblemOf(WithTerm(FootTerm("point_z", "time_s = 0.25", "0.07")));
  EXPECT_FALSE(LookAgain(problem, Straight(problem)).acceptable()) << "it does so by itself";
  problem.search.batch = problem.search.max_samples = 30;
  problem.search.refine = 2;
  SolveOptions options;
  options.accept = [&problem](const Solution& solution) {
    return LookAgain(problem, solution.x).acceptable();
  };
  const SolveOutcome outcome = Solve(problem, options);
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution& best = outcome.solutions.front();
  const SecondLook look = LookAgain(problem, best.x);
  EXPECT_TRUE(look.acceptable()) << look.Objections();
  EXPECT_GT(FootHeight(PositionsAt(problem, best.x, 0.25)), 0.05);
  EXPECT_NEAR(PositionsAt(problem, best.x, 0.6)[2], 0, 0.05);
}

TEST(TimedPurpose, IsToldByTheProgramsWithItsResultAndJudgedInARun) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "good.urdf", GoodRobot());
  testing::WriteFile(folder / "task.toml",
                     Replaced(WithTerm(FootTerm("point_z", "time_s = 0.25", "0.07")), "seed = 1",
                              "seed = 1\nbatch = 30\nmax_samples = 30\nrefine = 2"));
  const testing::Outcome found = testing::RunProgram(
      {"tumbler optimize", folder / "task.toml", "--out", folder / "motion.toml", "--json",
       folder / "figures.json", "--report", folder / "report"});
  ASSERT_EQ(found.exit_code, 0) << found.text;
  const std::string name = "point_z of leg1_link at (0.2, 0), at 0.25 s";
  EXPECT_THAT(found.text, HasSubstr("    " + name + ": asked 0.07, got 0.0"));
  EXPECT_THAT(testing::ReadFile(folder / "figures.json"), HasSubstr("\"of\": \"" + name + "\""));
  EXPECT_THAT(testing::ReadFile(folder / "report/index.html"), HasSubstr(name));
  const PrimitiveFile file = LoadPrimitive(folder / "motion.toml");
  const auto foot = std::ranges::find(file.purpose, name, &PurposeTarget::name);
  ASSERT_NE(foot, file.purpose.end());
  EXPECT_NEAR(foot->result, 0.07, 0.02);
  const testing::Outcome run = testing::RunProgram({"tumbler run", "sim", folder / "motion.toml"});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("pitch, 2 s later: asked 0, got"));
  EXPECT_THAT(run.text, HasSubstr("    " + name + ": asked 0.07, got 0.0"));
  EXPECT_THAT(run.text, ::testing::Not(HasSubstr("MISSED")));
}

}  // namespace
}  // namespace tumbler
