// Finds a roll over a bump from nothing.

#include <gtest/gtest.h>

#include <cmath>

#include "offline/model/hybrid_dynamics.h"
#include "tests/support/found_motion.h"

namespace tumbler {
namespace {

using BumpRoll = FoundMotion;
INSTANTIATE_TEST_SUITE_P(Seeds, BumpRoll, ::testing::Values(1));

TEST_P(BumpRoll, GoesOverTheBumpAndLeavesItBehind) {
  Find("bump_roll.toml");
  const Shape<Plane>& bump = problem_.scene.obstacles[1].shape;
  bool touched = false;
  double leftmost_start = 1, rightmost_end = -10, turned = 0;
  Rollout rollout(problem_, problem_.solver.step_s);
  rollout.Visit(best_.x, 2, [&](const MotionSample& sample) {
    for (const ActiveContact<Plane>& contact : sample.contacts)
      touched |= ObstacleOf(contact) == "bump";
    turned = sample.q[2] - M_PI / 2;
    double leftmost = 10, rightmost = -10;
    for (const ContactShape<Plane>& own : problem_.scene.robot.shapes) {
      const Plane::Vector p = sample.dynamics->origin() + sample.dynamics->position(own.body) +
                              sample.dynamics->rotation(own.body) * own.shape.centre;
      leftmost = std::min(leftmost, p.x());
      rightmost = std::max(rightmost, p.x());
    }
    if (sample.time_s == 0) leftmost_start = leftmost;
    rightmost_end = rightmost;
  });
  EXPECT_TRUE(touched);
  EXPECT_GT(leftmost_start, bump.centre.x() + 0.1) << "it starts right of the bump";
  EXPECT_LT(rightmost_end, bump.centre.x()) << "and ends left of its top";
  EXPECT_GT(turned, 3 * M_PI / 2 - 0.1)
      << "having turned as far as onto its back and on to its belly";
}

}  // namespace
}  // namespace tumbler
