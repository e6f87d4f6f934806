// Minima: what the solver says of them, and what a finer integration and another limit say.

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "offline/certify/certificate.h"
#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/constraints.h"
#include "offline/solve/guess.h"
#include "offline/solve/solve_near.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

Problem Nominal(const std::string& name) {
  return LoadTask(testing::SourcePath("primitives/tasks/nominal/" + name + ".toml")).problem;
}

SolveOptions WithSecondLook(const Problem& problem) {
  SolveOptions options;
  options.threads = 2;
  options.accept = [&problem](const Solution& solution) {
    return LookAgain(problem, solution.x).acceptable();
  };
  return options;
}

struct Start {
  const char* task;
  std::uint64_t seed;
};

class MinimumOfTask : public ::testing::TestWithParam<Start> {};
INSTANTIATE_TEST_SUITE_P(Seeds, MinimumOfTask,
                         ::testing::Values(Start{"handstand", 1}, Start{"handstand", 2},
                                           Start{"downstand", 1}, Start{"downstand", 2},
                                           Start{"roll", 3}, Start{"roll", 5}),
                         [](const auto& start) {
                           return start.param.task + std::to_string(start.param.seed);
                         });

TEST_P(MinimumOfTask, IsOneAlsoByAFinerIntegration) {
  Problem problem = Nominal(GetParam().task);
  problem.search.seed = GetParam().seed;
  problem.solver.prove = true;
  const SolveOutcome outcome = Solve(problem, WithSecondLook(problem));
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution& best = outcome.solutions.front();
  EXPECT_EQ(best.end, SolveEnd::kConverged);
  EXPECT_TRUE(best.feasible() && !best.refused);
  EXPECT_LE(best.kkt.relative.value(), problem.solver.kkt_residual);
  const std::optional<KktResidual> finer = FinerKktResidual(problem, best.x);
  ASSERT_TRUE(finer.has_value());
  EXPECT_LE(finer->relative.value(), 2 * problem.solver.kkt_residual);
  // Motions beside it are none.
  std::vector<double> beside = best.x;
  for (std::size_t i = 0; i < beside.size(); ++i) beside[i] += i % 2 == 0 ? 0.01 : -0.01;
  EXPECT_GT(FinerKktResidual(problem, beside)->relative.value(), 5 * finer->relative.value());
}

/// A minimum near another one. The cost is off by the square of the residual; some solves stall
/// before a residual of 1e-6.
Solution NearTo(Problem problem, const std::vector<double>& x) {
  problem.solver.tolerance = 1e-10;
  problem.solver.kkt_residual = 1e-5;
  NearRollouts rollouts(problem);
  return SolveNear(problem, x, {400, 0}, rollouts, {}, nullptr);
}

TEST(Multiplier, IsWhatTheCostFallsByWhenItsLimitYields) {
  Problem problem = Nominal("downstand");
  const SolveOutcome outcome = Solve(problem, WithSecondLook(problem));
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution best = NearTo(problem, outcome.solutions.front().x);
  ASSERT_EQ(best.end, SolveEnd::kConverged);
  ASSERT_FALSE(best.kkt.multipliers.empty());
  const Multiplier& torque = best.kkt.multipliers.front();
  ASSERT_EQ(torque.name, "torque of leg1") << "or this test is about another limit";

  constexpr double kPart = 2e-3;
  double cost[2] = {};
  for (int i = 0; i < 2; ++i) {
    Problem other = problem;
    other.joints[0].limits.torque_max_nm *= i == 0 ? 1 - kPart : 1 + kPart;
    const Solution moved = NearTo(other, best.x);
    ASSERT_EQ(moved.end, SolveEnd::kConverged);
    cost[i] = moved.rollout.cost;
  }
  EXPECT_NEAR((cost[0] - cost[1]) / (2 * kPart), torque.value, 0.05 * torque.value);
}

TEST(KktResidual, DependsOnNoUnitOfTheCost) {
  const Problem problem = Nominal("handstand");
  Problem scaled = problem;
  for (CostTerm& term : scaled.cost) term.weight *= 1000;
  const std::string file = testing::SourcePath("primitives/nominal/handstand.toml");
  std::vector<double> beside = GuessFrom(problem, LoadPrimitive(file), file);
  beside.front() += 0.02;
  const KktResidual one = *FinerKktResidual(problem, beside);
  const KktResidual other = *FinerKktResidual(scaled, beside);
  EXPECT_NEAR(other.absolute / one.absolute, 1000, 1);
  EXPECT_NEAR(*other.relative / *one.relative, 1, 1e-3);
  EXPECT_LT(*one.relative, 1);
  EXPECT_GT(*one.relative, 1e-3);
}

}  // namespace
}  // namespace tumbler
