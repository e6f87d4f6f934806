// Motions that robots survive which are not the model: the strategy that finds them, what it hands
// over, and the task's table.

#include "offline/solve/robust_search.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/robot_posterior.h"
#include "offline/scene/self_clearance.h"
#include "offline/solve/cma_es.h"
#include "offline/solve/guess.h"
#include "offline/solve/lane_feedback.h"
#include "offline/solve/motion_plan.h"
#include "offline/solve/robot_loss.h"
#include "tests/support/files.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

/// On both feet, the legs move a little, and robots are to stay on them.
std::string QuickRobustTask(const std::string& robust = "") {
  return testing::QuickTask() + "\n[robust]\nsamples = 16\nstarts = 1\nimproved = 1\n" +
         "polish_robots = 8\ngenerations = 3\n" + robust;
}

Problem ProblemOf(const std::string& text) {
  return ParseTask(text, "task.toml", testing::ShippedRobot(), "robot.urdf").problem;
}

std::string RefusalOf(const std::string& text) {
  try {
    ProblemOf(text);
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

/// Of the joints, from their starts to their ends.
std::vector<double> StraightPaths(const Problem& problem) {
  std::vector<double> paths;
  for (const ActuatedJoint& joint : problem.joints) {
    for (int i = 1; i <= joint.free_points(); ++i) {
      paths.push_back(joint.start_rad +
                      (joint.end_rad - joint.start_rad) * i / (joint.free_points() + 1));
    }
  }
  return paths;
}

TEST(CmaEs, FindsTheMinimumOfACrookedValley) {
  // Rosenbrock's function in 6 variables, whose minimum is 0 at (1, ..., 1).
  CmaEs search(std::vector<double>(6, -0.5), 0.3, 12, 7);
  double best = 1e9;
  for (int generation = 0; generation < 900; ++generation) {
    std::vector<double> values;
    for (const std::vector<double>& x : search.Ask()) {
      double sum = 0;
      for (std::size_t i = 0; i + 1 < x.size(); ++i)
        sum += 100 * std::pow(x[i + 1] - x[i] * x[i], 2) + std::pow(1 - x[i], 2);
      values.push_back(sum);
      best = std::min(best, sum);
    }
    search.Tell(values);
  }
  EXPECT_LT(best, 1e-9);
  EXPECT_LT(search.sigma(), 1e-3);
}

TEST(CmaEs, TheSeedDeterminesTheCandidates) {
  CmaEs a({0, 0}, 1, 6, 5), b({0, 0}, 1, 6, 5), c({0, 0}, 1, 6, 6);
  EXPECT_EQ(a.Ask(), b.Ask());
  EXPECT_NE(b.Ask(), c.Ask());
}

TEST(CmaEs, ACovarianceShapesWhatIsDrawnFirst) {
  // Of a large generation: stiff along (1, -1), soft along (1, 1).
  Eigen::MatrixXd covariance(2, 2);
  covariance << 4.01, 3.99, 3.99, 4.01;
  CmaEs search({1, 2}, covariance, 4000, 3);
  double along = 0, across = 0;
  for (const std::vector<double>& x : search.Ask()) {
    along += std::pow(x[0] - 1 + x[1] - 2, 2) / 2 / 4000;
    across += std::pow(x[0] - 1 - x[1] + 2, 2) / 2 / 4000;
  }
  EXPECT_NEAR(along, 8, 0.6);
  EXPECT_NEAR(across, 0.02, 0.0015);
}

TEST(RobustSearch, TheResultDoesNotDependOnTheThreads) {
  const Problem problem = ProblemOf(QuickRobustTask());
  SolveOptions options;
  const SolveOutcome one = SolveRobust(problem, options);
  options.threads = 3;
  const SolveOutcome three = SolveRobust(problem, options);
  ASSERT_EQ(one.solutions.size(), three.solutions.size());
  ASSERT_FALSE(one.solutions.empty());
  for (std::size_t i = 0; i < one.solutions.size(); ++i)
    EXPECT_EQ(one.solutions[i].x, three.solutions[i].x);
  ASSERT_EQ(one.history.size(), three.history.size());
  EXPECT_EQ(one.history.back().cost, three.history.back().cost);
}

TEST(RobustSearch, WhatItHandsOverKeepsTheLimitsOfThePlan) {
  const Problem problem = ProblemOf(QuickRobustTask());
  const SolveOutcome outcome = SolveRobust(problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution& best = outcome.solutions.front();
  EXPECT_TRUE(best.feasible()) << best.worst_constraint << " " << best.constraint_violation;
  EXPECT_TRUE(best.rollout.any_contact);
  EXPECT_LT(outcome.history.back().cost, 0.2) << "all robots ought to stay on their feet";
}

TEST(RobustSearch, AnInterruptEndsItWithWhatItHas) {
  const Problem problem = ProblemOf(QuickRobustTask("mass = 0.1\n"));
  std::atomic<bool> interrupt{true};
  SolveOptions options;
  options.interrupt = &interrupt;
  const SolveOutcome outcome = SolveRobust(problem, options);
  EXPECT_TRUE(outcome.interrupted);
}

TEST(RobustSearch, WhatAnInterruptLeavesSaysSoInWhateverStageItCame) {
  const Problem problem = ProblemOf(QuickRobustTask("mass = 0.1\n"));
  for (const SearchStage stage :
       {SearchStage::kModel, SearchStage::kArrivals, SearchStage::kUsual}) {
    std::atomic<bool> interrupt{false};
    SolveOptions options;
    options.interrupt = &interrupt;
    options.progress = [&](const Evaluation& evaluation) {
      if (evaluation.stage == stage) interrupt = true;
    };
    const SolveOutcome outcome = SolveRobust(problem, options);
    EXPECT_TRUE(outcome.interrupted);
    ASSERT_FALSE(outcome.solutions.empty()) << "it has a motion by then";
    for (const Solution& solution : outcome.solutions) {
      EXPECT_EQ(solution.end, SolveEnd::kInterrupted);
    }
  }
}

TEST(RobustSearch, ADurationThatIsFreeIsFoundWithinItsBoundsWithLimitsKept) {
  const Problem fixed = ProblemOf(QuickRobustTask());
  const Problem problem =
      ProblemOf(QuickRobustTask(fmt::format("duration_min_s = {}\nduration_max_s = {}\n",
                                            0.8 * fixed.duration_s, 1.2 * fixed.duration_s)));
  const SolveOutcome outcome = SolveRobust(problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  for (const Solution& solution : outcome.solutions) {
    ASSERT_TRUE(solution.duration_s);
    EXPECT_GE(*solution.duration_s, 0.8 * fixed.duration_s - 5e-4);
    EXPECT_LE(*solution.duration_s, 1.2 * fixed.duration_s + 5e-4);
    EXPECT_NE(*solution.duration_s, fixed.duration_s) << "it was not searched for";
    EXPECT_EQ(solution.x.size(), static_cast<std::size_t>(problem.parameter_count()));
  }
  EXPECT_TRUE(outcome.solutions.front().feasible());
  EXPECT_EQ(*SolveRobust(fixed, {}).solutions.front().duration_s, fixed.duration_s);
}

TEST(RobustSearch, AGuessIsPolishedWithoutASearch) {
  const Problem problem = ProblemOf(QuickRobustTask());
  const std::vector<double> guess = SolveRobust(problem, {}).solutions.front().x;
  const SolveOutcome polished = SolveRobust(problem, {}, guess);
  EXPECT_EQ(polished.evaluations, 1 + 3 * 16 + 1)
      << "the guess, three generations of 16, and the best in double precision";
  ASSERT_EQ(polished.solutions.size(), 1U);
  EXPECT_LE(polished.history.back().cost, 0.2);
}

TEST(RobustSearch, SaysHowManyRobotsItsMotionCarriesThatItHasNotMet) {
  Problem problem = ProblemOf(QuickRobustTask("zero_rad = 0.02\n"));
  problem.robust->polish_robots = 64;
  const SolveOutcome found = SolveRobust(problem, {});
  ASSERT_TRUE(found.solutions.front().robots);
  EXPECT_EQ(found.solutions.front().robots->of, 64);
  EXPECT_EQ(found.solutions.front().robots->scale, problem.robust->polish_scale);
  EXPECT_GT(found.solutions.front().robots->carried, 32);
  EXPECT_EQ(found.solutions.front().end, SolveEnd::kGenerations);
  for (std::size_t i = 1; i < found.solutions.size(); ++i)
    EXPECT_TRUE(found.solutions[i].robots) << "another is kept where this one is refused: " << i;
  const std::vector<double> guess = found.solutions.front().x;
  problem.robust->generations = 0;
  Problem other = problem;
  other.following_tolerance_rad = 1e-4;  // No joint follows so well: the runtime stops.
  EXPECT_EQ(SolveRobust(other, {}, guess).solutions.front().robots->carried, 0);
  other.robust->polish_scale = 0;
  EXPECT_FALSE(SolveRobust(other, {}, guess).solutions.front().robots) << "they are one robot";
  // Of robots whose joints are elsewhere the same motion carries few.
  problem = ProblemOf(QuickRobustTask("zero_rad = 1\n"));
  problem.robust->polish_robots = 64;
  problem.robust->generations = 0;
  const SolveOutcome elsewhere = SolveRobust(problem, {}, guess);
  ASSERT_TRUE(elsewhere.solutions.front().robots);
  EXPECT_LT(elsewhere.solutions.front().robots->carried, 16);
}

TEST(RobustSearch, SaysThatNothingIsLeftToGainHoweverManyRobotsThereAre) {
  Task task = LoadTask(testing::SourcePath("primitives/tasks/rise.toml"));
  for (const int robots : {64, 128}) {
    task.problem.robust->polish_robots = robots;
    const Solution best = SolveRobust(task.problem, {}).solutions.front();
    EXPECT_EQ(best.end, SolveEnd::kAllRest) << robots;
    ASSERT_TRUE(best.robots);
    EXPECT_EQ(best.robots->carried, robots);
  }
}

TEST(RobustSearch, EachRoundOfPolishingGoesOnFromTheOneBeforeWithTwiceTheRobots) {
  Problem problem = ProblemOf(QuickRobustTask("zero_rad = 0.05\n"));
  std::vector<double> guess = StraightPaths(problem);
  for (double& x : guess) x -= 0.1;  // Worse than what a round makes of it.
  const SolveOutcome eight = SolveRobust(problem, {}, guess);
  problem.robust->polish_robots = 16;
  problem.robust->polish_rounds = 2;
  const SolveOutcome both = SolveRobust(problem, {}, guess);
  EXPECT_EQ(both.evaluations, 2 * (1 + 3 * 16 + 1));
  ASSERT_EQ(both.history.size(), 6U);
  for (std::size_t g = 0; g < 3; ++g) EXPECT_EQ(both.history[g].cost, eight.history[g].cost);
  problem.robust->polish_rounds = 1;
  // By the same sixteen robots, from what the first round found, and from what it began with. Each
  // search has random numbers of its own, so that one generation differs a little from another.
  const double then = SolveRobust(problem, {}, eight.solutions.front().x).history[0].cost;
  const double anew = SolveRobust(problem, {}, guess).history[0].cost;
  EXPECT_LT(std::abs(both.history[3].cost - then), 0.25 * (anew - then));
  ASSERT_EQ(both.solutions.size(), 1U);
}

TEST(RobustSearch, ManyRobotsAreRacedOnWhateverThreadsAndTheBestMotionIsThatOfOtherRobots) {
  Problem problem = ProblemOf(QuickRobustTask());
  const std::vector<double> guess = SolveRobust(problem, {}).solutions.front().x;
  problem.robust->polish_robots = 128;
  const SolveOutcome one = SolveRobust(problem, {}, guess);
  SolveOptions options;
  options.threads = 3;
  const SolveOutcome three = SolveRobust(problem, options, guess);
  ASSERT_EQ(one.solutions.size(), 1U);
  EXPECT_EQ(one.solutions.front().x, three.solutions.front().x);
  ASSERT_EQ(one.history.size(), 4U) << "three generations, and what other robots say";
  for (std::size_t g = 0; g < 4; ++g) EXPECT_EQ(one.history[g].cost, three.history[g].cost);
  EXPECT_LE(one.history[2].cost, one.history[0].cost);
  EXPECT_NE(one.history[3].cost, one.history[2].cost);
  // The guess, the mean and whatever was the best are asked again.
  EXPECT_GE(one.evaluations, 1 + 3 * 16 + 2);
  EXPECT_LE(one.evaluations, 1 + 3 * 16 + 2 + 3);
}

TEST(RobustSearch, AFeedbackIsFoundWithThePath) {
  const Problem problem =
      ProblemOf(QuickRobustTask("[robust.feedback]\nlink = \"leg2_link\"\nknots = 3\n"
                                "correction_max_rad = 0.25\n"));
  const SolveOutcome outcome = SolveRobust(problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  const Feedback<double>& feedback = outcome.solutions.front().feedback;
  ASSERT_TRUE(feedback.present());
  EXPECT_FALSE(outcome.solutions.front().robots) << "it has a say in what robots do";
  EXPECT_EQ(feedback.link.view(), "leg2_link");
  ASSERT_EQ(feedback.knot_count, 5) << "those of the motion, and two of the hold";
  EXPECT_EQ(feedback.knots_s[2], problem.duration_s);
  EXPECT_NEAR(feedback.knots_s[3], problem.duration_s + 0.2, 1e-9);
  EXPECT_NEAR(feedback.knots_s[4], problem.duration_s + 0.3, 1e-9);
  EXPECT_EQ(feedback.joints[0].chain, 0);
  EXPECT_EQ(std::abs(feedback.joints[1].chain), 1);
  EXPECT_EQ(feedback.joints[1].correction_max_rad, 0.25);
  EXPECT_NE(feedback.joints[0].angle_gain[0], 0);
  EXPECT_NE(feedback.joints[1].rate_gain[2], 0);
  EXPECT_EQ(feedback.joints[1].angle_gain[3], 0) << "while the robot lands";
  const double begins = problem.start_q[2] + feedback.joints[1].chain * problem.joints[1].start_rad;
  EXPECT_NEAR(feedback.angle.Evaluate(0).value, begins, 0.02) << "the model rests where it starts";
  const SolveOutcome without = SolveRobust(ProblemOf(QuickRobustTask()), {});
  EXPECT_FALSE(without.solutions.front().feedback.present());
}

TEST(RobustSearch, GainsInTheMotionAreFoundForTheGuessAsItIsAndFollowedByThoseOfTheHold) {
  const std::vector<double> guess =
      SolveRobust(ProblemOf(QuickRobustTask()), {}).solutions.front().x;
  const std::string table = "[robust.feedback]\nlink = \"leg2_link\"\n";
  const Problem problem = ProblemOf(QuickRobustTask(table));
  const SolveOutcome polished = SolveRobust(problem, {}, guess);
  ASSERT_EQ(polished.solutions.size(), 1U);
  EXPECT_EQ(polished.solutions.front().x.size(), guess.size());
  EXPECT_EQ(polished.solutions.front().x, guess);
  // The law of the hold is that of the guess.
  const Feedback<double> hold =
      SolveRobust(ProblemOf(QuickRobustTask(table + "acts = \"hold\"\n")), {}, guess)
          .solutions.front()
          .feedback;
  const Feedback<double>& law = polished.solutions.front().feedback;
  ASSERT_EQ(law.knot_count, 7);
  EXPECT_EQ(law.error_min_rad, hold.error_min_rad);
  EXPECT_EQ(law.error_full_rad, hold.error_full_rad);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_EQ(law.joints[j].angle_gain[6], hold.joints[j].angle_gain[2]);
    EXPECT_EQ(law.joints[j].rate_gain[6], hold.joints[j].rate_gain[2]);
  }
}

TEST(RobustSearch, GainsAreFoundForAGuessThatIsAtALimitAndThatItsFileHasRounded) {
  const std::vector<double> guess =
      SolveRobust(ProblemOf(QuickRobustTask()), {}).solutions.front().x;
  Problem problem =
      ProblemOf(QuickRobustTask("[robust.feedback]\nlink = \"leg2_link\"\nacts = \"motion\"\n"));
  const auto leg1 = guess.begin() + problem.first_parameter(0);
  const double most_rad = *std::max_element(leg1, leg1 + problem.joints[0].free_points());
  problem.joints[0].limits.position_max_rad = most_rad - 1e-13;
  const SolveOutcome outcome = SolveRobust(problem, {}, guess);
  EXPECT_LT(outcome.history.back().cost, 1) << "robots stand";
  problem.joints[0].limits.position_max_rad = most_rad - 1e-3;
  const SolveOutcome without = SolveRobust(problem, {}, guess);
  EXPECT_EQ(without.solutions.front().end, SolveEnd::kTaken) << "no rounding";
}

TEST(RobustSearch, NoGainsAreSearchedForAGuessThatTheModelCannotPlay) {
  const std::vector<double> guess =
      SolveRobust(ProblemOf(QuickRobustTask()), {}).solutions.front().x;
  for (const std::string acts : {"always", "hold", "motion"}) {
    Problem problem = ProblemOf(
        QuickRobustTask("[robust.feedback]\nlink = \"leg2_link\"\nacts = \"" + acts + "\"\n"));
    // Its legs weigh more than a tenth of a newton metre.
    for (ActuatedJoint& joint : problem.joints) joint.limits.torque_max_nm = 0.1;
    const SolveOutcome outcome = SolveRobust(problem, {}, guess);
    EXPECT_EQ(outcome.evaluations, 0) << acts;
    EXPECT_EQ(outcome.solutions.front().end, SolveEnd::kTaken);
    EXPECT_FALSE(outcome.solutions.front().feasible());
    EXPECT_FALSE(outcome.solutions.front().feedback.present());
  }
}

TEST(RobustSearch, GainsInTheMotionAreFoundInOneRoundMoreThanTheTaskSaysEachWithTwiceTheRobots) {
  const std::vector<double> guess =
      SolveRobust(ProblemOf(QuickRobustTask()), {}).solutions.front().x;
  const std::string table = "[robust.feedback]\nlink = \"leg2_link\"\nacts = \"motion\"\n";
  Problem problem = ProblemOf(QuickRobustTask(table));
  problem.robust->polish_robots = 16;
  const SolveOutcome two = SolveRobust(problem, {}, guess);
  problem.robust->polish_robots = 32;
  problem.robust->polish_rounds = 2;
  const SolveOutcome three = SolveRobust(problem, {}, guess);
  ASSERT_EQ(two.history.size(), 6U);
  ASSERT_EQ(three.history.size(), 9U);
  for (std::size_t g = 0; g < two.history.size(); ++g)
    EXPECT_EQ(three.history[g].cost, two.history[g].cost) << "of 8 robots, and of 16";
}

/// How near the robot's own shapes come along a motion of the joints, exactly followed.
double NearestAlong(const Problem& problem, const std::vector<double>& x) {
  SelfDistances distances(problem.scene.robot, problem.scene.self_contact.pairs);
  double nearest_m = 1;
  std::vector<double> q = problem.start_q;
  for (int k = 0; 1e-3 * k < problem.duration_s; ++k) {
    const double t = 1e-3 * k;
    for (std::size_t j = 0; j < problem.joints.size(); ++j)
      q[3 + j] = PositionSpline(problem, x, j).Evaluate(t).value;
    nearest_m = std::min(nearest_m, distances.Nearest(q).distance_m);
  }
  return nearest_m;
}

TEST(RobustSearch, RobotsWhoseOwnShapesOverlapThoughThePlansDoNotAreLostToGainsInTheMotion) {
  // Encoders are off, so that some robots hold their legs nearer than the plan does.
  Problem problem =
      ProblemOf(QuickRobustTask("zero_rad = 0.03\n[robust.feedback]\nlink = \"leg2_link\"\n"));
  const std::vector<double> guess = StraightPaths(problem);
  EXPECT_LE(SolveRobust(problem, {}, guess).history.back().cost, 0.05);
  // Legs so thick that little remains between them. Of eight robots that follow this plan one comes
  // nearer by 0.4 mm, and where encoders are off two do.
  problem.scene.self_contact.clearance_m = 0;
  const std::vector<OwnShape> thin = problem.scene.robot.own_shapes;
  Problem exact = ProblemOf(QuickRobustTask("[robust.feedback]\nlink = \"leg2_link\"\n"));
  const auto costs = [&](double left_m) {
    problem.scene.robot.own_shapes = thin;
    const double thicker_m = NearestAlong(problem, guess) - left_m;
    EXPECT_GT(thicker_m, 0);
    for (OwnShape& shape : problem.scene.robot.own_shapes)
      if (shape.link == "leg1_link") shape.shape.radius_m += thicker_m;
    EXPECT_NEAR(NearestAlong(problem, guess), left_m, 1e-9);
    exact.scene = problem.scene;
    return std::pair(SolveRobust(exact, {}, guess).history.back().cost,
                     SolveRobust(problem, {}, guess).history.back().cost);
  };
  const auto [exact_far, off_far] = costs(0.6e-3);
  EXPECT_LE(exact_far, 0.05);
  EXPECT_LE(off_far, 0.05);
  const auto [exact_near, off_near] = costs(0.3e-3);
  EXPECT_GE(exact_near, 0.15) << "one of eight is lost";
  EXPECT_GE(off_near, exact_near + 0.1) << "and another one";
}

TEST(RobustSearch, AFeedbackOfTheHoldLeavesTheMotionAsItIsAndActsAtItsEnd) {
  const std::vector<double> guess =
      SolveRobust(ProblemOf(QuickRobustTask()), {}).solutions.front().x;
  const Problem problem =
      ProblemOf(QuickRobustTask("[robust.feedback]\nlink = \"leg2_link\"\nacts = \"hold\"\n"));
  SolveOptions options;
  const SolveOutcome one = SolveRobust(problem, options, guess);
  ASSERT_EQ(one.solutions.size(), 1U);
  EXPECT_EQ(one.solutions.front().x, guess);
  const Feedback<double>& law = one.solutions.front().feedback;
  ASSERT_EQ(law.knot_count, 3);
  EXPECT_NEAR(law.knots_s[1], problem.duration_s + 0.2, 1e-9);
  EXPECT_NEAR(law.knots_s[2], problem.duration_s + 0.3, 1e-9);
  for (const JointFeedback<double>& joint : {law.joints[0], law.joints[1]}) {
    EXPECT_EQ(joint.angle_gain[0], 0);
    EXPECT_EQ(joint.angle_gain[1], 0);
    EXPECT_EQ(joint.rate_gain[1], 0);
  }
  EXPECT_LE(law.error_min_rad, law.error_full_rad);
  EXPECT_LE(law.error_full_rad, law.error_max_rad);
  options.threads = 3;
  const SolveOutcome three = SolveRobust(problem, options, guess);
  const Feedback<double>& same = three.solutions.front().feedback;
  EXPECT_EQ(same.joints[0].angle_gain, law.joints[0].angle_gain);
  EXPECT_EQ(same.joints[1].rate_gain, law.joints[1].rate_gain);
  EXPECT_EQ(same.error_min_rad, law.error_min_rad);
}

TEST(RobustSearch, AFeedbackOfTheMotionAloneLeavesTheHoldAlone) {
  const std::vector<double> guess =
      SolveRobust(ProblemOf(QuickRobustTask()), {}).solutions.front().x;
  const Problem problem = ProblemOf(
      QuickRobustTask("[robust.feedback]\nlink = \"leg2_link\"\nacts = \"motion\"\nknots = 3\n"));
  const SolveOutcome outcome = SolveRobust(problem, {}, guess);
  ASSERT_EQ(outcome.solutions.size(), 1U);
  EXPECT_EQ(outcome.solutions.front().x, guess);
  const Feedback<double>& law = outcome.solutions.front().feedback;
  ASSERT_EQ(law.knot_count, 5);
  EXPECT_EQ(law.knots_s[2], problem.duration_s);
  EXPECT_GT(law.error_min_rad, 3 * problem.robust->feedback->noise_rad);
  EXPECT_GT(law.error_full_rad, law.error_min_rad);
  for (const JointFeedback<double>& joint : {law.joints[0], law.joints[1]}) {
    EXPECT_NE(joint.angle_gain[1], 0);
    for (const std::size_t held : {3U, 4U}) {
      EXPECT_EQ(joint.angle_gain[held], 0);
      EXPECT_EQ(joint.rate_gain[held], 0);
    }
  }
}

TEST(RobustSearch, GainsAreFoundForARobotThatWasIdentified) {
  Problem problem = ProblemOf(
      QuickRobustTask("[robust.feedback]\nlink = \"leg2_link\"\nacts = \"motion\"\nknots = 3\n"));
  RobotPosterior known;
  known.quantities = {{RobotQuantity::Kind::kZero, "leg1"}};
  const auto robots = [&known](double zero_rad) {
    known.mean = {zero_rad};
    known.covariance = {zero_rad * zero_rad};
    return std::make_shared<const RobotPosterior>(known);
  };
  problem.robust->spreads.posterior = robots(0.15);
  // A motion in which the model rests, so that there is one to find gains for.
  Problem tuned = problem;
  tuned.robust->feedback.reset();
  tuned.robust->spreads.posterior = robots(0.01);
  tuned.robust->generations = 40;
  const std::vector<double> guess =
      SolveRobust(tuned, {}, SolveRobust(ProblemOf(QuickRobustTask()), {}).solutions.front().x)
          .solutions.front()
          .x;
  const SolveOutcome outcome = SolveRobust(problem, {}, guess);
  ASSERT_EQ(outcome.solutions.size(), 1U);
  EXPECT_EQ(outcome.solutions.front().x, guess);
  EXPECT_NE(outcome.solutions.front().feedback.joints[1].angle_gain[1], 0);
}

/// A law for one joint of two, whose gains do not change.
Feedback<double> LawOf(double angle_gain, double rate_gain) {
  Feedback<double> law;
  law.knot_count = 2;
  law.knots_s = {0, 0.1};
  const std::vector<double> knots = {0, 0, 0, 0.1, 0.1, 0.1}, points = {1, 1, 1};
  EXPECT_EQ(law.angle.Assign(2, knots, points), Status::kOk);
  law.error_max_rad = law.start_error_max_rad = 0.5;
  law.fade_in_s = law.fade_out_s = 0.01;
  law.joints[0].chain = 1;
  law.joints[1].angle_gain = {angle_gain, angle_gain};
  law.joints[1].rate_gain = {rate_gain, rate_gain};
  law.joints[1].correction_max_rad = 0.4;
  law.joints[1].correction_rate_max_rad_s = 1000;
  return law;
}

/// The correction of the second joint after a number of ticks, while the plan's angle is 1 and the
/// measured one is 1 more than the first joint's.
double CorrectionAfter(int ticks, const Feedback<double>& law, double joint_rad,
                       double joint_rad_s) {
  FeedbackSettings settings;
  settings.noise_rad = settings.rate_noise_rad_s = settings.bias_rad = 0;
  const LaneNoise noise(settings, 200, 1, 1);
  LaneFeedback feedback(law, noise, 0.001, 0.001, 2);
  LaneState<Packet> state{};
  state.q[2] = Packet::Of(1);
  state.q[3] = Packet::Of(joint_rad);
  state.v[3] = Packet::Of(joint_rad_s);
  double correction = 0;
  for (int k = 0; k < ticks; ++k) {
    std::array<LaneSetpoint<Packet>, 2> setpoints{};
    feedback.Correct(state, setpoints);
    EXPECT_EQ(setpoints[0].position.lane(3), 0) << "it has no gains";
    correction = setpoints[1].position.lane(3);
    EXPECT_EQ(correction, setpoints[1].position.lane(7));
  }
  return correction;
}

TEST(LaneFeedback, CorrectsByGainsWithinLimitsAndFadesInAsTheExecutorDoes) {
  EXPECT_NEAR(CorrectionAfter(100, LawOf(2, 0), 0.1, 0), 0.2, 1e-12);
  EXPECT_NEAR(CorrectionAfter(5, LawOf(2, 0), 0.1, 0), 0.1, 1e-12) << "half of the fade";
  EXPECT_NEAR(CorrectionAfter(150, LawOf(0, -0.05), 0, 2), -0.1, 1e-12);
  EXPECT_NEAR(CorrectionAfter(100, LawOf(-10, 0), 0.1, 0), -0.4, 1e-12) << "the most";
  EXPECT_EQ(CorrectionAfter(100, LawOf(2, 0), 0.6, 0), 0) << "too far off";
  Feedback<double> patient = LawOf(2, 0.1);
  patient.error_min_rad = 0.1;
  patient.error_full_rad = 0.2;
  EXPECT_EQ(CorrectionAfter(100, patient, 0.09, 1), 0) << "within the dead zone";
  EXPECT_NEAR(CorrectionAfter(100, patient, 0.15, 0), 0.15, 1e-12) << "half of the way out";
  EXPECT_NEAR(CorrectionAfter(100, patient, 0.2, -1), 0.3, 1e-12);
}

TEST(MotionPlanner, TellsRobotsTheFeedForwardThatThePrimitiveWillHave) {
  for (const std::string name : {"handstand", "downstand", "roll"}) {
    const PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/" + name + ".toml"));
    Task task = LoadTask(testing::SourcePath("primitives/tasks/" + name + ".toml"));
    TakeGuess(task, file, name);
    const SolveOptions options;
    const RobustTask robust(task.problem, options, {});
    const RobustMotion motion(robust);
    const std::vector<double> x = motion.Reduce(task.guess);
    const MotionPlan plan = MotionPlanner(robust, motion).Plans({x}).front();
    for (std::size_t j = 0; j < robust.joints; ++j) {
      const auto& told = file.primitive.motions()[j].torque;
      // Steps of lanes are coarser than those of a primitive, and impacts are shorter than either.
      constexpr double kImpact_nm = 0.5, kSteps_nm = 0.05;
      double sum = 0;
      for (int k = 0; k <= motion.Ticks(x); ++k) {
        const double off_nm = plan.FeedForward(Index(k) * robust.joints + j, robust.joints) -
                              told.Evaluate(k * RobustTask::kTick_s).value;
        EXPECT_NEAR(off_nm, 0, kImpact_nm) << name << ", joint " << j << ", tick " << k;
        sum += std::abs(off_nm);
      }
      EXPECT_LT(sum / motion.Ticks(x), kSteps_nm) << name << ", joint " << j;
    }
  }
}

TEST(RobotLoss, OfRobotsThatFallTheOneIsBetterThatStaysNearForLonger) {
  const Problem problem = ProblemOf(QuickRobustTask());
  const RobotLoss loss(problem);
  constexpr double kLies = 1.5, kStill = 0;
  double least = loss.Of(kLies, kLies, kStill, 1);
  for (const double astray : {0.9, 0.6, 0.2, 0.05}) {
    const double now = loss.Of(kLies, kLies, kStill, astray);
    EXPECT_LT(now, least);
    EXPECT_GT(now, 1);
    least = now;
  }
}

TEST(RobustSearch, ATargetOfTheRootsPlaceIsLookedAt) {
  const Problem near = ProblemOf(QuickRobustTask());
  Problem far = near;
  far.cost.push_back({CostTerm::Kind::kSquare, CostTerm::When::kSettled, 1.0, 0, false, 5.0});
  far.cost.back().tolerance = CostTerm::kLengthTolerance_m;
  const SolveOptions options;
  const double here = SolveRobust(near, options).history.back().cost;
  const double there = SolveRobust(far, options).history.back().cost;
  EXPECT_LT(here, 0.5);
  EXPECT_GT(there, 1) << "robots that stay where they are count as being 5 m away";
}

TEST(RobustTask, TheKeysOfAFeedbackAreReadAndItsLinkHasToBeOne) {
  const Problem problem = ProblemOf(
      QuickRobustTask("[robust.feedback]\nlink = \"middle\"\npush_n = 2.0\ndelay_s = 0.002\n"));
  ASSERT_TRUE(problem.robust->feedback);
  EXPECT_EQ(problem.robust->feedback->push_n, 2);
  EXPECT_EQ(problem.robust->feedback->delay_s, 0.002);
  EXPECT_EQ(problem.robust->feedback->knots, 5);
  EXPECT_NE(RefusalOf(QuickRobustTask("[robust.feedback]\nlink = \"tail\"\n"))
                .find("link: is 'tail'; allowed: a link of the robot"),
            std::string::npos);
  EXPECT_NE(RefusalOf(QuickRobustTask("[robust.feedback]\npush_n = 2.0\n")).find("link"),
            std::string::npos);
  EXPECT_NE(RefusalOf(QuickRobustTask("[robust.feedback]\nlink = \"middle\"\npush_n = 2.0\n"
                                      "acts = \"motion\"\n"))
                .find("push_n: is for robots that have a feedback in the hold"),
            std::string::npos);
  const std::string sloping =
      testing::Replaced(QuickRobustTask("[robust.feedback]\nlink = \"middle\"\n"),
                        "root = ", "slope_rad = 0.05\nroot = ");
  EXPECT_NE(RefusalOf(sloping).find("a sensor measures it against gravity"), std::string::npos)
      << RefusalOf(sloping);
}

TEST(RobustTask, BoundsOfTheDurationComeInPairsAroundTheTasksOwn) {
  const auto refusal = [](const std::string& keys) { return RefusalOf(QuickRobustTask(keys)); };
  EXPECT_NE(refusal("duration_min_s = 0.1\n").find("duration_max_s: is missing"),
            std::string::npos);
  EXPECT_NE(refusal("duration_min_s = 15.0\nduration_max_s = 20.0\n")
                .find("duration_min_s: is 15 s, but the task's duration_s is"),
            std::string::npos);
  EXPECT_NE(refusal("duration_min_s = 0.05\nduration_max_s = 0.06\n")
                .find("duration_max_s: is 0.06 s, but the task's duration_s is"),
            std::string::npos);
}

TEST(RobustTask, ADurationIsFreeInItsOwnTableOnly) {
  const std::string task = "duration_min_s = 0.1\nduration_max_s = 20.0\n" + QuickRobustTask();
  EXPECT_NE(RefusalOf(task).find("duration_min_s: does not go with [robust]"), std::string::npos)
      << RefusalOf(task);
}

TEST(RobustTask, TheKeysAreRead) {
  const Problem problem = ProblemOf(
      QuickRobustTask("mass = 0.07\nslope_rad = 0.02\nkp_nm_per_rad = 150\npolish_scale = 2\n"
                      "polish_rounds = 3\n"));
  ASSERT_TRUE(problem.robust);
  EXPECT_EQ(problem.robust->spreads.mass, 0.07);
  EXPECT_EQ(problem.robust->spreads.slope_rad, 0.02);
  EXPECT_EQ(problem.robust->spreads.friction, Spreads{}.friction);
  EXPECT_EQ(problem.robust->drive.kp, 150);
  EXPECT_EQ(problem.robust->drive.kd, 5);
  EXPECT_EQ(problem.robust->polish_scale, 2);
  EXPECT_EQ(problem.robust->polish_rounds, 3);
  EXPECT_EQ(problem.robust->polish_robots, 8);
  EXPECT_FALSE(ProblemOf(testing::QuickTask()).robust);
}

TEST(RobustTask, AGroundMayHaveRangesOfItsPropertiesOrFactorsEitherWay) {
  const Problem problem = ProblemOf(
      QuickRobustTask("friction = { from = 0.15, to = 1.0 }\nstiffness = { factor = 10 }\n"
                      "damping = 0.3\n"));
  const Spreads& spreads = problem.robust->spreads;
  EXPECT_EQ(spreads.friction, (GroundSpread::Between{0.15, 1.0}));
  EXPECT_EQ(spreads.stiffness, GroundSpread::EitherWay{10});
  EXPECT_EQ(spreads.damping, 0.3);
}

TEST(RobustTask, ARangeThatIsNoneIsRefusedWithWhatIsAllowed) {
  const auto refusal = [](const std::string& keys) { return RefusalOf(QuickRobustTask(keys)); };
  EXPECT_NE(refusal("friction = { from = 1.0, to = 0.15 }\n")
                .find("friction.to: is 1..0.15; allowed: a number from 0 to 1, a range of values "
                      "with 0 < from < to <= 10, or a factor above 1, to 100"),
            std::string::npos)
      << refusal("friction = { from = 1.0, to = 0.15 }\n");
  EXPECT_NE(refusal("friction = { from = 0.1 }\n").find("friction.to: is missing"),
            std::string::npos);
  EXPECT_NE(refusal("friction = { from = 0.0, to = 1.0 }\n").find("friction.from"),
            std::string::npos);
  EXPECT_NE(refusal("stiffness = { factor = 0.5 }\n").find("stiffness.factor"), std::string::npos);
  EXPECT_NE(refusal("stiffness = { factor = 2, from = 1e4, to = 1e5 }\n")
                .find("has a factor beside from and to"),
            std::string::npos);
  EXPECT_NE(refusal("damping = {}\n").find("is a table without from, to and factor"),
            std::string::npos);
  EXPECT_NE(refusal("damping = { factor = 2, factr = 3 }\n").find("factr"), std::string::npos);
  EXPECT_NE(refusal("damping = 2\n").find("robust.damping"), std::string::npos);
  const std::string slippery = testing::Replaced(
      QuickRobustTask("friction = { from = 0.1, to = 1.0 }\n"), "mu = 0.3", "mu = 0.0");
  EXPECT_NE(RefusalOf(slippery).find("friction has a range, 0.1..1, but the contact law's is 0"),
            std::string::npos)
      << RefusalOf(slippery);
}

TEST(RobustTask, ATaskThatRobotsCannotBeJudgedByIsRefusedWithTheRemedy) {
  EXPECT_NE(RefusalOf(QuickRobustTask("mas = 0.1\n")).find("mas"), std::string::npos);
  EXPECT_NE(RefusalOf(QuickRobustTask("mass = 2\n")).find("mass"), std::string::npos);
  const std::string aimless = testing::Replaced(
      testing::Replaced(QuickRobustTask(), "of = \"pitch\"", "of = \"pitch_rate\""), "target = 0.0",
      "target = 0.1");
  EXPECT_NE(RefusalOf(aimless).find("the task asks for none"), std::string::npos)
      << RefusalOf(aimless);
  std::string stones = QuickRobustTask();
  for (int i = 0; i < 5; ++i) {
    stones += fmt::format(
        "\n[[obstacle]]\nname = \"stone {0}\"\nkind = \"sphere\"\n"
        "centre_m = [3.{0}, 0.0]\nradius_m = 0.1\n",
        i);
  }
  EXPECT_NE(RefusalOf(stones).find("there are 5 obstacles that are no half-spaces"),
            std::string::npos)
      << RefusalOf(stones);
}

}  // namespace
}  // namespace tumbler
