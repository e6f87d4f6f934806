// Motions that robots survive which are not the model: the strategy that finds them, what it hands
// over, and the task's table.

#include "offline/robust/robust_search.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "common/toml_reader.h"
#include "offline/problem/task_toml.h"
#include "offline/robust/cma_es.h"
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
  EXPECT_EQ(polished.evaluations, 1 + 3 * 16) << "the guess, and three generations of 16";
  ASSERT_EQ(polished.solutions.size(), 1U);
  EXPECT_LE(polished.history.back().cost, 0.2);
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

TEST(RobustTask, TheKeysAreRead) {
  const Problem problem = ProblemOf(
      QuickRobustTask("mass = 0.07\nslope_rad = 0.02\nkp_nm_per_rad = 150\npolish_scale = 2\n"));
  ASSERT_TRUE(problem.robust);
  EXPECT_EQ(problem.robust->spreads.mass, 0.07);
  EXPECT_EQ(problem.robust->spreads.slope_rad, 0.02);
  EXPECT_EQ(problem.robust->spreads.friction, Spreads{}.friction);
  EXPECT_EQ(problem.robust->drive.kp, 150);
  EXPECT_EQ(problem.robust->drive.kd, 5);
  EXPECT_EQ(problem.robust->polish_scale, 2);
  EXPECT_EQ(problem.robust->polish_robots, 8);
  EXPECT_FALSE(ProblemOf(testing::QuickTask()).robust);
}

TEST(RobustTask, ATaskThatRobotsCannotBeJudgedByIsRefusedWithTheRemedy) {
  EXPECT_NE(RefusalOf(QuickRobustTask("mas = 0.1\n")).find("mas"), std::string::npos);
  EXPECT_NE(RefusalOf(QuickRobustTask("mass = 2\n")).find("mass"), std::string::npos);
  const std::string aimless = testing::Replaced(
      testing::Replaced(QuickRobustTask(), "of = \"pitch\"", "of = \"pitch_rate\""), "target = 0.0",
      "target = 0.1");
  EXPECT_NE(RefusalOf(aimless).find("the task asks for none"), std::string::npos)
      << RefusalOf(aimless);
  const std::string stone = QuickRobustTask() +
                            "\n[[obstacle]]\nname = \"stone\"\nkind = \"sphere\"\n"
                            "centre_m = [3.0, 0.0]\nradius_m = 0.1\n";
  EXPECT_NE(RefusalOf(stone).find("'stone' is no half-space"), std::string::npos)
      << RefusalOf(stone);
}

}  // namespace
}  // namespace tumbler
