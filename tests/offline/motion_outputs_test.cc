#include "offline/solve/motion_outputs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "common/core/index.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

/// Adjoint and forward sensitivities take their outputs from the same place, so that they cannot
/// show each other its errors. These tests compare it with differences, and with what it says of
/// itself.
class MotionOutputsTest : public ::testing::Test {
 protected:
  /// Puts the robot at rest at these positions.
  void Place(const std::vector<double>& q) {
    std::ranges::copy(q, robot_.q.begin());
    robot_.qd.fill(0);
    robot_.qdd.fill(0);
    robot_.SetFree(robot_.AtRest(q));
    robot_.TouchAndSolve();
  }
  double PenetrationAt(const std::vector<double>& q) {
    Place(q);
    return outputs_.Penetration(robot_);
  }

  Problem problem_ = HandstandProblem();
  ParametricMotion motion_{problem_};
  SceneDynamics robot_{problem_.scene};
  MotionOutputs outputs_{motion_, 1e-3};
};

TEST_F(MotionOutputsTest, RowsAreThatManyAndNoTwoAreTheSame) {
  const OutputRows rows = outputs_.rows();
  std::set<int> seen = {OutputRows::kCost, rows.penetration(), rows.clearance()};
  for (int j = 0; j < motion_.joints(); ++j) seen.insert(OutputRows::torque(j));
  EXPECT_EQ(static_cast<int>(seen.size()), rows.count());
  EXPECT_EQ(*seen.rbegin(), rows.count() - 1);
}

TEST_F(MotionOutputsTest, WhereNothingHappenedNothingIsExceeded) {
  const RolloutResult result = outputs_.Begin();
  EXPECT_EQ(result.torque_excess, std::vector<double>(2, -1.0));
  EXPECT_EQ(result.penetration_excess, -1);
  EXPECT_EQ(MotionOutputs::TorqueExcess(outputs_.EmptyTorqueMaximum()), -1);
  EXPECT_EQ(outputs_.PenetrationExcess(outputs_.EmptyPenetrationMaximum()), -1);
}

TEST_F(MotionOutputsTest, TheExcessOfAConstantQuantityIsWhatItIsAboveItsLimit) {
  // A peak that lasts kPeakDuration_s counts as much as it is high.
  SmoothMaximum torque = outputs_.EmptyTorqueMaximum();
  const double minus_one_and_a_half = -1.5;
  torque.Add(LookPoints::Start(), kPeakDuration_s, {&minus_one_and_a_half, 1}, {});
  EXPECT_NEAR(MotionOutputs::TorqueExcess(torque), 0.5, 1e-12);
  // Of the penetration, what is above the least that counts is added up.
  SmoothMaximum penetration = outputs_.EmptyPenetrationMaximum();
  const double deepest = 0.3, least = 1 + kNegligibleExponent / problem_.solver.sharpness;
  penetration.Add(LookPoints::Start(), kPeakDuration_s, {&deepest, 1}, {});
  EXPECT_NEAR(outputs_.PenetrationExcess(penetration), least + deepest - 1, 1e-12);
}

TEST_F(MotionOutputsTest, ThePenetrationIsThatOfTheDeepestContactAndHasItsDifferencesAsSlopes) {
  std::vector<double> q = problem_.start_q;
  q[2] += 0.002;  // One foot is deeper than the others.
  while (PenetrationAt(q) < 0.1) q[1] -= 1e-4;
  double deepest = 0;
  for (const ActiveContact<Plane>& contact : robot_.contact->active())
    deepest = std::max(deepest, contact.depth_m);
  const double usable_m = (1 - problem_.solver.core_margin) * problem_.scene.contact.d_on_m;
  const double least = 1 + kNegligibleExponent / problem_.solver.sharpness;
  const double penetration = outputs_.Penetration(robot_);
  EXPECT_GE(penetration, deepest / usable_m - least);
  EXPECT_LE(penetration, deepest / usable_m - least + std::log(5.0) / problem_.solver.sharpness);

  SceneDynamics::Numbers slopes{};
  ASSERT_TRUE(outputs_.AddPenetrationSlopes(robot_, slopes));
  for (std::size_t i = 0; i < q.size(); ++i) {
    constexpr double kStep = 1e-7;
    std::vector<double> above = q, below = q;
    above[i] += kStep, below[i] -= kStep;
    const double difference = (PenetrationAt(above) - PenetrationAt(below)) / (2 * kStep);
    EXPECT_NEAR(slopes[i], difference, 1e-4 * std::max(1.0, std::abs(difference))) << i;
  }
}

TEST_F(MotionOutputsTest, NothingThatTouchesNothingHasAPenetrationOrSlopes) {
  std::vector<double> q = problem_.start_q;
  q[1] += 1;
  EXPECT_EQ(PenetrationAt(q), 0);
  SceneDynamics::Numbers slopes{};
  EXPECT_FALSE(outputs_.AddPenetrationSlopes(robot_, slopes));
}

TEST_F(MotionOutputsTest, TermsHaveTheDifferencesOfWhatTheyAddToTheCostAsSlopes) {
  const std::vector<double> q = {0.1, 0.4, 0.7, -1, 1}, qd = {0.3, -0.2, 0.5, 0, 0};
  constexpr double kStep = 1e-6;
  for (const bool linear : {false, true}) {
    for (int dof = 0; dof < 3; ++dof) {
      for (const bool of_velocity : {false, true}) {
        CostTerm term = SquareTerm(CostTerm::When::kEnd, dof, of_velocity, 0.25, 0.7);
        if (linear) term.kind = CostTerm::Kind::kLinear;
        const auto cost = [&](const std::vector<double>& at_q, const std::vector<double>& at_qd) {
          return term.Accumulate(0, term.weight, {at_q, at_qd, {}});
        };
        const MotionOutputs::TermSlopes slopes = MotionOutputs::SlopesOf(term, {q, qd, {}});
        for (std::size_t i = 0; i < q.size(); ++i) {
          std::vector<double> above = q, below = q;
          above[i] += kStep, below[i] -= kStep;
          EXPECT_NEAR(slopes.by_q[i], (cost(above, qd) - cost(below, qd)) / (2 * kStep), 1e-8);
          above = below = qd;
          above[i] += kStep, below[i] -= kStep;
          EXPECT_NEAR(slopes.by_qd[i], (cost(q, above) - cost(q, below)) / (2 * kStep), 1e-8);
        }
        if (linear) continue;  // Only what draws to a target has one that may move.
        term.target += kStep;
        const double above = cost(q, qd);
        term.target -= 2 * kStep;
        EXPECT_NEAR(slopes.by_target, (above - cost(q, qd)) / (2 * kStep), 1e-8);
      }
    }
  }
}

TEST_F(MotionOutputsTest, PeaksAreTheLargestOfAllThatWereSeen) {
  RolloutResult result = outputs_.Begin();
  robot_.tau.fill(0);
  for (const double torque : {1.0, -3.0, 2.0}) {
    robot_.tau[3] = torque;
    robot_.tau[4] = 0.5 * torque;
    outputs_.RecordPeaks(robot_, result);
  }
  EXPECT_EQ(result.peak_torque_nm, (std::vector<double>{3, 1.5}));
  EXPECT_FALSE(result.any_contact);
  std::vector<double> q = problem_.start_q;
  q[1] -= 0.002;
  Place(q);
  outputs_.RecordPeaks(robot_, result);
  EXPECT_TRUE(result.any_contact);
  EXPECT_GT(result.peak_penetration_m, 0);
}

}  // namespace
}  // namespace tumbler
