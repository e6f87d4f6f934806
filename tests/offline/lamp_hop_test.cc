// Finds a hop from nothing, of a robot that is not the tumbler.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/found_motion.h"

namespace tumbler {
namespace {

using LampHop = FoundMotion;
INSTANTIATE_TEST_SUITE_P(Seeds, LampHop, ::testing::Values(1, 2, 5));

TEST_P(LampHop, LeavesTheGroundAndLandsAtRestFurtherOn) {
  Find("lamp_hop.toml");
  Rollout rollout(problem_, problem_.solver.step_s);
  const double end_s = problem_.duration_s + problem_.settle_s;
  double touched_s = 0, longest_s = 0, x_m = 0;
  rollout.Visit(best_.x, 2, [&](const MotionSample& sample) {
    for (const ActiveContact<Plane>& contact : sample.contacts) {
      EXPECT_EQ(problem_.scene.robot.shapes[static_cast<std::size_t>(contact.shape)].body, 2)
          << "the foot alone touches the ground";
      touched_s = sample.time_s;
    }
    longest_s = std::max(longest_s, sample.time_s - touched_s);
    if (sample.time_s > end_s + 1) {
      EXPECT_NEAR(sample.q[2], problem_.start_q[2], 5e-3) << sample.time_s;
      EXPECT_NEAR(sample.q[1], problem_.start_q[1], 1e-4) << sample.time_s;
    }
    x_m = sample.q[0];
  });
  EXPECT_GT(longest_s, 0.1) << "a free fall from 50 mm takes as long";
  EXPECT_NEAR(x_m, 0.15, 0.01);
}

}  // namespace
}  // namespace tumbler
