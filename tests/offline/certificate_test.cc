// Compares the certificate in a primitive file with independent computations.

#include "offline/certify/certificate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_limits.h"
#include "common/files/primitive_rounding.h"
#include "common/files/primitive_toml.h"
#include "common/files/spline_extent.h"
#include "tests/support/motion_cost.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::QuickTask;
using testing::Replaced;
using testing::ShippedRobot;

/// The quick task, solved once for all tests.
struct Solved {
  Task task = ParseTask(QuickTask(), "task.toml", ShippedRobot(), "robot.urdf");
  SolveOutcome outcome = Solve(task.problem, {});
  const Solution& best = outcome.solutions.front();
  PrimitiveFile file = MakePrimitiveFile(task, outcome, best);
};
const Solved& TheSolution() {
  static const Solved solved;
  return solved;
}

/// The costs of points, one after the other.
template <class Cost>
CostsOf EachBy(Cost cost) {
  return [cost](std::span<const std::vector<double>> points) {
    std::vector<double> costs;
    for (const std::vector<double>& x : points) costs.push_back(cost(x));
    return costs;
  };
}

TEST(Certificate, OfAMotionWhoseGradientIsNoNumberCanBeWritten) {
  const Solved& s = TheSolution();
  Solution best = s.best;
  best.kkt.absolute = std::numeric_limits<double>::quiet_NaN();
  const PrimitiveFile file = MakePrimitiveFile(s.task, s.outcome, best);
  EXPECT_EQ(file.certificate.projected_gradient, 1e9);
  EXPECT_NO_THROW(ParsePrimitive(ToToml(file), "written"));
}

TEST(DifferentiateBeside, FindsTheRolloutsGradientRightAtEveryStep) {
  const Solved& s = TheSolution();
  const GradientCheck check = DifferentiateBeside(s.task.problem, s.best.x).check;
  for (const double error : check.errors) EXPECT_LT(error, 1e-3);
  // What is left is the differences' own: curvature of contact at the longest step, rounding at the
  // shortest.
  EXPECT_LT(check.relative_error(), 3e-5);
}

TEST(DifferentiateBeside, AgreesWithDifferencesOfOneRolloutAfterTheOther) {
  const Solved& s = TheSolution();
  const GradientBeside beside = DifferentiateBeside(s.task.problem, s.best.x);
  Rollout rollout(s.task.problem, s.task.problem.solver.step_s);
  rollout.Use(beside.grid.value());
  const auto cost = [&rollout](const std::vector<double>& x) { return rollout.Run(x).cost; };
  const GradientCheck other = CompareGradient(EachBy(cost), beside.at, beside.gradient);
  // They differ by rounding, which impacts amplify and the differences divide by their step.
  for (std::size_t i = 0; i < other.errors.size(); ++i)
    EXPECT_NEAR(beside.check.errors[i], other.errors[i], 1e-10 / GradientCheck::kSteps[i]) << i;
}

TEST(CompareGradient, SeesAWrongGradient) {
  // The function is sin(x) y^2. Its gradient is given rightly, with an error of 1 % in one
  // component, and with a wrong sign.
  const std::vector<double> at = {0.3, 2.0};
  const auto f = [](const std::vector<double>& x) { return std::sin(x[0]) * x[1] * x[1]; };
  const std::vector<double> right = {std::cos(0.3) * 4, 2 * std::sin(0.3) * 2};
  EXPECT_LT(CompareGradient(EachBy(f), at, right).relative_error(), 1e-8);
  EXPECT_NEAR(CompareGradient(EachBy(f), at, {1.01 * right[0], right[1]}).relative_error(), 0.01,
              2e-4);
  EXPECT_NEAR(CompareGradient(EachBy(f), at, {-right[0], right[1]}).relative_error(), 2, 1e-6);
  EXPECT_NEAR(CompareGradient(EachBy(f), at, {0, 0}).relative_error(), 1, 1e-6);
}

TEST(CompareGradient, SeesOneWrongComponentAmongManyAtItsFullSize) {
  const std::size_t n = 30;
  const auto f = [](const std::vector<double>& x) {
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += static_cast<double>(i + 1) * std::sin(x[i]);
    return sum;
  };
  const std::vector<double> at(n, 0.1);
  std::vector<double> gradient;
  for (std::size_t i = 0; i < n; ++i)
    gradient.push_back(static_cast<double>(i + 1) * std::cos(0.1));
  EXPECT_LT(CompareGradient(EachBy(f), at, gradient).relative_error(), 1e-7);
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<double> wrong = gradient;
    wrong[i] += 0.01 * gradient.back();
    EXPECT_NEAR(CompareGradient(EachBy(f), at, wrong).relative_error(), 0.01, 2e-4) << i;
  }
  EXPECT_GT(CompareGradient(EachBy(f), at, std::vector<double>(n)).relative_error(), 0.3);
}

TEST(CompareGradient, SaysForEachStepHowFarItIsOff) {
  // The central difference of x^3 at 1 is 3 + h^2. For small steps h^2 is below rounding.
  const auto cube = [](const std::vector<double>& x) { return x[0] * x[0] * x[0]; };
  const GradientCheck check = CompareGradient(EachBy(cube), {1.0}, {3.3});
  for (const double error : check.errors) EXPECT_NEAR(error, 0.3 / 3.3, 1e-6);
  // The cost jumps where only the largest difference step reaches.
  const auto cliff = [](const std::vector<double>& x) { return x[0] + (x[0] > 1.000005 ? 1 : 0); };
  const GradientCheck near = CompareGradient(EachBy(cliff), {1.0}, {1.0});
  EXPECT_GT(near.errors[0], 0.9);
  EXPECT_LT(near.errors[1], 1e-6);
  EXPECT_LT(near.errors[2], 1e-6);
  EXPECT_EQ(near.relative_error(), std::min(near.errors[1], near.errors[2]));
}

TEST(GradientStepHalvingChange, IsTheDifferenceOfTwoGradientsAndSmallerForASmallerTolerance) {
  const Solved& s = TheSolution();
  Problem finer = s.task.problem;
  finer.solver.tolerance /= 1000;
  const auto change_of = [&s](const Problem& problem) {
    return GradientStepHalvingChange(problem, DifferentiateBeside(problem, s.best.x));
  };
  const double change = change_of(s.task.problem);
  EXPECT_GT(change, 0);
  EXPECT_LT(change, 0.1);
  EXPECT_LT(change_of(finer), 0.5 * change);
  EXPECT_EQ(s.file.certificate.gradient_step_halving_change, change);
}

TEST(CompareGradient, IsNotFooledByACostThatIsNotFinite) {
  const auto wall = [](const std::vector<double>& x) {
    return x[0] == 1.0 ? 3.0 : std::numeric_limits<double>::infinity();
  };
  EXPECT_EQ(CompareGradient(EachBy(wall), {1.0}, {0.0}).relative_error(),
            std::numeric_limits<double>::infinity());
}

TEST(CompareGradient, OfAConstantIsZero) {
  EXPECT_EQ(CompareGradient(EachBy([](const std::vector<double>&) { return 3.0; }), {1.0}, {0.0})
                .relative_error(),
            0);
}

TEST(MakePrimitiveFile, WritesWhatLoadsAgainBitForBit) {
  const PrimitiveFile& file = TheSolution().file;
  const std::string text = ToToml(file);
  EXPECT_EQ(ToToml(ParsePrimitive(text, "motion.toml")), text);
}

TEST(MakePrimitiveFile, WritesWhatLoadsAgainForAnyNumberOfControlPoints) {
  // At the ends, a sum over basis functions rounds by an amount that depends on the knots.
  for (int points = 7; points <= 20; ++points) {
    Task task = TheSolution().task;
    Solution straight;
    for (ActuatedJoint& joint : task.problem.joints) {
      joint.control_points = points++;
      for (int i = 1; i <= joint.free_points(); ++i) {
        const double s = static_cast<double>(i) / (joint.free_points() + 1);
        straight.x.push_back(joint.start_rad + s * (joint.end_rad - joint.start_rad));
      }
    }
    straight.rollout = Rollout(task.problem, 1e-3).Run(straight.x);
    const std::string text = ToToml(MakePrimitiveFile(task, {}, straight));
    EXPECT_EQ(ToToml(ParsePrimitive(text, "motion.toml")), text) << points;
  }
}

TEST(MakePrimitiveFile, CarriesTheTextsThatItWasMadeFrom) {
  const Solved& s = TheSolution();
  EXPECT_EQ(s.file.provenance.task_toml, QuickTask());
  EXPECT_EQ(s.file.provenance.robot_urdf, ShippedRobot());
  EXPECT_EQ(s.file.provenance.task_hash, HashOfText(QuickTask()));
  // They also make the same problem, since the same parameters have the same cost.
  const Provenance& from = s.file.provenance;
  const Problem again =
      ParseTask(from.task_toml, from.task_file, from.robot_urdf, from.robot_file).problem;
  EXPECT_EQ(testing::CostOf(again, s.best.x), s.file.provenance.objective);
}

TEST(MakePrimitiveFile, MarginsAreThoseOfTheCoefficients) {
  const PrimitiveFile& file = TheSolution().file;
  const LimitMargins margins = MarginsOf(file.primitive);
  EXPECT_EQ(file.certificate.position_margin_rad, margins.position_rad);
  EXPECT_EQ(file.certificate.velocity_margin_rad_s, margins.velocity_rad_s);
  EXPECT_EQ(file.certificate.acceleration_margin_rad_s2, margins.acceleration_rad_s2);
  EXPECT_GE(margins.position_rad, 0);
  EXPECT_GE(margins.velocity_rad_s, 0);
  EXPECT_GE(margins.acceleration_rad_s2, 0);
  EXPECT_GE(margins.torque_nm, 0);
}

TEST(MakePrimitiveFile, RefutesASolutionThatClaimsToKeepItsLimitsAndDoesNot) {
  const Solved& s = TheSolution();
  EXPECT_EQ(s.file.certificate.constraint_violation, 0);
  const auto certified = [&s](const std::function<void(Problem&, Solution&)>& mutate) {
    Task task = s.task;
    Solution lie = s.best;  // It claims to be converged and without violation.
    lie.end = SolveEnd::kConverged;
    lie.constraint_violation = 0;
    mutate(task.problem, lie);
    return MakePrimitiveFile(task, s.outcome, lie).certificate.constraint_violation;
  };
  const double highest = ExtentOf(s.file.primitive.joints[0].position, 0).max;
  EXPECT_NEAR(certified([&](Problem& p, Solution&) {
                p.joints[0].limits.position_max_rad = highest - 0.05;
              }),
              0.05, 1e-9)
      << "position";
  // With a limit of half the largest value, the excess is 1 times the limit.
  double velocity = 0, acceleration = 0, torque = 0;
  for (double t = 0; t <= s.task.problem.duration_s; t += 1e-3) {
    const auto sample = s.file.primitive.joints[0].position.Evaluate(t);
    velocity = std::max(velocity, std::abs(sample.first));
    acceleration = std::max(acceleration, std::abs(sample.second));
  }
  Rollout rollout(s.task.problem, s.task.problem.solver.step_s / kRefinement);
  rollout.Visit(s.best.x, 0, [&](const MotionSample& sample) {
    torque = std::max(torque, std::abs(sample.torque[0]));
  });
  EXPECT_GE(certified([&](Problem& p, Solution&) {
              p.joints[0].limits.velocity_max_rad_s = velocity / 2;
            }),
            0.99);
  EXPECT_GE(certified([&](Problem& p, Solution&) {
              p.joints[0].limits.acceleration_max_rad_s2 = acceleration / 2;
            }),
            0.99);
  EXPECT_NEAR(
      certified([&](Problem& p, Solution&) { p.joints[0].limits.torque_max_nm = torque / 2; }), 1,
      1e-6);
  EXPECT_GT(certified([](Problem& p, Solution&) {
              p.scene.contact.d_on_m *= 0.5;  // The motion goes through so thin a layer.
              p.scene.contact.d_off_m *= 0.5;
              p.scene.contact.stiffness_n_per_m *= 0.02;
            }),
            0.01)
      << "penetration";
}

TEST(MakePrimitiveFile, IsAccurateEnoughForTheRuntimesFloats) {
  EXPECT_NO_THROW(ToRuntime(TheSolution().file.primitive));
}

TEST(MakePrimitiveFile, FeedForwardFollowsThePlansTorqueWithinTheLimit) {
  const Solved& s = TheSolution();
  const Problem& problem = s.task.problem;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const auto& spline = s.file.primitive.joints[j].torque;
    double square = 0, peak = 0;
    int count = 0;
    Rollout rollout(problem, problem.solver.step_s);
    rollout.Visit(s.best.x, 0, [&](const MotionSample& sample) {
      if (sample.time_s > problem.duration_s) return;
      const double torque = spline.Evaluate(sample.time_s).value;
      EXPECT_LE(std::abs(torque), problem.joints[j].limits.torque_max_nm);
      square += std::pow(torque - sample.torque[j], 2);
      peak = std::max(peak, std::abs(sample.torque[j]));
      ++count;
    });
    ASSERT_GT(count, 400);
    EXPECT_GT(peak, 0.2) << "a plan without torque tests nothing";
    EXPECT_LT(std::sqrt(square / count), 0.1 * peak);
  }
}

TEST(MakePrimitiveFile, HoldsThePlansTorqueAtRestWhereTheTaskSaysSoAndChangesNothingElse) {
  const Solved& s = TheSolution();
  Task task = s.task;
  task.problem.held_torque = HeldTorque::kRest;
  const PrimitiveFile file = MakePrimitiveFile(task, s.outcome, s.best);
  std::vector<double> rest;
  Rollout rollout(task.problem, task.problem.solver.step_s / kRefinement);
  rollout.Visit(s.best.x, 0, [&](const MotionSample& sample) {
    rest.assign(sample.torque.begin(), sample.torque.end());
  });
  for (std::size_t j = 0; j < rest.size(); ++j) {
    const auto points = file.primitive.joints[j].torque.control_points();
    const auto fitted = s.file.primitive.joints[j].torque.control_points();
    EXPECT_EQ(points.back(), rest[j]);
    EXPECT_NE(fitted.back(), rest[j]);
    EXPECT_TRUE(std::equal(points.begin(), points.end() - 1, fitted.begin()));
  }
  EXPECT_EQ(file.exit.root_pitch_rad, s.file.exit.root_pitch_rad);
}

TEST(MakePrimitiveFile, PlaysThePathOfTheParameters) {
  const Solved& s = TheSolution();
  const Problem& problem = s.task.problem;
  Rollout rollout(problem, problem.solver.step_s / kRefinement);
  bool first = true;
  double worst = 0;
  PrimitivePose entry, exit;
  const auto look = [&](const MotionSample& sample) {
    const PrimitivePose pose{sample.q[0], sample.q[1], sample.q[2], {sample.q[3], sample.q[4]}};
    if (first) entry = pose;
    first = false;
    exit = pose;  // The last pose is that of 2 s after the motion.
    if (sample.time_s > problem.duration_s + 1e-9) return;
    for (std::size_t j = 0; j < 2; ++j) {
      worst = std::max(worst,
                       std::abs(s.file.primitive.joints[j].position.Evaluate(sample.time_s).value -
                                sample.q[3 + j]));
    }
  };
  rollout.Visit(s.best.x, 2 - problem.settle_s, look,
                kHeldLonger * problem.solver.step_s / kRefinement);
  EXPECT_LT(worst, 1e-12);
  for (const auto& [said, seen] : {std::pair(s.file.entry, entry), std::pair(s.file.exit, exit)}) {
    EXPECT_EQ(said.root_x_m, seen.root_x_m);
    EXPECT_EQ(said.root_z_m, seen.root_z_m);
    EXPECT_EQ(said.root_pitch_rad, seen.root_pitch_rad);
    for (std::size_t j = 0; j < 2; ++j)
      EXPECT_NEAR(said.joint_positions_rad[j], seen.joint_positions_rad[j], 1e-12);
  }
  EXPECT_NEAR(s.file.exit.joint_positions_rad[0], -1.2, 1e-12);
  EXPECT_NEAR(s.file.exit.joint_positions_rad[1], 1.3, 1e-12);
}

TEST(MakePrimitiveFile, PeaksAndContactsAreThoseOfTheMotion) {
  const Solved& s = TheSolution();
  const Problem& problem = s.task.problem;
  double torque = 0, depth = 0, force = 0;
  Rollout rollout(problem, problem.solver.step_s / kRefinement);
  rollout.Visit(s.best.x, 2 - problem.settle_s, [&](const MotionSample& sample) {
    for (const double t : sample.torque) torque = std::max(torque, std::abs(t));
    for (const auto& contact : sample.contacts) {
      depth = std::max(depth, contact.depth_m);
      if (sample.time_s <= problem.duration_s + problem.settle_s)
        force = std::max(force, contact.normal_force_n);
    }
  });
  EXPECT_EQ(s.file.certificate.peak_torque_nm, torque);
  EXPECT_EQ(s.file.certificate.peak_penetration_m, depth);
  double said = 0;
  ASSERT_FALSE(s.file.contacts.empty());
  for (const ContactInterval& contact : s.file.contacts) {
    EXPECT_LE(contact.start_s, contact.end_s);
    EXPECT_LE(contact.end_s, problem.duration_s + problem.settle_s + 1e-9);
    EXPECT_EQ(contact.obstacle, "ground");
    said = std::max(said, contact.peak_normal_force_n);
  }
  EXPECT_EQ(said, force);
  EXPECT_EQ(s.file.contacts.front().start_s, 0) << "it stands at the start";
}

TEST(MakePrimitiveFile, NamesFilesInOneLineThatLoadersTake) {
  Task task = TheSolution().task;
  task.robot_file = "red \x1b[31m.urdf";
  task.task_file = "two\nlines.toml";
  const PrimitiveFile made = MakePrimitiveFile(task, {}, TheSolution().best);
  const PrimitiveFile read = ParsePrimitive(ToToml(made), "p.toml");
  EXPECT_EQ(read.provenance.robot_file, "red \\x1b[31m.urdf");
  EXPECT_EQ(read.provenance.task_file, "two\\x0alines.toml");
}

TEST(Summarize, LooksAtTwoSecondsAfterTheEndHoweverLongTheSettlePhase) {
  const Solved& s = TheSolution();
  Problem longer = s.task.problem;
  longer.settle_s = 3;
  const MotionSummary a = Summarize(s.task.problem, s.best.x);
  const MotionSummary b = Summarize(longer, s.best.x);
  EXPECT_NEAR(a.settled_pitch_rad, b.settled_pitch_rad, 1e-6);
  EXPECT_EQ(a.final_pitch_rad, b.final_pitch_rad);
}

}  // namespace
}  // namespace tumbler
