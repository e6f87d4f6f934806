// The local and the global solver: bounds hold for all t, solutions are what they claim, and
// failures have names.

#include "offline/solve/solver.h"
#include "common/files/spline_extent.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/constraints.h"
#include "offline/solve/random_starts.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using testing::LongHandstandTask;
using testing::QuickTask;
using testing::Replaced;
using testing::ShippedRobot;

Problem Parsed(const std::string& task) {
  return ParseTask(task, "task.toml", ShippedRobot(), "robot.urdf").problem;
}

std::vector<double> RandomParameters(const Problem& problem, std::mt19937& random) {
  std::uniform_real_distribution<double> angle(-3, 3);
  std::vector<double> x(static_cast<std::size_t>(problem.parameter_count()));
  for (double& value : x) value = angle(random);
  return x;
}

double Value(const LinearRow& row, const std::vector<double>& x) {
  return row.b + std::inner_product(row.a.begin(), row.a.end(), x.begin(), 0.0);
}

/// The handstand problem with another start and end of the joints, and limits that differ by joint.
Problem Uneven(int degree, int points) {
  std::string text =
      Replaced(LongHandstandTask(), "degree = 5", "degree = " + std::to_string(degree));
  text = Replaced(text, "control_points = 12", "control_points = " + std::to_string(points));
  text = Replaced(text, "[[cost]]",
                  "[limits.leg1]\nvelocity_max_rad_s = 7.0\n[limits.leg2]\nacceleration_max_rad_s2 "
                  "= 90.0\n[[cost]]");
  return Parsed(text);
}

TEST(DerivativeLimitRows, AreTheRefinedControlPointsOfTheSplinesDerivativesOverTheLimits) {
  std::mt19937 random(1);
  for (const auto& [degree, points] : {std::pair(3, 9), std::pair(5, 12), std::pair(7, 20)}) {
    const Problem problem = Uneven(degree, points);
    const std::vector<LinearRow> rows = DerivativeLimitRows(problem);
    for (int trial = 0; trial < 20; ++trial) {
      const std::vector<double> x = RandomParameters(problem, random);
      // Every |control point| / limit - 1, by the splines and by the rows.
      std::map<std::string, std::vector<double>> expected, said;
      for (std::size_t j = 0; j < problem.joints.size(); ++j) {
        const auto spline = PositionSpline(problem, x, j);
        const JointLimits<double>& limits = problem.joints[j].limits;
        const std::string joint = j == 0 ? "leg1" : "leg2";
        for (int d = 1; d <= 2; ++d) {
          const double limit = d == 1 ? limits.velocity_max_rad_s : limits.acceleration_max_rad_s2;
          const auto values = RefinedControlPoints(spline, d, 8);
          // At the ends, where the joint rests, they are zero for every x.
          const std::size_t fixed = d == 1 ? 2 : 1;
          for (std::size_t k = 0; k < values.size(); ++k) {
            if (k < fixed || k + fixed >= values.size()) {
              EXPECT_NEAR(values[k], 0, 1e-9);
              continue;
            }
            auto& list = expected[(d == 1 ? "velocity of " : "acceleration of ") + joint];
            list.push_back(values[k] / limit - 1);
            list.push_back(-values[k] / limit - 1);
          }
        }
      }
      for (const LinearRow& row : rows) said[row.name].push_back(Value(row, x));
      ASSERT_EQ(said.size(), 4U);
      for (auto& [name, list] : expected) {
        auto& other = said[name];
        ASSERT_EQ(list.size(), other.size()) << name << " degree " << degree;
        std::sort(list.begin(), list.end());
        std::sort(other.begin(), other.end());
        // The solver's limits are tighter by a millionth.
        for (std::size_t i = 0; i < list.size(); ++i)
          EXPECT_NEAR(list[i], other[i], 3e-6 * (1 + std::abs(list[i]))) << name;
      }
    }
  }
}

TEST(DerivativeLimitRows, BelongToTheParametersOfTheirOwnJoint) {
  const Problem problem = Parsed(Replaced(LongHandstandTask(), "control_points = 12",
                                          "control_points = { leg1 = 9, leg2 = 14 }"));
  ASSERT_EQ(problem.parameter_count(), 11);
  std::map<std::string, int> count;
  for (const LinearRow& row : DerivativeLimitRows(problem)) {
    ++count[row.name];
    const bool first_joint = row.name.ends_with("leg1");
    for (std::size_t i = 0; i < row.a.size(); ++i) {
      if ((i < 3) == first_joint) continue;
      EXPECT_EQ(row.a[i], 0) << row.name << " parameter " << i;
    }
  }
  // The velocity has n - 1 points, of which rest fixes two at each end; the acceleration has n - 2,
  // of which it fixes one at each end. Each of the n - 5 spans is cut into eight.
  EXPECT_EQ(count["velocity of leg1"], 2 * (4 + 4 * 7));
  EXPECT_EQ(count["acceleration of leg1"], 2 * (5 + 4 * 7));
  EXPECT_EQ(count["velocity of leg2"], 2 * (9 + 9 * 7));
  EXPECT_EQ(count["acceleration of leg2"], 2 * (10 + 9 * 7));
}

TEST(DerivativeLimitRows, BoundVelocityAndAccelerationForAllTimeAndByHardlyMore) {
  const Problem problem = Uneven(5, 12);
  const std::vector<LinearRow> rows = DerivativeLimitRows(problem);
  std::mt19937 random(2);
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<double> x = RandomParameters(problem, random);
    std::map<std::string, double> worst;
    for (const LinearRow& row : rows) {
      const auto [entry, is_new] = worst.emplace(row.name, Value(row, x));
      if (!is_new) entry->second = std::max(entry->second, Value(row, x));
    }
    for (std::size_t j = 0; j < 2; ++j) {
      const auto spline = PositionSpline(problem, x, j);
      const JointLimits<double>& limits = problem.joints[j].limits;
      const std::string joint = j == 0 ? "leg1" : "leg2";
      // Points that are drawn at random make paths more ragged than any optimum.
      const Extent velocity = ExtentOf(spline, 1), acceleration = ExtentOf(spline, 2);
      const auto share = [](const Extent& extent, double limit) {
        return std::max(extent.max, -extent.min) / limit;
      };
      EXPECT_LE(1 + worst.at("velocity of " + joint),
                1.03 * share(velocity, limits.velocity_max_rad_s));
      EXPECT_LE(1 + worst.at("acceleration of " + joint),
                1.03 * share(acceleration, limits.acceleration_max_rad_s2));
      for (int i = 0; i <= 1000; ++i) {
        const auto sample = spline.Evaluate(problem.duration_s * i / 1000.0);
        EXPECT_LE(std::abs(sample.first) / limits.velocity_max_rad_s - 1,
                  worst.at("velocity of " + joint) + 1e-9);
        EXPECT_LE(std::abs(sample.second) / limits.acceleration_max_rad_s2 - 1,
                  worst.at("acceleration of " + joint) + 1e-9);
      }
    }
  }
}

TEST(Solve, KeepsTheLimitsOfJointsWithDifferentNumbersOfParameters) {
  Problem problem = Parsed(Replaced(LongHandstandTask(), "control_points = 12",
                                    "control_points = { leg1 = 11, leg2 = 12 }"));
  problem.joints[0].limits.position_min_rad = -1.9;
  problem.joints[1].limits.position_max_rad = 1.8;
  problem.search.max_samples = 40;
  problem.search.batch = 40;
  problem.search.refine = 1;
  problem.solver.max_evaluations = problem.solver.screen_evaluations = 15;
  const SolveOutcome outcome = Solve(problem, {});
  ASSERT_EQ(outcome.solutions.size(), 1U);
  const Solution& solution = outcome.solutions[0];
  ASSERT_EQ(solution.x.size(), 11U);
  for (std::size_t i = 0; i < 11; ++i) {
    const JointLimits<double>& limits = problem.joints[i < 5 ? 0 : 1].limits;
    EXPECT_GE(solution.x[i], limits.position_min_rad - 1e-6) << i;
    EXPECT_LE(solution.x[i], limits.position_max_rad + 1e-6) << i;
  }
}

/// Checks every limit by the splines and a rollout of its own.
void ExpectWithinLimits(const Problem& problem, const Solution& solution) {
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const JointLimits<double>& limits = problem.joints[j].limits;
    const auto spline = PositionSpline(problem, solution.x, j);
    for (const double q : spline.control_points(0)) {
      EXPECT_GE(q, limits.position_min_rad);
      EXPECT_LE(q, limits.position_max_rad);
    }
    const auto largest = [&spline](int d) {
      const Extent extent = ExtentOf(spline, d);
      return std::max(extent.max, -extent.min);
    };
    EXPECT_LE(largest(1), limits.velocity_max_rad_s);
    EXPECT_LE(largest(2), limits.acceleration_max_rad_s2);
  }
  Rollout rollout(problem, problem.solver.step_s);
  double deepest = 0;
  rollout.Visit(solution.x, 0, [&](const MotionSample& sample) {
    for (std::size_t j = 0; j < problem.joints.size(); ++j)
      EXPECT_LE(std::abs(sample.torque[j]), problem.joints[j].limits.torque_max_nm);
    for (const auto& contact : sample.contacts) deepest = std::max(deepest, contact.depth_m);
  });
  EXPECT_LT(deepest, problem.scene.contact.d_on_m);
}

TEST(Solve, KeepsEveryLimitAlsoWhenLimitsAreTight) {
  // The limits are so tight that the free optimum breaks them, since a raised pitch needs fast
  // legs.
  std::string text = Replaced(QuickTask(), "target = 0.0", "target = 0.3");
  text = Replaced(text, "acceleration_max_rad_s2 = 400.0",
                  "acceleration_max_rad_s2 = 60.0\nvelocity_max_rad_s = 3.0\ntorque_max_nm = "
                  "2.5\nposition_max_rad = 1.7");
  const Problem problem = Parsed(text);
  const SolveOutcome outcome = Solve(problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution& best = outcome.solutions.front();
  ASSERT_TRUE(best.feasible()) << best.worst_constraint << " " << best.constraint_violation;
  ExpectWithinLimits(problem, best);
}

TEST(Solve, NeverCallsAMotionFeasibleThatBreaksALimit) {
  // Durations go from hopeless to easy. `feasible` must be true of the motion, whatever the solver
  // itself reports.
  int feasible = 0, infeasible = 0;
  for (const char* duration : {"0.06", "0.08", "0.12", "0.2", "0.5"}) {
    SCOPED_TRACE(duration);
    const Problem problem =
        Parsed(Replaced(QuickTask(), "duration_s = 0.5", "duration_s = " + std::string(duration)));
    for (const Solution& solution : Solve(problem, {}).solutions) {
      if (solution.feasible()) {
        ++feasible;
        ExpectWithinLimits(problem, solution);
      } else {
        ++infeasible;
        EXPECT_NE(solution.end, SolveEnd::kConverged);
      }
    }
  }
  EXPECT_GT(feasible, 0);
  EXPECT_GT(infeasible, 0);
}

TEST(Solve, NamesTheLimitThatStandsAgainstTheEnd) {
  // 1.57 rad are asked for, but in 0.06 s at 20 rad/s only 1.2 rad are possible.
  const Problem problem =
      Parsed(Replaced(LongHandstandTask(), "duration_s = 1.2", "duration_s = 0.06"));
  for (const Solution& solution : Solve(problem, {}).solutions) {
    EXPECT_FALSE(solution.feasible());
    EXPECT_GT(solution.constraint_violation, 0.01);
    EXPECT_THAT(solution.worst_constraint,
                AnyOf(HasSubstr("velocity of leg"), HasSubstr("acceleration of leg")));
  }
}

/// A robot with a fixed root and one swinging leg. With effort as the only cost the problem is
/// convex in the limit of small angles.
Problem FixedRootSwing() {
  std::string text = Replaced(QuickTask(), "planar-xz", "fixed");
  text = Replaced(text, "pitch_rad = 0.0", "", "[start]");
  const std::size_t cost = text.find("[[cost]]");
  text.erase(cost, text.find("[contact]") - cost);
  const std::size_t obstacle = text.find("[[obstacle]]");
  text.erase(obstacle, text.find("[search]") - obstacle);
  return Parsed("obstacle = []\ncost = [{ term = \"effort\", weight = 1.0 }]\n" + text);
}

TEST(SolveFrom, ConvergesToOneOptimumFromAnywhereWhenTheProblemIsAsGoodAsQuadratic) {
  const Problem problem = FixedRootSwing();
  Rollout rollout(problem, problem.solver.step_s);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> small(-0.3, 0.3);
  std::vector<double> costs;
  for (int trial = 0; trial < 4; ++trial) {
    std::vector<double> x;
    for (const ActuatedJoint& joint : problem.joints) {
      for (int i = 0; i < joint.free_points(); ++i)
        x.push_back(0.5 * (joint.start_rad + joint.end_rad) + small(random));
    }
    const Solution solution = SolveFrom(problem, x, 400, rollout, {}, nullptr);
    EXPECT_TRUE(solution.end == SolveEnd::kConverged || solution.end == SolveEnd::kStalled)
        << ToString(solution.end);
    EXPECT_TRUE(solution.feasible());
    EXPECT_LT(solution.rollout.cost, solution.start_cost);
    EXPECT_LT(solution.kkt.absolute, 1e-3);
    costs.push_back(solution.rollout.cost);
    // No neighbour is better.
    for (std::size_t i = 0; i < solution.x.size(); ++i) {
      for (const double step : {-0.02, 0.02}) {
        std::vector<double> near = solution.x;
        near[i] += step;
        EXPECT_GT(rollout.Run(near).cost, solution.rollout.cost);
      }
    }
  }
  for (const double cost : costs) EXPECT_NEAR(cost, costs[0], 1e-4 * costs[0]);
}

TEST(RandomStarts, KeepAllLimitsOfPaths) {
  for (const int points : {9, 12}) {
    const Problem problem = Uneven(5, points);
    const std::vector<LinearRow> rows = DerivativeLimitRows(problem);
    const RandomStarts starts(problem);
    for (std::uint64_t i = 0; i < 50; ++i) {
      const std::vector<double> x = starts.Draw(i);
      for (const LinearRow& row : rows) EXPECT_LT(Value(row, x), 1e-9) << points << " " << row.name;
      for (std::size_t p = 0; p < x.size(); ++p) {
        const JointLimits<double>& limits =
            problem.joints[problem.joint_of_parameter(static_cast<int>(p))].limits;
        EXPECT_GE(x[p], limits.position_min_rad);
        EXPECT_LE(x[p], limits.position_max_rad);
      }
    }
  }
}

TEST(SolveFrom, TakesAStartThatIsOutsideOfItsLimitsByARounding) {
  const Problem problem = FixedRootSwing();
  Rollout rollout(problem, problem.solver.step_s);
  std::vector<double> x(static_cast<std::size_t>(problem.parameter_count()), 0.0);
  const JointLimits<double>& limits = problem.joints[0].limits;
  x[0] = std::nextafter(limits.position_max_rad, HUGE_VAL);
  x[1] = std::nextafter(limits.position_min_rad, -HUGE_VAL);
  const Solution solution = SolveFrom(problem, x, 50, rollout, {}, nullptr);
  EXPECT_NE(solution.end, SolveEnd::kFailed);
  EXPECT_LT(solution.rollout.cost, solution.start_cost);
}

class SolveWithManyPoints : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Points, SolveWithManyPoints, ::testing::Values(24, 40, 64));

TEST_P(SolveWithManyPoints, FindsABetterHandstandThanFewPointsCan) {
  const std::string path = "primitives/tasks/nominal/handstand.toml";
  const std::string text = ReadTextFile(testing::SourcePath(path));
  Problem problem = ParseTask(testing::Replaced(text, "control_points = 9",
                                                fmt::format("control_points = {}", GetParam())),
                              "task.toml", testing::ShippedRobot(), "robot.urdf")
                        .problem;
  problem.search.seed = 1;
  problem.solver.max_evaluations = 150;
  SolveOptions options;
  options.accept = [&](const Solution& solution) {
    return LookAgain(problem, solution.x).acceptable();
  };
  const SolveOutcome outcome = Solve(problem, options);
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution& best = outcome.solutions.front();
  EXPECT_EQ(best.x.size(), static_cast<std::size_t>(problem.parameter_count()));
  EXPECT_TRUE(best.feasible() && !best.refused) << best.worst_constraint;
  EXPECT_LT(best.rollout.cost, 4.7e-4) << "the best of 20 seeds with 9 points has 4.716e-4";
  EXPECT_LE(best.evaluations, problem.solver.max_evaluations);
}

TEST(Solve, SaysWhetherAnythingWasTouched) {
  const std::string aloft =
      Replaced(QuickTask(), "pitch_rad = 0.0", "pitch_rad = 0.0\nz_m = 0.0", "[start]");
  const Problem far = Parsed(Replaced(aloft, "point_m = [0.0, 0.0]", "point_m = [0.0, -500.0]"));
  EXPECT_FALSE(Solve(far, {}).solutions.front().rollout.any_contact);
  EXPECT_TRUE(Solve(Parsed(QuickTask()), {}).solutions.front().rollout.any_contact);
}

TEST(Solve, WhatIsOnlyScreenedIsThereSoonerAndMayBeLedFurther) {
  const Task task = LoadTask(testing::SourcePath("primitives/tasks/nominal/handstand.toml"));
  SolveOptions options;
  const SolveOutcome solved = Solve(task.problem, options);
  options.to = SolveTo::kScreened;
  const SolveOutcome screened = Solve(task.problem, options);
  EXPECT_LT(screened.evaluations, solved.evaluations);
  ASSERT_EQ(screened.solutions.size(), static_cast<std::size_t>(task.problem.search.refine));
  for (const Solution& solution : screened.solutions) EXPECT_FALSE(solution.finished);
  EXPECT_LT(screened.solutions.front().rollout.cost, 0.1) << "the robot does not arrive upright";
}

TEST(Solve, WhatIsScreenedWithFewPointsHasThoseOfTheTask) {
  Task task = LoadTask(testing::SourcePath("primitives/tasks/nominal/handstand.toml"));
  for (ActuatedJoint& joint : task.problem.joints) joint.control_points = 20;
  SolveOptions options;
  options.to = SolveTo::kScreened;
  const SolveOutcome screened = Solve(task.problem, options);
  ASSERT_FALSE(screened.solutions.empty());
  Rollout rollout(task.problem, task.problem.solver.step_s);
  for (const Solution& solution : screened.solutions)
    ASSERT_EQ(solution.x.size(), static_cast<std::size_t>(task.problem.parameter_count()));
  EXPECT_LT(rollout.Run(screened.solutions.front().x).cost, 0.1);
}

TEST(Solve, ThreadsChangeNothing) {
  const Problem problem = Parsed(QuickTask());
  const SolveOutcome one = Solve(problem, {});
  for (const int threads : {2, 5}) {
    SolveOptions options;
    options.threads = threads;
    const SolveOutcome other = Solve(problem, options);
    EXPECT_EQ(other.evaluations, one.evaluations);
    ASSERT_EQ(other.solutions.size(), one.solutions.size());
    for (std::size_t i = 0; i < one.solutions.size(); ++i) {
      EXPECT_EQ(other.solutions[i].x, one.solutions[i].x);
      EXPECT_EQ(other.solutions[i].rollout.cost, one.solutions[i].rollout.cost);
    }
    ASSERT_EQ(other.history.size(), one.history.size());
    for (std::size_t i = 0; i < one.history.size(); ++i) {
      EXPECT_EQ(other.history[i].start, one.history[i].start);
      EXPECT_EQ(other.history[i].count, one.history[i].count);
      EXPECT_EQ(other.history[i].cost, one.history[i].cost);
    }
  }
}

TEST(Solve, GoesOnInPlaceOfAMotionThatIsRefused) {
  const Problem problem = Parsed(QuickTask());
  const Solution first = Solve(problem, {}).solutions.front();
  ASSERT_TRUE(first.feasible());
  SolveOptions options;
  options.accept = [&first](const Solution& solution) { return solution.x != first.x; };
  const std::vector<Solution> solutions = Solve(problem, options).solutions;
  EXPECT_TRUE(solutions.front().finished);
  EXPECT_TRUE(solutions.front().feasible());
  EXPECT_FALSE(solutions.front().refused);
  EXPECT_NE(solutions.front().x, first.x);
  const auto refused = std::ranges::find_if(solutions, &Solution::refused);
  ASSERT_NE(refused, solutions.end());
  EXPECT_EQ(refused->x, first.x);
}

TEST(Solve, EndsWhenEveryMotionIsRefused) {
  const Problem problem = Parsed(QuickTask());
  SolveOptions options;
  options.accept = [](const Solution&) { return false; };
  const std::vector<Solution> solutions = Solve(problem, options).solutions;
  const auto count = [&](auto member) { return std::ranges::count_if(solutions, member); };
  EXPECT_GT(count(&Solution::refused), 1);
  EXPECT_LE(count(&Solution::finished), problem.solver.finalists + problem.search.refine);
}

TEST(Solve, AnInterruptThatIsAlreadyThereGivesSolutionsThatAreWhole) {
  const Problem problem = Parsed(QuickTask());
  std::atomic<bool> interrupt = true;
  SolveOptions options;
  options.interrupt = &interrupt;
  const SolveOutcome outcome = Solve(problem, options);
  EXPECT_TRUE(outcome.interrupted);
  for (const Solution& solution : outcome.solutions) {
    // A solution that counts as feasible must have parameters.
    if (!solution.feasible()) continue;
    ASSERT_EQ(solution.x.size(), static_cast<std::size_t>(problem.parameter_count()));
    ExpectWithinLimits(problem, solution);
  }
}

}  // namespace
}  // namespace tumbler
