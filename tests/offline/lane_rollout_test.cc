// Motions in the lanes of packets: what a rollout computes of each, whatever the vectors, and the
// derivatives that differences of them give.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "offline/problem/task_toml.h"
#include "offline/scene/lane_plan_kernel.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/lane_rollout.h"
#include "offline/solve/lane_sensitivity.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/rollout.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using Motions = std::vector<std::vector<double>>;

/// In space also the slip under load counts.
Problem ProblemOf(const std::string& task) {
  Problem problem =
      LoadTask(testing::SourcePath("primitives/" + task), TaskSpaces::kPlaneAndSpace).problem;
  if (problem.space) {
    CostTerm& slip = problem.cost.emplace_back();
    slip.kind = CostTerm::Kind::kSlip;
    slip.when = CostTerm::When::kThroughout;
    slip.weight = 2;
    slip.robot_weight_n = 20;
  }
  return problem;
}

Motions RandomMotions(const Problem& problem, std::size_t count) {
  const RandomStarts starts(problem);
  Motions motions;
  for (std::size_t i = 0; i < count; ++i) motions.push_back(starts.Draw(i));
  return motions;
}

/// That of many random ones which costs least: it does not just stay where it is.
std::vector<double> AGoodMotion(const Problem& problem) {
  LaneRollout lanes(problem, 2e-3, LanePlan::Scheme::kSemiImplicitEuler);
  const Motions motions = RandomMotions(problem, 400);
  std::vector<double> best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t first = 0; first < motions.size(); first += Packet::kLanes) {
    const std::vector<RolloutResult> results =
        lanes.Run({&motions[first], Packet::kLanes}, LaneRollout::Wanted::kSimulated);
    for (std::size_t lane = 0; lane < results.size(); ++lane) {
      if (!(results[lane].cost < least)) continue;
      least = results[lane].cost;
      best = motions[first + lane];
    }
  }
  return best;
}

class LaneRolloutOf : public ::testing::TestWithParam<const char*> {};
/// Of problems in the plane: in space there are no derivatives in lanes.
class LaneSensitivityOf : public LaneRolloutOf {};

/// Steps of lengths that differ.
StepGrid UnevenSteps(const Problem& problem, const std::vector<double>& motion) {
  if (!problem.space) return StepsFor(problem, motion);
  StepGrid grid = EvenGrid(problem, 2e-3);
  for (std::size_t i = 1; i < grid.motion.size(); i += 2) {
    grid.motion[i - 1] += 5e-4;
    grid.motion[i] -= 5e-4;
  }
  return grid;
}

// The reference divides where lanes multiply by inverses, and has another order of sums. Impacts
// amplify that.
void ExpectTheSame(const RolloutResult& lane, const RolloutResult& one, double tolerance) {
  ASSERT_EQ(lane.finite, one.finite);
  if (!one.finite) return;
  EXPECT_NEAR(lane.cost, one.cost, tolerance * (1 + std::abs(one.cost)));
  ASSERT_EQ(lane.residuals.size(), one.residuals.size());
  for (std::size_t i = 0; i < one.residuals.size(); ++i)
    EXPECT_NEAR(lane.residuals[i], one.residuals[i], tolerance);
  EXPECT_NEAR(lane.target_error_rad, one.target_error_rad, tolerance);
  for (std::size_t j = 0; j < one.torque_excess.size(); ++j) {
    EXPECT_NEAR(lane.torque_excess[j], one.torque_excess[j], 1e-5);
    EXPECT_NEAR(lane.peak_torque_nm[j], one.peak_torque_nm[j], 1e-5);
  }
  EXPECT_EQ(lane.any_contact, one.any_contact);
  EXPECT_NEAR(lane.peak_penetration_m, one.peak_penetration_m, 1e-8);
  // The deepest contact alone in place of all of them: at most ln 24 / 200 less. Shallow ones count
  // as none.
  if (one.penetration_excess > -0.2) {
    EXPECT_LE(lane.penetration_excess, one.penetration_excess + 1e-5);
    EXPECT_GE(lane.penetration_excess, one.penetration_excess - 0.016);
  }
}

TEST_P(LaneRolloutOf, IsARolloutInEachLaneByEveryScheme) {
  const Problem problem = ProblemOf(GetParam());
  ASSERT_EQ(LaneRollout::WhyNot(problem), std::nullopt);
  const Motions motions = RandomMotions(problem, 8);
  const double step_s = 1e-3;
  LaneRollout classical(problem, step_s, LanePlan::Scheme::kRungeKutta);
  LaneRollout euler(problem, step_s, LanePlan::Scheme::kSemiImplicitEuler);
  Rollout one(problem, step_s);
  const std::vector<RolloutResult> run = classical.Run(motions), estimate = euler.Run(motions);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    ExpectTheSame(run[i], one.Run(motions[i]), 1e-7);
    ExpectTheSame(estimate[i], one.Estimate(motions[i]), 1e-7);
  }
  const StepGrid grid = UnevenSteps(problem, motions[0]);
  LaneRollout adaptive(problem, grid);
  one.Use(grid);
  ExpectTheSame(adaptive.Run({motions.data(), 1})[0], one.Run(motions[0]), 1e-7);
}

TEST_P(LaneRolloutOf, GivesTheSameBitsWithAllVectorsAndWhateverIsInTheOtherLanes) {
  const Problem problem = ProblemOf(GetParam());
  const Motions motions = RandomMotions(problem, 8);
  constexpr auto kScheme = LanePlan::Scheme::kRungeKutta;
  const std::vector<RolloutResult> all = LaneRollout(problem, 2e-3, kScheme).Run(motions);
  const auto expect_same = [](const RolloutResult& a, const RolloutResult& b) {
    EXPECT_EQ(a.cost, b.cost);
    EXPECT_EQ(a.residuals, b.residuals);
    EXPECT_EQ(a.torque_excess, b.torque_excess);
    EXPECT_EQ(a.penetration_excess, b.penetration_excess);
    EXPECT_EQ(a.clearance_excess, b.clearance_excess);
  };
  for (const LanePlanKernel<Packet>* kernel : PacketPlanKernels()) {
    SCOPED_TRACE(kernel->name);
    LaneRollout lanes(problem, 2e-3, kScheme, kernel);
    for (const std::size_t i : {0U, 5U}) expect_same(lanes.Run({&motions[i], 1})[0], all[i]);
    const Motions turned(motions.rbegin(), motions.rend());
    const std::vector<RolloutResult> back = lanes.Run(turned);
    for (std::size_t i = 0; i < all.size(); ++i) expect_same(back[all.size() - 1 - i], all[i]);
  }
}

TEST_P(LaneSensitivityOf, HasTheDerivativesOfForwardSensitivities) {
  const Problem problem = ProblemOf(GetParam());
  const std::vector<double> x = AGoodMotion(problem);
  ForwardSensitivity exact(problem, AdaptiveSteps(problem));
  OutputGradients of_exact = OutputGradients::Of(exact);
  GaussNewton model_of_exact;
  const RolloutResult there = exact.Run(x, of_exact, &model_of_exact);
  ASSERT_TRUE(there.finite);
  LaneSensitivity lanes(problem, exact.grid());
  OutputGradients of_lanes = OutputGradients::Of(lanes);
  GaussNewton model;
  const RolloutResult here = lanes.Run(x, of_lanes, &model);
  EXPECT_NEAR(here.cost, there.cost, 1e-7 * (1 + std::abs(there.cost)));
  const auto near = [](const auto& a, const auto& b, double part) {
    if (a.rows() != b.rows() || a.cols() != b.cols()) return false;
    if (a.size() == 0) return true;
    return (a - b).cwiseAbs().maxCoeff() <= part * b.cwiseAbs().maxCoeff() + 1e-7;
  };
  EXPECT_TRUE(near(of_lanes.row(0), of_exact.row(0), 1e-3)) << of_lanes.row(0) << "\n"
                                                            << of_exact.row(0);
  for (Eigen::Index j = 1; j <= 2; ++j) {
    EXPECT_TRUE(near(of_lanes.row(j), of_exact.row(j), 1e-2)) << of_lanes.row(j) << "\n"
                                                              << of_exact.row(j);
  }
  EXPECT_TRUE(near(of_lanes.row(4), of_exact.row(4), 1e-9));
  EXPECT_TRUE(near(model.residual_slopes, model_of_exact.residual_slopes, 1e-3))
      << model.residual_slopes << "\n"
      << model_of_exact.residual_slopes;
  EXPECT_TRUE(near(model.matrix, model_of_exact.matrix, 0.1)) << model.matrix << "\n"
                                                              << model_of_exact.matrix;
  EXPECT_NEAR(model.squares, model_of_exact.squares, 1e-6 * (1 + model_of_exact.squares));
}

// Six and eleven parameters: one packet of a motion and those beside it, and two. The roll has own
// shapes that stay apart, and the printed cost no effort.
INSTANTIATE_TEST_SUITE_P(InThePlane, LaneRolloutOf,
                         ::testing::Values("tasks/nominal/handstand.toml",
                                           "tasks/nominal/roll.toml", "tasks/paper/roll.toml"));
INSTANTIATE_TEST_SUITE_P(InThePlane, LaneSensitivityOf,
                         ::testing::Values("tasks/nominal/handstand.toml",
                                           "tasks/nominal/roll.toml", "tasks/paper/roll.toml"));
// The one rolls over from its back, and both cost work.
INSTANTIATE_TEST_SUITE_P(InSpace, LaneRolloutOf,
                         ::testing::Values("solo12/tasks/nominal/get_up.toml",
                                           "solo8/tasks/walk.toml"));

TEST(LaneRollout, SaysWhatItDoesNotCover) {
  Problem problem = ProblemOf("tasks/nominal/handstand.toml");
  Problem free = problem;
  free.free_duration = DurationBounds{0.5, 0.8};
  EXPECT_EQ(LaneRollout::WhyNot(free), "the duration is free");
  Problem throughout = problem;
  throughout.cost[0].when = CostTerm::When::kThroughout;
  EXPECT_EQ(LaneRollout::WhyNot(throughout), "a cost looks at the state throughout the motion");
  Problem driven = problem;
  driven.scene.motors.resize(2);
  EXPECT_THAT(LaneRollout::WhyNot(driven).value_or(""), ::testing::HasSubstr("[motor]"));
}

TEST(LaneRollout, SaysWhatItDoesNotCoverInSpace) {
  Problem problem = ProblemOf("solo8/tasks/walk.toml");
  Problem on_stones = problem;
  Obstacle<Spatial>& stone = on_stones.space->scene.obstacles.emplace_back();
  stone.name = "pebble";
  stone.shape = Shape<Spatial>::Sphere({0.2, 0, 0}, 0.02);
  EXPECT_THAT(LaneRollout::WhyNot(on_stones).value_or(""), ::testing::HasSubstr("'pebble'"));
  problem.space->scene.motors.resize(8);
  EXPECT_THAT(LaneRollout::WhyNot(problem).value_or(""), ::testing::HasSubstr("[motor]"));
}

}  // namespace
}  // namespace tumbler
