// Telling the different motions apart in which local solves ended.

#include "offline/solve/minima.h"

#include <gtest/gtest.h>

#include <set>

#include "offline/problem/task_toml.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::QuickTask;
using testing::Replaced;
using testing::ShippedRobot;

Solution Ended(int start, std::vector<double> x) {
  Solution solution;
  solution.start = start;
  solution.x = std::move(x);
  solution.finished = true;
  solution.evaluations = 1;
  solution.rollout.finite = true;
  return solution;
}

TEST(DistinctMinima, AreApartInSomeParameterByMoreThanTheTolerance) {
  const std::vector<Solution> solutions = {Ended(4, {1.0, 2.0}), Ended(0, {1.0, 2.3}),
                                           Ended(7, {1.09, 1.91}), Ended(2, {1.0, 2.39}),
                                           Ended(1, {1.11, 2.0})};
  const std::vector<LocalMinimum> minima = DistinctMinima(solutions, 0.1);
  ASSERT_EQ(minima.size(), 3U);
  EXPECT_EQ(minima[0].solution, 0U);
  EXPECT_EQ(minima[0].starts, (std::vector<int>{4, 7}));
  EXPECT_EQ(minima[1].solution, 1U);
  EXPECT_EQ(minima[1].starts, (std::vector<int>{0, 2}));
  EXPECT_EQ(minima[2].starts, (std::vector<int>{1}));
}

TEST(DistinctMinima, AreNoneOfWhatWasNotSolvedToTheEnd) {
  std::vector<Solution> solutions(3, Ended(0, {1.0}));
  solutions[0].finished = false;
  solutions[1].rollout.finite = false;
  solutions[2].evaluations = 0;
  EXPECT_TRUE(DistinctMinima(solutions).empty());
  EXPECT_TRUE(DistinctMinima({}).empty());
}

TEST(DistinctMinima, AConvexProblemHasOneThatEveryStartLeadsTo) {
  // With the root fixed, and effort as the only cost.
  std::string text = Replaced(QuickTask(), "planar-xz", "fixed");
  text = Replaced(text, "pitch_rad = 0.0", "", "[start]");
  const std::size_t cost = text.find("[[cost]]");
  text.erase(cost, text.find("[contact]") - cost);
  const std::size_t obstacle = text.find("[[obstacle]]");
  text.erase(obstacle, text.find("[search]") - obstacle);
  Problem problem =
      ParseTask("obstacle = []\ncost = [{ term = \"effort\", weight = 1.0 }]\n" + text, "task.toml",
                ShippedRobot(), "robot.urdf")
          .problem;
  problem.search.refine = problem.solver.finalists = 4;
  problem.solver.max_evaluations = 1000;
  const SolveOutcome outcome = Solve(problem, {});
  const std::vector<LocalMinimum> minima = DistinctMinima(outcome.solutions);
  ASSERT_EQ(minima.size(), 1U);
  EXPECT_EQ(std::set<int>(minima[0].starts.begin(), minima[0].starts.end()).size(), 4U);
}

}  // namespace
}  // namespace tumbler
