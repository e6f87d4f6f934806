// Terms of the cost at given times and of points of links, in rollouts.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "tests/support/gradients.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

using Gradients = OutputGradients;

constexpr double kGravity_m_s2 = 9.81;

/// A term at a time.
CostTerm At(double time_s, CostTerm term) {
  term.when = CostTerm::When::kTime;
  term.time_s = time_s;
  return term;
}
/// A term of a point of a link. @param axis  0: x, 1: z.
CostTerm OfPoint(const Problem& problem, const char* link, std::array<double, 2> point_m,
                 CostTerm term) {
  term.point = PointOfLink(problem.scene.robot, link, point_m);
  return term;
}

/// An arm of 0.4 m on a joint at (0.1, 0.3) of a fixed root, and its path.
Problem Arm() {
  Problem problem;
  problem.name = "arm";
  Dof<Plane> arm;
  arm.name = "shoulder";
  arm.prescribed = true;
  arm.axis = 1;
  arm.offset = {0.1, 0.3};
  arm.mass_kg = 1;
  arm.mass_centre = {0.2, 0};
  problem.scene.robot.tree.dofs = {arm};
  problem.scene.robot.tree.gravity = {0, -kGravity_m_s2};
  problem.scene.robot.links = {{"arm", 0, {}, {1, 0}, {0, 1}, true}};
  ActuatedJoint joint;
  joint.control_points = 10;
  joint.end_rad = 0.4;
  problem.joints = {joint};
  problem.start_q = {0};
  problem.duration_s = 0.8;
  problem.settle_s = 0.1;
  return problem;
}

TEST(TimedCost, ThePointOfAnArmOnItsPathIsWhereTheSplinePutsItByEveryMethod) {
  Problem problem = Arm();
  const std::vector<double> x = {0.3, -0.2, 0.5, 0.1};
  const auto path = PositionSpline(problem, x, 0);
  for (const double t : {0.0313, 0.4, 0.7999, 0.85}) {
    const auto q = path.Evaluate(std::min(t, problem.duration_s));
    const double rate = t < problem.duration_s ? q.first : 0;
    const double x_m = 0.1 + 0.4 * std::cos(q.value), z_m = 0.3 + 0.4 * std::sin(q.value);
    const std::array<double, 4> expected = {x_m, z_m, -rate * (z_m - 0.3), rate * (x_m - 0.1)};
    for (int k = 0; k < 4; ++k) {
      problem.cost = {At(t, OfPoint(problem, "arm", {0.4, 0},
                                    LinearTerm(CostTerm::When::kEnd, k % 2, k >= 2, 1)))};
      Rollout rollout(problem, 7e-3);
      const double value = expected[static_cast<std::size_t>(k)];
      EXPECT_NEAR(rollout.Run(x).cost, value, 1e-12) << t << " " << k;
      EXPECT_NEAR(rollout.Estimate(x).cost, value, 1e-12) << t << " " << k;
      Gradients gradient(4, 4);
      const StepSettings adaptive{StepSettings::Scheme::kAdaptive, 0.1, 1e-9};
      EXPECT_NEAR(ForwardSensitivity(problem, adaptive).Run(x, gradient).cost, value, 1e-12);
    }
  }
}

TEST(TimedCost, ARobotThatFallsFreelyIsAtEveryTimeWhereGravityTakesIt) {
  Problem problem = HandstandProblem();
  problem.scene.obstacles.clear();
  problem.start_q[1] = 5;
  for (ActuatedJoint& joint : problem.joints) joint.end_rad = joint.start_rad;
  std::vector<double> x;
  for (const ActuatedJoint& joint : problem.joints)
    x.insert(x.end(), static_cast<std::size_t>(joint.free_points()), joint.start_rad);
  for (const double t : {0.1234567, 0.9, 1.3}) {
    // Leg 1 hangs down from 0.15 m right of the middle: its point at (0.2, 0) is 0.2 m below.
    const double fallen = 0.5 * kGravity_m_s2 * t * t;
    const std::array<double, 4> foot = {0.15, 5 - 0.2 - fallen, 0, -kGravity_m_s2 * t};
    for (int k = 0; k < 4; ++k) {
      const CostTerm term = LinearTerm(CostTerm::When::kEnd, k % 2, k >= 2, 1);
      problem.cost = {At(t, OfPoint(problem, "leg1_link", {0.2, 0}, term))};
      EXPECT_NEAR(Rollout(problem, 1e-3).Run(x).cost, foot[static_cast<std::size_t>(k)], 1e-9);
    }
    problem.cost = {At(t, LinearTerm(CostTerm::When::kEnd, 1, false, 1))};
    EXPECT_NEAR(Rollout(problem, 1e-3).Run(x).cost, 5 - fallen, 1e-9);
  }
}

/// A dropped robot whose cost has terms of every kind, in the motion, at its end and after it.
Problem Mixed() {
  Problem problem = HandstandProblem(9);
  problem.start_q[1] += 0.05;
  problem.duration_s = 0.5;  // It ends in motion: at rest, nothing depends on how it came there.
  problem.settle_s = 0.06;
  const auto square = [](int dof, bool of_velocity, double target) {
    return SquareTerm(CostTerm::When::kEnd, dof, of_velocity, target, 0.7);
  };
  const auto end = CostTerm::When::kEnd;
  problem.cost = {At(0.53, square(2, true, 0.1)),
                  At(0.2171, OfPoint(problem, "leg1_link", {0.2, 0.01}, square(1, false, 0.3))),
                  At(0.2171, OfPoint(problem, "leg2_link", {-0.2, 0}, square(0, true, 0.1))),
                  At(0.35, square(0, false, 0.2)),
                  OfPoint(problem, "leg2_link", {-0.1, 0.02}, square(1, true, 0.2)),
                  At(0.1, OfPoint(problem, "middle", {0.1, 0}, LinearTerm(end, 1, true, 0.3))),
                  At(0.55, OfPoint(problem, "leg1_link", {0.2, 0}, LinearTerm(end, 0, false, 0.4))),
                  At(0.3, LinearTerm(end, 2, true, 0.2)),
                  SquareTerm(CostTerm::When::kSettled, 2, false, 1, 1),
                  EffortTerm(1e-3)};
  return problem;
}

/// A number's gradient by central differences.
template <class Cost>
Eigen::RowVectorXd Differences(const std::vector<double>& x, double step, Cost&& cost) {
  Eigen::RowVectorXd out(static_cast<Eigen::Index>(x.size()));
  for (std::size_t k = 0; k < x.size(); ++k) {
    std::vector<double> y = x;
    y[k] = x[k] + step;
    const double above = cost(y);
    y[k] = x[k] - step;
    out[static_cast<Eigen::Index>(k)] = (above - cost(y)) / (2 * step);
  }
  return out;
}

double Off(const Eigen::RowVectorXd& a, const Eigen::RowVectorXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

/// The same from the best of several differences, since no step is right through every impact.
template <class Cost>
double OffDifferences(const Eigen::RowVectorXd& gradient, const std::vector<double>& x,
                      Cost&& cost) {
  double best = 1e300;
  for (const double step : {1e-5, 1e-6, 1e-7, 1e-8})
    best = std::min(best, Off(gradient, Differences(x, step, cost)));
  return best;
}

TEST(TimedCost, TheGradientIsThatOfCentralDifferencesTermByTerm) {
  const Problem all = Mixed();
  const std::vector<double> x = RandomMotion(all, 4);
  for (std::size_t i = 0; i + 1 < all.cost.size(); ++i) {
    Problem problem = all;
    problem.cost = {all.cost[i]};
    for (const bool chosen : {false, true}) {
      Rollout rollout(problem, 1e-3);
      if (chosen) rollout.Use(StepsFor(problem, x));
      Gradients gradient(rollout.output_count(), rollout.parameter_count());
      rollout.Run(x, gradient);
      const auto cost = [&](const std::vector<double>& y) { return rollout.Run(y).cost; };
      EXPECT_LT(OffDifferences(gradient.row(0), x, cost), 1e-6) << "term " << i << " " << chosen;
    }
  }
}

TEST(TimedCost, ForwardSensitivitiesAndTheAdjointAgreeToRounding) {
  Problem problem = Mixed();
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const std::vector<double> x = RandomMotion(problem, seed);
    for (const bool adaptive : {false, true}) {
      ForwardSensitivity forward(problem, adaptive ? AdaptiveSteps(problem) : StepSettings{});
      Rollout rollout(problem, 1e-3);
      Gradients ahead(forward.output_count(), forward.parameter_count()), back = ahead,
                                                                          again = ahead;
      const RolloutResult expected = forward.Run(x, ahead);
      if (adaptive) rollout.Use(forward.grid());
      const RolloutResult result = rollout.Run(x, back);
      EXPECT_NEAR(result.cost, expected.cost, 1e-9 * std::abs(expected.cost));
      EXPECT_LT(Off(back.row(0), ahead.row(0)), 1e-7) << seed << (adaptive ? " adaptive" : "");
      ASSERT_EQ(result.residuals.size(), 6U);
      ASSERT_EQ(expected.residuals.size(), 6U);
      for (std::size_t i = 0; i < 6; ++i)
        EXPECT_NEAR(result.residuals[i], expected.residuals[i], 1e-8) << i;
      if (!adaptive) continue;
      EXPECT_EQ(forward.RunAgain(x, again).cost, expected.cost);
      EXPECT_EQ(again, ahead);
    }
  }
}

TEST(TimedCost, TheRowsOfGaussAndNewtonAreTheDerivativesOfTheResiduals) {
  const Problem problem = Mixed();
  const std::vector<double> x = RandomMotion(problem, 4);
  ForwardSensitivity forward(problem, AdaptiveSteps(problem));
  Gradients gradient(forward.output_count(), forward.parameter_count()), ignored = gradient;
  GaussNewton model;
  ASSERT_TRUE(forward.Run(testing::Beside(x), gradient).finite);
  forward.RunAgain(x, gradient, &model);
  ASSERT_EQ(model.residual_slopes.rows(), 6);
  for (Eigen::Index i = 0; i < 6; ++i) {
    const auto residual = [&](const std::vector<double>& y) {
      return forward.RunAgain(y, ignored).residuals[static_cast<std::size_t>(i)];
    };
    EXPECT_LT(OffDifferences(model.residual_slopes.row(i), x, residual), 1e-6) << "residual " << i;
  }
  // Without effort the cost is the squares, and terms that are linear in a value.
  Problem without = problem;
  without.cost.pop_back();
  ForwardSensitivity other(without, AdaptiveSteps(without));
  const RolloutResult result = other.Run(x, gradient, &model);
  const Eigen::Map<const Eigen::VectorXd> r(result.residuals.data(), 6);
  const Eigen::RowVectorXd sum =
      2 * r.transpose() * model.residual_slopes + model.linear.transpose();
  EXPECT_LT(Off(sum, gradient.row(0)), 1e-12);
}

TEST(TimedCost, StepsThatStrideOverAnInstantAreRefused) {
  const Problem problem = Mixed();
  Rollout rollout(problem, 1e-3);
  EXPECT_NO_THROW(rollout.Use(EvenGrid(problem, 2e-3)));
  EXPECT_NO_THROW(rollout.Use(Halved(EvenGrid(problem, 2e-3))));
  EXPECT_THROW(rollout.Use(EvenGrid(problem.duration_s, problem.settle_s, 2e-3)),
               std::invalid_argument);
}

TEST(TimedCost, ATimeOutsideMotionAndSettlePhaseIsRefused) {
  for (const double time_s : {0.0, -0.1, 1.5}) {
    Problem problem = HandstandProblem();
    problem.cost = {At(time_s, LinearTerm(CostTerm::When::kEnd, 1, false, 1))};
    EXPECT_THROW(Rollout(problem, 1e-3), std::invalid_argument) << time_s;
  }
}

TEST(TimedCost, TheVisitStopsAtTheTimesAndTakesNoLongerStepsAfterwards) {
  Problem problem = HandstandProblem();
  const std::vector<double> x = RandomMotion(problem, 5);
  // The last part of the settle phase is so short that the steps after it must not be like it.
  problem.cost = {At(0.31234, LinearTerm(CostTerm::When::kEnd, 1, false, 1)),
                  At(1.4 - 1e-6, LinearTerm(CostTerm::When::kEnd, 1, false, 1))};
  int samples = 0, stops = 0;
  Rollout(problem, 1e-3).Visit(x, 0.5, [&](const MotionSample& sample) {
    ++samples;
    if (std::abs(sample.time_s - 0.31234) < 1e-12 || std::abs(sample.time_s - 1.4 + 1e-6) < 1e-12)
      ++stops;
  });
  EXPECT_EQ(stops, 2);
  EXPECT_NEAR(samples, 1900, 5);
}

}  // namespace
}  // namespace tumbler
