#include "offline/solve/forward_sensitivity.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "offline/model/least_squares.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "tests/support/allocation_count.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"
#include "tests/support/primitive_file.h"
#include "tests/support/to_eigen.h"

namespace tumbler {
namespace {

constexpr StepSettings kFixed{};
constexpr StepSettings kAdaptive{StepSettings::Scheme::kAdaptive};

/// A problem with eleven parameters, and an impact of all four feet.
Problem ElevenParameters() {
  Problem problem = HandstandProblem();
  problem.joints[0].control_points = 11;
  problem.start_q[1] += 0.05;
  return problem;
}

struct Outcome {
  RolloutResult result;
  OutputGradients gradient;
};

Outcome Forward(const Problem& problem, const std::vector<double>& x, StepSettings settings) {
  ForwardSensitivity forward(problem, settings);
  Outcome out{{}, OutputGradients::Of(forward)};
  out.result = forward.Run(x, out.gradient);
  return out;
}

Outcome Adjoint(const Problem& problem, const std::vector<double>& x, double step_s) {
  Rollout rollout(problem, step_s);
  Outcome out{{}, OutputGradients::Of(rollout)};
  out.result = rollout.Run(x, out.gradient);
  return out;
}

/// The largest difference of two rows, divided by the largest component of the second.
double RowError(const Outcome& a, const Outcome& b, Eigen::Index row) {
  return (a.gradient.row(row) - b.gradient.row(row)).cwiseAbs().maxCoeff() /
         b.gradient.row(row).cwiseAbs().maxCoeff();
}

TEST(StepsFor, ARolloutWithThemRepeatsTheForwardSensitivitiesToRounding) {
  Problem problem = ElevenParameters();
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const std::vector<double> x = RandomMotion(problem, seed);
    const Outcome forward = Forward(problem, x, AdaptiveSteps(problem));
    Rollout rollout(problem, problem.solver.step_s);
    rollout.Use(StepsFor(problem, x));
    Outcome adjoint{{}, OutputGradients::Of(rollout)};
    adjoint.result = rollout.Run(x, adjoint.gradient);
    EXPECT_NEAR(adjoint.result.cost, forward.result.cost, 1e-9 * std::abs(forward.result.cost));
    EXPECT_LT(RowError(adjoint, forward, 0), 1e-7);
    for (std::size_t j = 0; j < 2; ++j)
      EXPECT_NEAR(adjoint.result.torque_excess[j], forward.result.torque_excess[j], 1e-9);
  }
}

/// The parameters of a nominal primitive, and its problem.
std::pair<Problem, std::vector<double>> Nominal(const std::string& name) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/" + name + ".toml"));
  return {TaskOf(file).problem, testing::FreeControlPoints(file.primitive)};
}

TEST(StepsFor, GiveTheGradientOfTheDifferentialEquationsWhereLandingsMisleadAFixedStep) {
  for (const char* const name : {"handstand", "downstand", "roll"}) {
    auto [problem, x] = Nominal(name);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += i % 2 == 0 ? 1e-3 : -1e-3;
    const Outcome reference = Forward(problem, x, kAdaptive);
    const Outcome chosen = Forward(problem, x, AdaptiveSteps(problem));
    EXPECT_LT(RowError(chosen, reference, 0), 1e-4) << name;
    // Also with the tolerance that a task has which says nothing of it.
    problem.solver.tolerance = SolverSettings().tolerance;
    EXPECT_LT(RowError(Forward(problem, x, AdaptiveSteps(problem)), reference, 0), 1e-2) << name;
    const StepGrid grid = StepsFor(problem, x);
    // The classical method evaluates four times a millisecond.
    EXPECT_LT(6 * (grid.motion.size() + grid.settling.size()),
              4 * (problem.duration_s + problem.settle_s) / problem.solver.step_s)
        << name;
  }
}

/// Maxima over the starts of steps would move by up to 3e-3, whatever the tolerance.
TEST(StepsFor, HardlyMoveTheSmoothMaximaOfAMotion) {
  for (const char* const name : {"handstand", "downstand", "roll"}) {
    const auto [problem, x] = Nominal(name);
    const Outcome reference = Forward(problem, x, kAdaptive);
    struct Case {
      double tolerance, most;
    };
    for (const Case& steps : {Case{1e-6, 5e-4}, Case{1e-8, 1e-5}}) {
      const Outcome chosen = Forward(
          problem, x, {StepSettings::Scheme::kAdaptive, kLongestAdaptiveStep_s, steps.tolerance});
      for (std::size_t j = 0; j < problem.joints.size(); ++j) {
        EXPECT_NEAR(chosen.result.torque_excess[j], reference.result.torque_excess[j], steps.most)
            << name << " " << steps.tolerance << " " << j;
      }
      EXPECT_NEAR(chosen.result.penetration_excess, reference.result.penetration_excess, steps.most)
          << name << " " << steps.tolerance;
    }
  }
}

TEST(ForwardSensitivity, HasThePapersSevenStateAndSeventySevenGradientEquations) {
  const ForwardSensitivity forward(ElevenParameters(), kFixed);
  EXPECT_EQ(forward.parameter_count(), 11);
  EXPECT_EQ(forward.state_equations(), 7);
  EXPECT_EQ(forward.gradient_equations(), 77);
  const ForwardSensitivity sixty(HandstandProblem(36), kAdaptive);
  EXPECT_EQ(sixty.state_equations(), 7);
  EXPECT_EQ(sixty.gradient_equations(), 7 * 60);
}

/// Every task of the source tree.
std::vector<std::string> Tasks() {
  std::vector<std::string> files;
  const std::filesystem::path folder =
      std::filesystem::path(testing::SourcePath("primitives/tasks"));
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".toml") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

class EveryTask : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(ForwardSensitivity, EveryTask, ::testing::ValuesIn(Tasks()),
                         [](const auto& task) {
                           std::string name;
                           const auto tasks =
                               std::filesystem::path(testing::SourcePath("primitives/tasks"));
                           for (const char c : std::filesystem::path(task.param)
                                                   .lexically_relative(tasks)
                                                   .replace_extension()
                                                   .string()) {
                             if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
                           }
                           return name;
                         });

TEST_P(EveryTask, AgreesWithTheAdjointThroughItsContacts) {
  Problem problem = LoadTask(GetParam()).problem;
  for (const std::uint64_t seed : {1U, 2U}) {
    const std::vector<double> x = RandomMotion(problem, seed, 0.8);
    const Outcome forward = Forward(problem, x, kFixed);
    // This is the adjoint, whatever the task asks for.
    problem.solver.gradient = SolverSettings::Gradient::kAdjoint;
    const Outcome adjoint = Adjoint(problem, x, kFixed.step_s);
    ASSERT_TRUE(adjoint.result.finite);
    EXPECT_TRUE(problem.scene.obstacles.empty() || adjoint.result.any_contact);
    EXPECT_NEAR(forward.result.cost, adjoint.result.cost,
                1e-10 * std::max(1.0, std::abs(adjoint.result.cost)));
    EXPECT_NEAR(forward.result.peak_penetration_m, adjoint.result.peak_penetration_m, 1e-12);
    // The two are equal except for rounding, which impacts amplify: to 3e-10 over two seconds and a
    // bump, to 1e-8 where a falling lamp grazes the ground. A motion that is the same except for
    // rounding shows how much they amplify it.
    std::vector<double> rounded = x;
    for (double& value : rounded) value += 1e-15;
    const Outcome other = Adjoint(problem, rounded, kFixed.step_s);
    const auto expect_equal = [&](Eigen::Index row) {
      const double rounding = RowError(other, adjoint, row);
      EXPECT_LT(rounding, 1e-7);
      EXPECT_LT(RowError(forward, adjoint, row), 1e-9 + 10 * rounding) << "row " << row;
    };
    expect_equal(0);
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      EXPECT_NEAR(forward.result.torque_excess[j], adjoint.result.torque_excess[j], 1e-9);
      if (!std::isfinite(problem.joints[j].limits.torque_max_nm)) continue;
      expect_equal(static_cast<Eigen::Index>(1 + j));
    }
    EXPECT_NEAR(forward.result.penetration_excess, adjoint.result.penetration_excess, 1e-9);
    if (adjoint.result.penetration_excess > -1)
      expect_equal(static_cast<Eigen::Index>(1 + problem.joints.size()));
  }
}

TEST(ForwardSensitivity, AgreesWithTheAdjointThroughImpactsForUnevenJoints) {
  const Problem problem = ElevenParameters();
  for (const std::uint64_t seed : {3U, 4U, 5U}) {
    for (const double step_s : {2e-3, 0.7e-3}) {
      const std::vector<double> x = RandomMotion(problem, seed);
      const Outcome forward = Forward(problem, x, {StepSettings::Scheme::kFixed, step_s});
      const Outcome adjoint = Adjoint(problem, x, step_s);
      for (Eigen::Index row = 0; row < 3; ++row)
        EXPECT_LT(RowError(forward, adjoint, row), 1e-10) << "seed " << seed << " row " << row;
    }
  }
}

/// The gradient by central differences of the cost that `Forward` computes.
Eigen::RowVectorXd Differences(const Problem& problem, std::vector<double> x, double h,
                               StepSettings settings) {
  Eigen::RowVectorXd out(static_cast<Eigen::Index>(x.size()));
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double middle = x[k];
    x[k] = middle + h;
    const double above = Forward(problem, x, settings).result.cost;
    x[k] = middle - h;
    out[static_cast<Eigen::Index>(k)] =
        (above - Forward(problem, x, settings).result.cost) / (2 * h);
    x[k] = middle;
  }
  return out;
}

TEST(ForwardSensitivity, BothSchemesAgreeWithCentralDifferencesOfThemselves) {
  const Problem problem = ElevenParameters();
  const std::vector<double> x = RandomMotion(problem, 6);
  for (const StepSettings& settings : {kFixed, kAdaptive}) {
    const Outcome forward = Forward(problem, x, settings);
    double best = 1;
    for (const double h : {1e-5, 1e-6}) {
      const double error =
          (forward.gradient.row(0) - Differences(problem, x, h, settings)).cwiseAbs().maxCoeff() /
          forward.gradient.row(0).cwiseAbs().maxCoeff();
      best = std::min(best, error);
    }
    EXPECT_LT(best, 1e-6) << (settings.scheme == kFixed.scheme ? "fixed" : "adaptive");
  }
}

TEST(ForwardSensitivity, RunsAgainWithTheStepsThatItChose) {
  const Problem problem = ElevenParameters();
  const std::vector<double> x = RandomMotion(problem, 6);
  ForwardSensitivity forward(problem, kAdaptive);
  OutputGradients gradient = OutputGradients::Of(forward), again = gradient;
  const RolloutResult result = forward.Run(x, gradient);
  const RolloutResult repeated = forward.RunAgain(x, again);
  EXPECT_EQ(result.cost, repeated.cost);
  EXPECT_TRUE(gradient == again);

  // Beside x, cost and constraints are smooth functions, though other steps would be chosen there.
  std::vector<double> beside = x;
  beside[3] += 0.004;
  forward.RunAgain(beside, again);
  double largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    constexpr double kStep = 1e-6;
    double cost[2] = {};
    for (int k = 0; k < 2; ++k) {
      std::vector<double> moved = beside;
      moved[i] += k == 0 ? -kStep : kStep;
      cost[k] = forward.RunAgain(moved, gradient).cost;
    }
    const double difference = (cost[1] - cost[0]) / (2 * kStep);
    largest = std::max(largest, std::abs(difference - again(0, static_cast<Eigen::Index>(i))));
  }
  EXPECT_LT(largest / again.row(0).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(ForwardSensitivity, HasNoStepsToRunAgainWithBeforeItRan) {
  const Problem problem = ElevenParameters();
  ForwardSensitivity forward(problem, kAdaptive);
  OutputGradients gradient = OutputGradients::Of(forward);
  EXPECT_THROW(forward.RunAgain(RandomMotion(problem, 6), gradient), std::logic_error);
}

TEST(ForwardSensitivity, FixedStepsConvergeToTheAdaptiveReference) {
  const Problem problem = ElevenParameters();
  const std::vector<double> x = RandomMotion(problem, 7);
  const Outcome reference = Forward(problem, x, kAdaptive);
  const StepSettings finer{StepSettings::Scheme::kAdaptive, 0.3e-3, 1e-12};
  EXPECT_LT(RowError(Forward(problem, x, finer), reference, 0), 1e-6);
  double before = 1;
  for (const double step_s : {1e-3, 0.25e-3, 0.0625e-3}) {
    const double error =
        RowError(Forward(problem, x, {StepSettings::Scheme::kFixed, step_s}), reference, 0);
    EXPECT_LT(error, before / 3) << step_s;
    before = error;
  }
  EXPECT_LT(before, 3e-4);
}

TEST(ForwardSensitivity, InFreeFallTheMassCentreFallsAndItsGradientVanishes) {
  Problem problem = HandstandProblem();
  problem.joints[0].control_points = 11;
  problem.scene.obstacles.clear();
  problem.settle_s = 0;
  problem.joints[0].end_rad = 0.9;
  const std::vector<double> x = RandomMotion(problem, 8);
  // The mass centre in the root's frame, for these angles of the legs, from the tree.
  const auto centre = [&](double leg1, double leg2) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double mass = 0;
    for (const Dof<Plane>& dof : problem.scene.robot.tree.dofs) {
      if (dof.massless) continue;
      const bool is_leg = dof.prescribed;
      const double angle = dof.name == "leg1" ? leg1 : leg2;
      const Eigen::Vector2d at =
          is_leg ? Eigen::Vector2d(ToEigen(dof.offset) +
                                   Eigen::Rotation2Dd(angle) * ToEigen(dof.mass_centre))
                 : ToEigen(dof.mass_centre);
      sum += dof.mass_kg * at;
      mass += dof.mass_kg;
    }
    return Eigen::Vector2d(sum / mass);
  };
  const auto linear = [&](int dof, StepSettings settings) {
    problem.cost = {LinearTerm(CostTerm::When::kEnd, dof, false, 1)};
    return Forward(problem, x, settings);
  };
  for (const StepSettings& settings : {kFixed, kAdaptive}) {
    const Outcome horizontal = linear(0, settings), vertical = linear(1, settings),
                  pitch = linear(2, settings);
    const Eigen::Rotation2Dd turn(pitch.result.cost);
    const Eigen::Vector2d at_end = centre(problem.joints[0].end_rad, problem.joints[1].end_rad);
    const Eigen::Vector2d at_start =
        centre(problem.joints[0].start_rad, problem.joints[1].start_rad);
    const Eigen::Vector2d offset = turn * at_end;
    EXPECT_NEAR(horizontal.result.cost + offset.x(), at_start.x(), 1e-9);
    EXPECT_NEAR(vertical.result.cost + offset.y(),
                problem.start_q[1] + at_start.y() - 0.5 * 9.81 * 1.2 * 1.2, 1e-9);
    // d(x, z)/dp = -d(turn) at_end is perpendicular to the offset.
    EXPECT_GT(pitch.gradient.row(0).cwiseAbs().maxCoeff(), 0.01) << "a turn that depends on x";
    EXPECT_LT((horizontal.gradient - offset.y() * pitch.gradient).row(0).cwiseAbs().maxCoeff(),
              1e-9);
    EXPECT_LT((vertical.gradient + offset.x() * pitch.gradient).row(0).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(ForwardSensitivity, EveryKindOfTermHasTheAdjointsIntegralAndGradient) {
  Problem problem = ElevenParameters();
  problem.duration_s = 0.5;  // It ends in motion: at rest, the integral of a rate has no gradient.
  problem.settle_s = 0.03;
  const std::vector<double> x = RandomMotion(problem, 3);
  for (std::size_t k = 0; k < CostTerm::kKindNames.size(); ++k) {
    for (const bool of_velocity : {false, true}) {
      constexpr int kPitch = 2;
      problem.cost = {{static_cast<CostTerm::Kind>(k), CostTerm::When::kThroughout, 0.5, kPitch,
                       of_velocity, 0.3}};
      problem.cost[0].joint_dofs = {3, 4};
      const Outcome forward = Forward(problem, x, kFixed);
      const Outcome adjoint = Adjoint(problem, x, problem.solver.step_s);
      EXPECT_NEAR(forward.result.cost, adjoint.result.cost, 1e-9 * std::abs(adjoint.result.cost))
          << CostTerm::kKindNames[k];
      EXPECT_LT(RowError(forward, adjoint, 0), 1e-7) << CostTerm::kKindNames[k];
    }
  }
}

TEST(ForwardSensitivity, TheRunningCostOfASlidingMassIsItsIntegral) {
  // Without gravity's pull tau = m qdd, so the running cost is w m^2 integral qdd^2, a quadratic
  // form.
  Problem problem;
  problem.name = "slide";
  Dof<Plane> slide;
  slide.name = "slide";
  slide.kind = JointKind::kPrismatic;
  slide.prescribed = true;
  slide.direction = {1, 0};
  slide.mass_kg = 1.5;
  problem.scene.robot.tree.dofs = {slide};
  problem.scene.robot.tree.gravity = {0, -9.81};
  ActuatedJoint joint;
  joint.control_points = 10;
  joint.end_rad = 0.4;
  problem.joints = {joint};
  problem.start_q = {0};
  problem.duration_s = 0.8;
  problem.cost = {EffortTerm(0.7)};
  const std::vector<double> x = {0.3, -0.2, 0.5, 0.1};
  const Outcome forward = Forward(problem, x, {StepSettings::Scheme::kAdaptive, 0.1, 1e-13});
  // Gauss-Legendre with four points is exact for qdd^2, whose degree is six on each of five
  // segments.
  const double r = std::sqrt(6.0 / 5), s30 = std::sqrt(30.0);
  const std::array<double, 4> node = {-std::sqrt((3 + 2 * r) / 7), -std::sqrt((3 - 2 * r) / 7),
                                      std::sqrt((3 - 2 * r) / 7), std::sqrt((3 + 2 * r) / 7)};
  const std::array<double, 4> weight = {(18 - s30) / 36, (18 + s30) / 36, (18 + s30) / 36,
                                        (18 - s30) / 36};
  const auto spline = PositionSpline(problem, x, 0);
  double cost = 0;
  std::array<double, 4> gradient{};
  const double factor = problem.cost[0].weight * slide.mass_kg * slide.mass_kg;
  const double half = 0.5 * problem.duration_s / 5;
  for (int segment = 0; segment < 5; ++segment) {
    for (std::size_t i = 0; i < 4; ++i) {
      const double t = half * (2 * segment + 1 + node[i]);
      const double qdd = spline.Evaluate(t).second;
      cost += factor * half * weight[i] * qdd * qdd;
      const auto w = spline.EvaluateWeights(t);
      for (int k = 0; k <= problem.degree; ++k) {
        const int parameter = w.first + k - 3;
        if (parameter < 0 || parameter >= 4) continue;
        gradient[static_cast<std::size_t>(parameter)] +=
            2 * factor * half * weight[i] * qdd * w.w[2][static_cast<std::size_t>(k)];
      }
    }
  }
  EXPECT_NEAR(forward.result.cost, cost, 1e-9 * cost);
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_NEAR(forward.gradient(0, static_cast<Eigen::Index>(k)), gradient[k], 1e-9 * cost);
}

TEST(ForwardSensitivity, TheSensitivitiesShortenTheStepsOfTheSameMotion) {
  // One polynomial for each joint has no parameters; the same path on more knots has twelve. A norm
  // of the states alone would take the same steps for both.
  Problem plain = HandstandProblem(6);
  plain.start_q[1] += 0.05;
  Problem problem = HandstandProblem(12);
  problem.start_q = plain.start_q;
  std::vector<double> x(12);
  for (std::size_t j = 0; j < 2; ++j) {
    const auto path = PositionSpline(plain, {}, j);
    const auto shape = PositionSpline(problem, x, j);
    Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(12, 12);
    Eigen::VectorXd value(12);
    for (Eigen::Index i = 0; i < 12; ++i) {
      const double t = problem.duration_s * (static_cast<double>(i) + 0.5) / 12;
      const auto w = shape.EvaluateWeights(t);
      for (int k = 0; k <= 5; ++k) basis(i, w.first + k) = w.w[0][static_cast<std::size_t>(k)];
      value[i] = path.Evaluate(t).value;
    }
    const Eigen::VectorXd points = SolveLeastSquares(basis, value);
    for (std::size_t i = 0; i < 6; ++i) x[6 * j + i] = points[static_cast<Eigen::Index>(i + 3)];
  }
  StepSettings settings = kAdaptive;
  settings.tolerance = 1e-7;
  settings.step_s = 0.02;
  ForwardSensitivity states(plain, settings), both(problem, settings);
  OutputGradients none(states.output_count(), 0), gradient(both.output_count(), 12);
  const double cost = states.Run({}, none).cost;
  EXPECT_NEAR(both.Run(x, gradient).cost, cost, 1e-4 * std::abs(cost)) << "not the same motion";
  EXPECT_GT(both.statistics().steps, states.statistics().steps * 5 / 4);
  EXPECT_EQ(both.statistics().forced, 0);
  EXPECT_LT(RowError({{}, gradient}, Forward(problem, x, kAdaptive), 0), 1e-3);
}

TEST(ForwardSensitivity, ABrokenStartEndsWithoutAGradient) {
  const Problem problem = ElevenParameters();
  std::vector<double> x = RandomMotion(problem, 10);
  for (const double bad : {1e6, std::numeric_limits<double>::quiet_NaN()}) {
    x[4] = bad;
    const Outcome out = Forward(problem, x, kFixed);
    EXPECT_FALSE(out.result.finite);
    EXPECT_EQ(out.result.cost, std::numeric_limits<double>::infinity());
    EXPECT_TRUE((out.gradient.array() == 0).all());
  }
}

TEST(ForwardSensitivity, AllocatesNoMoreForManyStepsThanForFew) {
  const Problem problem = ElevenParameters();
  const std::vector<double> x = RandomMotion(problem, 11);
  OutputGradients gradient(ForwardSensitivity(problem, kAdaptive).output_count(), 11);
  std::vector<std::size_t> taken;
  for (const StepSettings& settings :
       {StepSettings{StepSettings::Scheme::kFixed, 2e-3}, kFixed, kAdaptive}) {
    ForwardSensitivity forward(problem, settings);
    const std::size_t before = testing::AllocationCount();
    forward.Run(x, gradient);
    taken.push_back(testing::AllocationCount() - before);
    EXPECT_GT(forward.statistics().steps, 600);
  }
  EXPECT_GT(taken[0], 0U) << "the results' vectors are seen";
  EXPECT_LT(taken[0], 50U);
  EXPECT_EQ(taken[1], taken[0]);
  EXPECT_EQ(taken[2], taken[0]);
}

}  // namespace
}  // namespace tumbler
