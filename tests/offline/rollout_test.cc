#include "offline/solve/rollout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "offline/solve/output_gradients.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

constexpr std::array<double, 3> kDifferenceSteps = {1e-6, 1e-7, 1e-5};
constexpr double kTolerance = 1e-5;

std::vector<double> Outputs(const RolloutResult& result) {
  std::vector<double> out{result.cost};
  out.insert(out.end(), result.torque_excess.begin(), result.torque_excess.end());
  out.push_back(result.penetration_excess);
  out.push_back(result.clearance_excess);
  return out;
}

/// For each output, the largest difference between the gradient and central differences over all
/// parameters, relative to the largest component of the gradient. It is the best of several
/// difference steps, since no single step is right for every output.
std::vector<double> GradientErrors(const Problem& problem, const std::vector<double>& x,
                                   double step_s) {
  Rollout rollout(problem, step_s);
  auto gradient = OutputGradients::Of(rollout);
  const RolloutResult result = rollout.Run(x, gradient);
  EXPECT_TRUE(result.finite);
  EXPECT_TRUE(result.any_contact);
  const auto outputs = static_cast<std::size_t>(rollout.output_count());
  std::vector<double> best(outputs, 1e300);
  for (const double h : kDifferenceSteps) {
    std::vector<double> worst(outputs, 0);
    for (std::size_t k = 0; k < x.size(); ++k) {
      std::vector<double> shifted = x;
      shifted[k] = x[k] + h;
      const std::vector<double> plus = Outputs(rollout.Run(shifted));
      shifted[k] = x[k] - h;
      const std::vector<double> minus = Outputs(rollout.Run(shifted));
      for (std::size_t i = 0; i < outputs; ++i) {
        const double difference = (plus[i] - minus[i]) / (2 * h);
        const auto row = static_cast<Eigen::Index>(i);
        const double error = std::abs(gradient(row, static_cast<Eigen::Index>(k)) - difference);
        worst[i] = std::max(worst[i], error / gradient.row(row).cwiseAbs().maxCoeff());
      }
    }
    for (std::size_t i = 0; i < outputs; ++i) best[i] = std::min(best[i], worst[i]);
    if (*std::max_element(best.begin(), best.end()) < kTolerance) break;  // This saves time.
  }
  return best;
}

bool SameBits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

/// A handstand after a small drop, so that the gradient goes through an impact of all four feet.
Problem DroppedHandstand(int control_points = 12) {
  Problem problem = HandstandProblem(control_points);
  problem.start_q[1] += 0.05;
  return problem;
}

class GradientAtStep : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Rollout, GradientAtStep, ::testing::Values(0.5e-3, 1e-3, 2e-3));

TEST_P(GradientAtStep, AgreesWithCentralDifferencesThroughImpacts) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Problem problem = DroppedHandstand();
    for (const double error : GradientErrors(problem, RandomMotion(problem, seed), GetParam()))
      EXPECT_LT(error, kTolerance) << "seed " << seed;
  }
}

TEST_P(GradientAtStep, AgreesForTheLinearTerminalCostOfTheRoll) {
  Problem problem = HandstandProblem();  // with the cost of [AB04, Eq. 34]: 50 q1(t_f) - q3(t_f)
  problem.settle_s = 0;
  problem.cost = {LinearTerm(CostTerm::When::kEnd, 0, false, 50),
                  LinearTerm(CostTerm::When::kEnd, 2, false, -1)};
  for (const double error : GradientErrors(problem, RandomMotion(problem, 4), GetParam()))
    EXPECT_LT(error, kTolerance);
}

TEST_P(GradientAtStep, AgreesForSixtyParameters) {
  const Problem problem = DroppedHandstand(36);
  ASSERT_EQ(problem.parameter_count(), 60);
  for (const double error : GradientErrors(problem, RandomMotion(problem, 5, 0.6), GetParam()))
    EXPECT_LT(error, kTolerance);
}

TEST_P(GradientAtStep, AgreesForElevenParametersOfWhichTheJointsHaveFiveAndSix) {
  Problem problem = DroppedHandstand();
  problem.joints[0].control_points = 11;
  ASSERT_EQ(problem.parameter_count(), 11);
  EXPECT_EQ(problem.joint_of_parameter(4), 0U);
  EXPECT_EQ(problem.joint_of_parameter(5), 1U);
  for (const double error : GradientErrors(problem, RandomMotion(problem, 5), GetParam()))
    EXPECT_LT(error, kTolerance);
}

TEST(Rollout, GradientHoldsForEveryKindOfTerminalTermAlone) {
  for (const auto when : {CostTerm::When::kEnd, CostTerm::When::kSettled}) {
    for (const bool of_velocity : {false, true}) {
      for (std::size_t k = 0; k < CostTerm::kKindNames.size(); ++k) {
        const auto kind = static_cast<CostTerm::Kind>(k);
        if (!CostTerm{kind}.of_coordinate()) continue;
        for (const int dof : {0, 1, 2}) {
          // A robot at rest has no gradient to compare, so the motion ends before that.
          Problem problem = HandstandProblem(9);
          problem.duration_s = 0.5;
          problem.settle_s = 0.03;
          problem.cost = {{kind, when, 2.0, dof, of_velocity, 0.3}};
          EXPECT_LT(GradientErrors(problem, RandomMotion(problem, 6), 2e-3)[0], kTolerance)
              << CostTerm::kKindNames[k] << " dof " << dof
              << (of_velocity ? " velocity" : " position");
        }
      }
    }
  }
}

TEST(Rollout, GradientOfEveryKindOfTermAloneIsThatOfItsIntegral) {
  // The integral of a rate is where the motion ends: not at rest, so that there is a gradient.
  Problem problem = HandstandProblem(9);
  problem.duration_s = 0.5;
  problem.settle_s = 0.03;
  for (std::size_t k = 0; k < CostTerm::kKindNames.size(); ++k) {
    for (const bool of_velocity : {false, true}) {
      constexpr int kX = 0;
      problem.cost = {
          {static_cast<CostTerm::Kind>(k), CostTerm::When::kThroughout, 0.5, kX, of_velocity, 0.3}};
      problem.cost[0].joint_dofs = {3, 4};
      EXPECT_LT(GradientErrors(problem, RandomMotion(problem, 6), 2e-3)[0], kTolerance)
          << CostTerm::kKindNames[k] << (of_velocity ? " velocity" : " position");
    }
  }
}

TEST(Rollout, GradientHoldsWithRoundObstaclesDampingAndRotors) {
  Problem problem = DroppedHandstand();
  for (const std::size_t leg : {3U, 4U}) {
    problem.scene.robot.tree.dofs[leg].damping_nm_s_per_rad = 0.1;
    problem.scene.robot.tree.dofs[leg].rotor_inertia_kg_m2 = 2e-3;
  }
  problem.scene.obstacles.push_back({"bump", Shape<Plane>::Sphere({0.19, -0.08}, 0.1)});
  bool touched = false;
  Rollout(problem, 1e-3).Visit(RandomMotion(problem, 8), 0, [&](const MotionSample& sample) {
    for (const ActiveContact<Plane>& contact : sample.contacts) touched |= contact.obstacle == 1;
  });
  EXPECT_TRUE(touched);
  for (const double error : GradientErrors(problem, RandomMotion(problem, 8), 1e-3))
    EXPECT_LT(error, kTolerance);
}

TEST(Rollout, AnUnlimitedTorqueIsNeverExceededAndHasNoGradient) {
  Problem problem = HandstandProblem();
  const std::vector<double> x = RandomMotion(problem, 9);
  Rollout limited(problem, 1e-3);
  OutputGradients expected(5, 12), gradient(5, 12);
  limited.Run(x, expected);
  problem.joints[0].limits.torque_max_nm = std::numeric_limits<double>::infinity();
  Rollout rollout(problem, 1e-3);
  const RolloutResult result = rollout.Run(x, gradient);
  EXPECT_EQ(result.torque_excess[0], -1);
  EXPECT_TRUE((gradient.row(1).array() == 0).all());
  EXPECT_TRUE((gradient.row(0).array() == expected.row(0).array()).all());
  EXPECT_TRUE((gradient.row(2).array() == expected.row(2).array()).all());
}

TEST(Rollout, GivesTheSameBitsEveryTimeAndWithOrWithoutTheGradient) {
  const Problem problem = DroppedHandstand();
  Rollout first(problem, 1e-3), second(problem, 1e-3);
  OutputGradients once(5, 12), again(5, 12);
  for (const std::uint64_t seed : {10U, 11U, 12U}) {
    const std::vector<double> x = RandomMotion(problem, seed);
    const RolloutResult plain = first.Run(x);
    const RolloutResult with_gradient = first.Run(x, once);
    first.Run(RandomMotion(problem, 99), again);  // This must leave no trace.
    const RolloutResult repeated = first.Run(x, again);
    EXPECT_TRUE((once.array() == again.array()).all());
    const RolloutResult other = second.Run(x, again);
    EXPECT_TRUE((once.array() == again.array()).all());
    for (const RolloutResult* result : {&with_gradient, &repeated, &other}) {
      EXPECT_TRUE(SameBits(result->cost, plain.cost));
      EXPECT_TRUE(SameBits(result->peak_penetration_m, plain.peak_penetration_m));
      EXPECT_EQ(result->torque_excess, plain.torque_excess);
      EXPECT_EQ(result->peak_torque_nm, plain.peak_torque_nm);
    }
  }
}

TEST(Rollout, VisitShowsTheMotionWhoseCostRunReturns) {
  Problem problem = DroppedHandstand();
  const std::vector<double> x = RandomMotion(problem, 13);
  for (const int dof : {0, 1, 2}) {
    for (const bool of_velocity : {false, true}) {
      for (const auto when : {CostTerm::When::kEnd, CostTerm::When::kSettled}) {
        // A linear cost of weight one is the state itself.
        problem.cost = {LinearTerm(when, dof, of_velocity, 1)};
        Rollout rollout(problem, 1e-3);
        const RolloutResult result = rollout.Run(x);
        const double instant = when == CostTerm::When::kEnd ? problem.duration_s
                                                            : problem.duration_s + problem.settle_s;
        double seen = 1e300;
        double nearest = 1e300;
        std::vector<double> peak(2, 0);
        rollout.Visit(x, 0.1, [&](const MotionSample& sample) {
          const double distance = std::abs(sample.time_s - instant);
          if (distance < nearest) {
            nearest = distance;
            seen = (of_velocity ? sample.qd : sample.q)[static_cast<std::size_t>(dof)];
          }
          if (sample.time_s > problem.duration_s + problem.settle_s - 0.5e-3) return;
          for (std::size_t j = 0; j < 2; ++j)
            peak[j] = std::max(peak[j], std::abs(sample.torque[j]));
        });
        EXPECT_LT(nearest, 1e-9);
        EXPECT_TRUE(SameBits(result.cost, seen)) << "dof " << dof;
        EXPECT_EQ(peak, result.peak_torque_nm);
      }
    }
  }
}

TEST(Rollout, VisitFollowsTheSplinesAndThenHolds) {
  Problem problem = HandstandProblem();
  problem.joints[0].control_points = 15;  // The second joint has another number.
  const std::vector<double> x = RandomMotion(problem, 14);
  Rollout rollout(problem, 1e-3);
  const auto first = PositionSpline(problem, x, 0);
  const auto spline = PositionSpline(problem, x, 1);
  double last = -1;
  int samples = 0;
  rollout.Visit(x, 0.1, [&](const MotionSample& sample) {
    EXPECT_GT(sample.time_s, last);
    last = sample.time_s;
    ++samples;
    const auto expected = spline.Evaluate(sample.time_s);
    EXPECT_NEAR(sample.q[4], expected.value, 1e-12);
    EXPECT_NEAR(sample.q[3], first.Evaluate(sample.time_s).value, 1e-12);
    EXPECT_NEAR(sample.qd[4], sample.time_s < problem.duration_s ? expected.first : 0, 1e-9);
  });
  EXPECT_EQ(samples, 1501);
  EXPECT_NEAR(last, 1.5, 1e-12);
}

TEST(Rollout, TheSmoothTorqueMaximumIsNotBelowTheTrueOneAndCloseToIt) {
  const Problem problem = DroppedHandstand();
  // Starts of steps as near to each other as this are where the peak of an impact is.
  Rollout rollout(problem, 1e-4);
  for (const std::uint64_t seed : {15U, 16U, 17U}) {
    const RolloutResult result = rollout.Run(RandomMotion(problem, seed));
    for (std::size_t j = 0; j < 2; ++j) {
      const double excess = result.peak_torque_nm[j] / 8 - 1;
      EXPECT_GE(result.torque_excess[j], excess);
      EXPECT_LE(result.torque_excess[j], excess + std::log(10 * 1400.0) / problem.solver.sharpness);
    }
  }
}

TEST(Rollout, TheSmoothPenetrationMaximumIsNotBelowTheTrueOneAndCloseToIt) {
  Problem problem = DroppedHandstand();
  for (const double drop_m : {0.0, 0.05, 0.2}) {
    problem.start_q[1] = 0.2125 + drop_m;
    Rollout rollout(problem, 1e-3);
    const RolloutResult result = rollout.Run(RandomMotion(problem, 15));
    const double excess = result.peak_penetration_m / (0.9 * problem.scene.contact.d_on_m) - 1;
    EXPECT_GT(excess, -1);
    EXPECT_GE(result.penetration_excess, excess);
    EXPECT_LE(result.penetration_excess,
              excess + std::log(4 * 10 * 1400.0) / problem.solver.sharpness);
  }
}

TEST(Rollout, TheStepHardlyMovesTheSmoothMaxima) {
  const Problem problem = DroppedHandstand();
  for (const std::uint64_t seed : {15U, 16U, 17U}) {
    const std::vector<double> x = RandomMotion(problem, seed);
    const RolloutResult a = Rollout(problem, 0.25e-3).Run(x), b = Rollout(problem, 0.125e-3).Run(x);
    // A sum over steps without their length would move by ln 2 / sharpness.
    const double by_count = std::log(2.0) / problem.solver.sharpness;
    for (std::size_t j = 0; j < 2; ++j)
      EXPECT_NEAR(a.torque_excess[j], b.torque_excess[j], 0.3 * by_count);
    EXPECT_NEAR(a.penetration_excess, b.penetration_excess, 0.3 * by_count);
  }
}

TEST(Rollout, RefusesStepsThatDoNotAddUpToMotionAndSettlePhase) {
  const Problem problem = DroppedHandstand();
  Rollout rollout(problem, 1e-3);
  const StepGrid even = EvenGrid(problem.duration_s, problem.settle_s, 2e-3);
  EXPECT_NO_THROW(rollout.Use(even));
  StepGrid shorter = even;
  shorter.motion.pop_back();
  EXPECT_THROW(rollout.Use(shorter), std::invalid_argument);
  StepGrid longer = even;
  longer.settling.push_back(1e-3);
  EXPECT_THROW(rollout.Use(longer), std::invalid_argument);
}

TEST(Rollout, GivenStepsAreThoseOfTheVisit) {
  const Problem problem = DroppedHandstand();
  Rollout rollout(problem, 1e-3);
  StepGrid grid = EvenGrid(problem.duration_s, problem.settle_s, 4e-3);
  // Every other step gives half of its length to the one before.
  for (std::size_t i = 1; i < grid.motion.size(); i += 2) {
    grid.motion[i - 1] += grid.motion[i] / 2;
    grid.motion[i] /= 2;
  }
  rollout.Use(grid);
  const std::vector<double> x = RandomMotion(problem, 3);
  const auto path = PositionSpline(problem, x, 0);
  std::vector<double> times;
  rollout.Visit(x, 0, [&](const MotionSample& sample) {
    times.push_back(sample.time_s);
    EXPECT_NEAR(sample.q[3], path.Evaluate(sample.time_s).value, 1e-12);
  });
  ASSERT_EQ(times.size(), grid.motion.size() + grid.settling.size() + 1);
  EXPECT_NEAR(times[1], 6e-3, 1e-12);
  EXPECT_NEAR(times[2], 8e-3, 1e-12);
  EXPECT_NEAR(times.back(), problem.duration_s + problem.settle_s, 1e-9);
}

TEST(Rollout, GradientOfThePenetrationHoldsWhereTheLayerIsCrossed) {
  Problem problem = DroppedHandstand();
  problem.start_q[1] += 0.1;
  Rollout rollout(problem, 1e-3);
  auto gradient = OutputGradients::Of(rollout);
  const std::vector<double> x = RandomMotion(problem, 3);
  ASSERT_GT(rollout.Run(x, gradient).penetration_excess, 0);
  constexpr int kCoreRow = 3;
  EXPECT_GT(gradient.row(kCoreRow).cwiseAbs().maxCoeff(), 0.01);
  EXPECT_LT(GradientErrors(problem, x, 1e-3)[kCoreRow], kTolerance);
}

TEST(Rollout, TheEstimateConvergesToTheRunWithTheFirstOrder) {
  // The motion is smooth in flight, where no contact makes it sensitive.
  Problem problem = HandstandProblem();
  problem.start_q[1] += 20;
  problem.cost.back() = EffortTerm(1e-2);
  const std::vector<double> x = RandomMotion(problem, 4);
  const double exact = Rollout(problem, 0.5e-3).Run(x).cost;
  const double coarse = std::abs(Rollout(problem, 0.4e-3).Estimate(x).cost - exact);
  const double fine = std::abs(Rollout(problem, 0.2e-3).Estimate(x).cost - exact);
  EXPECT_LT(coarse, 0.02 * exact);
  EXPECT_NEAR(coarse / fine, 2, 0.6);
}

TEST(Rollout, HalvingTheStepConvergesWithTheFourthOrderInFlight) {
  Problem problem = HandstandProblem();
  problem.scene.obstacles.clear();
  problem.settle_s = 0;  // Where the motion ends, the legs' acceleration may jump.
  problem.cost = {LinearTerm(CostTerm::When::kEnd, 2, false, 1)};
  // With one polynomial nothing is rough inside a step.
  for (ActuatedJoint& joint : problem.joints) joint.control_points = 6;
  problem.joints[0].end_rad = 0.5;
  const std::vector<double> x;
  const auto cost = [&](double step_s) { return Rollout(problem, step_s).Run(x).cost; };
  const double reference = cost(1e-3);
  const double coarse = cost(40e-3) - reference;
  const double fine = cost(20e-3) - reference;
  EXPECT_GT(std::abs(coarse), 1e-9);
  EXPECT_NEAR(std::log2(coarse / fine), 4, 0.3);
}

TEST(Rollout, ARunThatBlowsUpSaysSoAndHasNoGradient) {
  Problem problem = HandstandProblem();
  Rollout rollout(problem, 1e-3);
  OutputGradients gradient(5, 12);
  const std::vector<double> good = RandomMotion(problem, 18);
  const double cost = rollout.Run(good).cost;
  for (const double bad :
       {1e6, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    std::vector<double> x = good;
    x[4] = bad;
    const RolloutResult plain = rollout.Run(x);
    EXPECT_FALSE(plain.finite);
    EXPECT_EQ(plain.cost, std::numeric_limits<double>::infinity());
    gradient.setOnes();
    const RolloutResult result = rollout.Run(x, gradient);
    EXPECT_FALSE(result.finite);
    EXPECT_TRUE((gradient.array() == 0).all());
    EXPECT_TRUE(SameBits(rollout.Run(good).cost, cost)) << "a failed run left something behind";
  }
}

}  // namespace
}  // namespace tumbler
