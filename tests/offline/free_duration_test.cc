// Motions whose duration is a parameter.

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "offline/problem/take_free.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/clearance_constraint.h"
#include "offline/solve/constraints.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/guess.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solve_near.h"
#include "tests/support/crossing_legs.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

using Gradients = OutputGradients;

CostTerm At(double time_s, CostTerm term) {
  term.when = CostTerm::When::kTime;
  term.time_s = time_s;
  return term;
}

/// A dropped robot that takes 0.3 to 0.9 s. The last of the terms that look at given times does so
/// at 0.2171 s.
/// @param rich  has those, and motors with friction and a torque-speed curve.
Problem Dropped(bool rich) {
  Problem problem = HandstandProblem(9);
  problem.start_q[1] += 0.05;
  problem.duration_s = 0.5;
  problem.settle_s = 0.06;
  problem.free_duration = DurationBounds{0.3, 0.9};
  problem.cost = {SquareTerm(CostTerm::When::kEnd, 1, true, 0.2, 0.7),
                  SquareTerm(CostTerm::When::kSettled, 2, false, 1, 1), EffortTerm(1e-2)};
  if (!rich) return problem;
  CostTerm of_point = SquareTerm(CostTerm::When::kEnd, 0, true, 0.1, 0.7);
  of_point.point = PointOfLink(problem.scene.robot, "leg2_link", {-0.2, 0});
  CostTerm slip{CostTerm::Kind::kSlip, CostTerm::When::kThroughout, 3};
  slip.robot_weight_n = 20;
  problem.cost.push_back(slip);
  problem.cost.push_back(At(0.2171, of_point));
  problem.cost.push_back(At(0.1, LinearTerm(CostTerm::When::kEnd, 2, true, 0.3)));
  // Speeds fall as the duration grows, and so do friction and what the torque-speed curve takes.
  const Motor motor{.viscous_friction_nm_s_per_rad = 0.05,
                    .dry_friction_nm = 0.3,
                    .base_speed_rad_s = 2,
                    .no_load_speed_rad_s = 9};
  for (ActuatedJoint& joint : problem.joints) {
    joint.motor = motor;
    problem.scene.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].damping_nm_s_per_rad +=
        motor.viscous_friction_nm_s_per_rad;
  }
  problem.scene.motors.assign(problem.joints.size(), motor);
  return problem;
}

/// A random motion of so many times the problem's duration.
std::vector<double> Motion(const Problem& problem, std::uint64_t seed, double duration) {
  std::vector<double> x = RandomMotion(problem, seed);
  x.push_back(duration);
  return x;
}

double Off(const Eigen::RowVectorXd& a, const Eigen::RowVectorXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

/// All outputs of a rollout, in the order of its gradients.
std::vector<double> OutputsOf(const RolloutResult& result) {
  std::vector<double> outputs = {result.cost};
  outputs.insert(outputs.end(), result.torque_excess.begin(), result.torque_excess.end());
  outputs.insert(outputs.end(), {result.penetration_excess, result.clearance_excess});
  return outputs;
}

/// How far a rollout's derivatives of an output by the duration are from differences, relative to
/// the largest derivative of that output. The best of several steps, as none is right through every
/// impact.
template <class Outputs>
double OffDifferences(const Gradients& gradient, Eigen::Index output, const std::vector<double>& x,
                      Outputs&& outputs) {
  double best = 1e300;
  for (const double step : {1e-5, 1e-6, 1e-7}) {
    std::vector<double> later = x, sooner = x;
    later.back() += step;
    sooner.back() -= step;
    const auto at = static_cast<std::size_t>(output);
    const double difference = (outputs(later)[at] - outputs(sooner)[at]) / (2 * step);
    const double scale = std::max(gradient.row(output).cwiseAbs().maxCoeff(), 1e-300);
    best = std::min(best, std::abs(gradient(output, gradient.cols() - 1) - difference) / scale);
  }
  return best;
}

TEST(FreeDuration, TheDerivativesOfAllOutputsAreThoseOfDifferences) {
  for (const bool at_times : {false, true}) {
    const Problem problem = Dropped(at_times);
    const std::vector<double> x = Motion(problem, 4, 1.1);
    for (const bool chosen : {false, true}) {
      Rollout rollout(problem, 1e-3);
      if (chosen) rollout.Use(StepsFor(problem, x));
      auto gradient = Gradients::Of(rollout);
      const RolloutResult result = rollout.Run(x, gradient);
      ASSERT_TRUE(result.finite);
      ASSERT_GT(result.penetration_excess, -1);
      const auto outputs = [&](const std::vector<double>& y) { return OutputsOf(rollout.Run(y)); };
      for (Eigen::Index output = 0; output < gradient.rows(); ++output) {
        EXPECT_LT(OffDifferences(gradient, output, x, outputs), 1e-6)
            << "output " << output << (chosen ? ", chosen steps" : "")
            << (at_times ? ", with times" : "");
        // All limits but that of the shapes, which stay apart, depend on it.
        EXPECT_TRUE(gradient(output, gradient.cols() - 1) != 0 || output + 1 == gradient.rows());
      }
    }
  }
}

TEST(FreeDuration, ForwardSensitivitiesAndTheAdjointAgreeToRounding) {
  for (const bool at_times : {false, true}) {
    const Problem problem = Dropped(at_times);
    for (const double duration : {0.7, 1.0, 1.6}) {
      const std::vector<double> x = Motion(problem, 2, duration);
      for (const bool adaptive : {false, true}) {
        ForwardSensitivity forward(problem, adaptive ? AdaptiveSteps(problem) : StepSettings{});
        Rollout rollout(problem, StepSettings{}.step_s);
        auto ahead = Gradients::Of(forward), back = ahead, again = ahead;
        const RolloutResult expected = forward.Run(x, ahead);
        if (adaptive) rollout.Use(forward.grid());
        const RolloutResult result = rollout.Run(x, back);
        EXPECT_NEAR(result.cost, expected.cost, 1e-9 * std::abs(expected.cost));
        for (Eigen::Index row = 0; row + 1 < back.rows(); ++row)
          EXPECT_LT(Off(back.row(row), ahead.row(row)), 1e-7) << row << " " << duration;
        EXPECT_EQ(back.row(back.rows() - 1), ahead.row(back.rows() - 1));
        if (!adaptive) continue;
        EXPECT_NEAR(forward.RunAgain(x, again).cost, expected.cost, 1e-12);
        EXPECT_LT(Off(again.row(0), ahead.row(0)), 1e-9);
      }
    }
  }
}

TEST(FreeDuration, StepsThatAreKeptStretchWithItAndTheirDerivativesAreThoseOfDifferences) {
  for (const bool at_times : {false, true}) {
    const Problem problem = Dropped(at_times);
    const std::vector<double> x = Motion(problem, 4, 0.9);
    ForwardSensitivity forward(problem, AdaptiveSteps(problem));
    auto gradient = Gradients::Of(forward), ignored = gradient;
    forward.Run(x, ignored);
    std::vector<double> near = x;
    near.back() *= 1.004;
    GaussNewton model;
    const RolloutResult result = forward.RunAgain(near, gradient, &model);
    const auto outputs = [&](const std::vector<double>& y) {
      return OutputsOf(forward.RunAgain(y, ignored));
    };
    for (Eigen::Index output = 0; output + 1 < gradient.rows(); ++output)
      EXPECT_LT(OffDifferences(gradient, output, near, outputs), 1e-6) << output;
    for (std::size_t i = 0; i < result.residuals.size(); ++i) {
      const Gradients row = model.residual_slopes.row(static_cast<Eigen::Index>(i));
      const auto residual = [&](const std::vector<double>& y) {
        return std::vector<double>{forward.RunAgain(y, ignored).residuals[i]};
      };
      EXPECT_LT(OffDifferences(row, 0, near, residual), 1e-6) << "residual " << i;
    }
  }
}

/// The cost of a problem whose duration is fixed is another computation: its paths have other
/// knots, its steps are equal in number.
TEST(FreeDuration, AMotionIsThatOfTheProblemWithItsDuration) {
  const Problem problem = Dropped(true);
  const std::vector<double> x = Motion(problem, 4, 1.3);
  Problem fixed = problem;
  fixed.free_duration.reset();
  fixed.duration_s = 0.65;
  const std::vector<double> points(x.begin(), x.end() - 1);
  StepSettings fine = AdaptiveSteps(problem);
  fine.tolerance = 1e-10;
  ForwardSensitivity of_free(problem, fine), of_fixed(fixed, fine);
  auto free_gradient = Gradients::Of(of_free), fixed_gradient = Gradients::Of(of_fixed);
  const RolloutResult free_result = of_free.Run(x, free_gradient);
  const RolloutResult fixed_result = of_fixed.Run(points, fixed_gradient);
  EXPECT_NEAR(free_result.cost, fixed_result.cost, 1e-6 * fixed_result.cost);
  EXPECT_LT(Off(free_gradient.leftCols(free_gradient.cols() - 1).row(0), fixed_gradient.row(0)),
            1e-4);
  double last_s = 0;
  Rollout(problem, 1e-3).Visit(x, 0, [&](const MotionSample& sample) { last_s = sample.time_s; });
  EXPECT_NEAR(last_s, 0.65 + 0.06, 1e-9);
}

TEST(FreeDuration, TheClearanceOfOwnShapesCountsTheTimeThatTheyAreNear) {
  Problem problem = LoadTask(testing::SourcePath("tests/data/tasks/long_roll.toml")).problem;
  problem.free_duration = DurationBounds{0.5 * problem.duration_s, 2 * problem.duration_s};
  std::vector<double> x = CrossingRoll();
  x.push_back(1.2);
  ClearanceConstraint clearance(problem, 1e-3);
  std::vector<double> gradient(x.size());
  const double excess = clearance.Evaluate(x, gradient);
  ASSERT_GT(excess, -1);
  std::vector<double> slower = x, faster = x;
  slower.back() += 1e-5;
  faster.back() -= 1e-5;
  EXPECT_NEAR(gradient.back(), (clearance.Evaluate(slower) - clearance.Evaluate(faster)) / 2e-5,
              1e-8);
  EXPECT_GT(gradient.back(), 0);
}

TEST(FreeDuration, AMotionThatEndsBeforeItsCostLooksIsNone) {
  const Problem problem = Dropped(true);
  EXPECT_FALSE(Rollout(problem, 1e-3).Run(Motion(problem, 4, 0.4)).finite);
}

TEST(FreeDuration, LinearLimitsThatTakeThePlaceOfItsOwnAreNowhereWeaker) {
  Problem problem = Dropped(false);
  for (ActuatedJoint& joint : problem.joints) {  // so that some motions break them
    joint.limits.velocity_max_rad_s *= 0.2;
    joint.limits.acceleration_max_rad_s2 *= 0.2;
  }
  const std::vector<LinearRow> rows = DerivativeLimitRows(problem);
  std::mt19937_64 random(5);
  int tighter = 0, broken = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const std::vector<double> at = Motion(problem, seed, Uniform(random, 0.6, 1.8));
    const std::vector<double> x = Motion(problem, seed + 100, Uniform(random, 0.6, 1.8));
    for (const LinearRow& row : rows) {
      const LinearRow linear = row.LinearAt(at);
      // The same where it was made, and of the same sign elsewhere or stricter.
      const double scale = std::pow(at.back(), row.derivative);
      EXPECT_NEAR(linear.Excess(at), row.Excess(at) * scale, 1e-9 * (1 + std::abs(row.b)));
      if (linear.Excess(x) <= 0) {
        EXPECT_LE(row.Excess(x), 1e-12) << row.name;
      } else {
        ++(row.Excess(x) <= 0 ? tighter : broken);
      }
    }
  }
  EXPECT_GT(tighter, 0);
  EXPECT_GT(broken, 0);
}

TEST(FreeDuration, LimitsAreThoseOfTheSplineThatIsWritten) {
  const Problem problem = Dropped(false);
  for (const double duration : {0.7, 1.0, 1.6}) {
    const std::vector<double> x = Motion(problem, 3, duration);
    std::array<double, 3> largest{};
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const auto path = PositionSpline(problem, x, j);
      EXPECT_NEAR(path.end_s(), duration * problem.duration_s, 1e-12);
      const JointLimits<double>& limits = problem.joints[j].limits;
      const std::array<double, 3> limit = {1, limits.velocity_max_rad_s,
                                           limits.acceleration_max_rad_s2};
      for (int d = 1; d <= 2; ++d) {
        for (const double point : path.control_points(d)) {
          double& most = largest[static_cast<std::size_t>(d)];
          most = std::max(most, std::abs(point) / limit[static_cast<std::size_t>(d)] - 1);
        }
      }
    }
    std::array<double, 3> excess = {-1, -1, -1};
    for (const LinearRow& row : DerivativeLimitRows(problem)) {
      double& most = excess[static_cast<std::size_t>(row.derivative)];
      most = std::max(most, row.Excess(x));
    }
    for (const std::size_t d : {1U, 2U})
      EXPECT_NEAR(std::max(0.0, excess[d]), largest[d], 2e-6 * (1 + largest[d])) << d;
  }
}

/// A rod that hangs from a joint, is moved to and fro by 0.1 rad, and should take no effort. The
/// rod swings like that of itself, with a half period that follows from gravity alone; but its path
/// has no acceleration at its ends.
Problem Pendulum(int control_points) {
  Problem problem;
  problem.name = "pendulum";
  Dof<Plane> rod;
  rod.name = "rod";
  rod.prescribed = true;
  rod.axis = 1;
  rod.mass_kg = 0.8;
  rod.mass_centre = {0, -0.25};
  rod.inertia_kg_m2 = 0.01;
  problem.scene.robot.tree.dofs = {rod};
  problem.scene.robot.tree.gravity = {0, -9.81};
  ActuatedJoint joint;
  joint.control_points = control_points;
  joint.start_rad = -0.05;
  joint.end_rad = 0.05;
  joint.limits = {-1, 1, 100, 1000, 100};
  problem.joints = {joint};
  problem.start_q = {joint.start_rad};
  problem.duration_s = 0.9;
  problem.free_duration = DurationBounds{0.2, 1.6};
  problem.cost = {EffortTerm(1)};
  return problem;
}

/// The least effort of the pendulum in a given time, in which the torque is I qdd + m g l sin q, by
/// Newton's method on the path's free points and Simpson's rule.
double LeastEffort(const Problem& problem, double duration_s) {
  Problem fixed = problem;
  fixed.free_duration.reset();
  fixed.duration_s = duration_s;
  const double inertia = 0.01 + 0.8 * 0.25 * 0.25, weight = 0.8 * 9.81 * 0.25;
  const int n = fixed.parameter_count();
  std::vector<double> x(static_cast<std::size_t>(n), 0.0);
  constexpr int kSteps = 2000;
  double effort = 0;
  for (int iteration = 0; iteration < 8; ++iteration) {
    const auto path = PositionSpline(fixed, x, 0);
    Eigen::MatrixXd B = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
    effort = 0;
    for (int k = 0; k <= kSteps; ++k) {
      const double t = duration_s * k / kSteps;
      const double part = duration_s / kSteps / 3 * (k % kSteps == 0 ? 1 : 2 + 2 * (k % 2));
      const auto at = path.Evaluate(t);
      const auto w = path.EvaluateWeights(t);
      const double torque = inertia * at.second + weight * std::sin(at.value);
      Eigen::VectorXd slope = Eigen::VectorXd::Zero(n);
      for (int i = 0; i <= fixed.degree; ++i) {
        const int parameter = w.first + i - 3;
        if (parameter < 0 || parameter >= n) continue;
        const auto c = static_cast<std::size_t>(i);
        slope[parameter] = inertia * w.w[2][c] + weight * std::cos(at.value) * w.w[0][c];
      }
      effort += part * torque * torque;
      g += 2 * part * torque * slope;
      B += 2 * part * slope * slope.transpose();
    }
    const Eigen::VectorXd step = B.ldlt().solve(g);
    for (int i = 0; i < n; ++i) x[static_cast<std::size_t>(i)] -= step[i];
  }
  return effort;
}

TEST(FreeDuration, ThatOfAPendulumIsWhatGravityAndAnotherMethodSay) {
  for (const int points : {9, 20}) {
    Problem problem = Pendulum(points);
    problem.solver.tolerance = 1e-10;
    problem.solver.kkt_residual = 1e-6;
    std::vector<double> start;
    for (int i = 1; i <= points - 6; ++i) start.push_back(0.1 * i / (points - 5) - 0.05);
    start.push_back(1);
    NearRollouts rollouts(problem);
    const Solution solution = SolveNear(problem, start, {300, 0}, rollouts, {}, nullptr);
    EXPECT_EQ(solution.end, SolveEnd::kConverged);
    // The duration of the least effort by golden section.
    double low = 0.5, high = 1.5;
    constexpr double kGolden = 0.6180339887498949;
    while (high - low > 1e-6) {
      const double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
      (LeastEffort(problem, a) < LeastEffort(problem, b) ? high : low) =
          LeastEffort(problem, a) < LeastEffort(problem, b) ? b : a;
    }
    const double found_s = problem.duration_of(solution.x);
    EXPECT_NEAR(found_s, low, 1e-4 * low) << points;
    EXPECT_NEAR(solution.rollout.cost, LeastEffort(problem, low), 1e-5 * solution.rollout.cost);
    // The more points, the faster the path reaches the accelerations of a swing.
    const double swing_s =
        std::numbers::pi * std::sqrt((0.01 + 0.8 * 0.0625) / (0.8 * 9.81 * 0.25));
    EXPECT_GT(found_s, swing_s);
    EXPECT_LT(found_s, (points == 9 ? 1.6 : 1.2) * swing_s);
  }
}

TEST(FreeDuration, HasTheBoundsOfTheTaskForItsLimits) {
  Problem problem = Pendulum(9);
  problem.free_duration->max_s = 0.5;
  problem.duration_s = 0.4;
  NearRollouts rollouts(problem);
  const Solution solution =
      SolveNear(problem, std::vector<double>{-0.02, 0, 0.02, 1}, {300, 0}, rollouts, {}, nullptr);
  EXPECT_EQ(solution.end, SolveEnd::kConverged);
  EXPECT_NEAR(problem.duration_of(solution.x), 0.5, 1e-9);
  ASSERT_EQ(solution.kkt.multipliers.size(), 1U);
  EXPECT_EQ(solution.kkt.multipliers[0].name, "upper duration");
  // By so much does the effort fall when the motion may take longer.
  EXPECT_NEAR(solution.kkt.multipliers[0].value,
              0.4 * (LeastEffort(problem, 0.499) - LeastEffort(problem, 0.501)) / 0.002,
              1e-3 * solution.kkt.multipliers[0].value);
}

/// The nominal handstand is solved on, first with the duration free and then with given ones.
TEST(FreeDuration, NeighboursOfTheOneThatWasFoundAreNoBetterForAHandstand) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  Problem problem = TaskOf(file).problem;
  problem.free_duration = DurationBounds{0.5 * problem.duration_s, 2 * problem.duration_s};
  std::vector<double> x = GuessFrom(problem, file, "handstand.toml");
  const auto solve = [](const Problem& of, const std::vector<double>& from) {
    NearRollouts rollouts(of);
    return SolveNear(of, from, {400, 0}, rollouts, {}, nullptr);
  };
  Solution best = solve(problem, x);
  ASSERT_EQ(best.end, SolveEnd::kConverged);
  EXPECT_TRUE(best.feasible());
  EXPECT_LT(best.rollout.cost, 0.97 * best.start_cost);
  TakeFree(problem, best.x);
  best.x.pop_back();
  for (const double ratio : {0.98, 1.0, 1.02}) {
    Problem fixed = problem;
    fixed.free_duration.reset();
    fixed.duration_s *= ratio;
    const Solution other = solve(fixed, best.x);
    EXPECT_TRUE(other.feasible());
    EXPECT_GT(other.rollout.cost, (1 - 1e-4) * best.rollout.cost) << ratio;
    if (ratio == 1) {
      EXPECT_LT(other.rollout.cost, (1 + 1e-4) * best.rollout.cost);
    }
  }
}

TEST(FreeDuration, NoMotionThatTheSolverLooksAtBreaksALimitOfVelocityOrAcceleration) {
  Problem problem = Pendulum(9);
  problem.duration_s = 0.7;
  problem.joints[0].limits.velocity_max_rad_s = 0.25;
  problem.joints[0].limits.acceleration_max_rad_s2 = 1.4;
  const std::vector<LinearRow> rows = DerivativeLimitRows(problem);
  std::vector<Evaluation> history;
  NearRollouts rollouts(problem);
  const Solution solution =
      SolveNear(problem, std::vector<double>{-0.02, 0, 0.02, 1}, {300, 0}, rollouts, {}, &history);
  EXPECT_EQ(solution.end, SolveEnd::kConverged);
  ASSERT_GE(history.size(), 3U);
  for (const Evaluation& evaluation : history) EXPECT_LE(evaluation.violation, 1e-9);
  EXPECT_TRUE(std::ranges::any_of(rows, [&](const LinearRow& row) {
    return std::abs(row.Excess(solution.x)) < 1e-5;
  })) << "no limit holds it";
}

}  // namespace
}  // namespace tumbler
