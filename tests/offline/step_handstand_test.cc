// Finds a handstand onto a step from nothing.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/found_motion.h"

namespace tumbler {
namespace {

using StepHandstand = FoundMotion;
INSTANTIATE_TEST_SUITE_P(Seeds, StepHandstand, ::testing::Values(3));

TEST_P(StepHandstand, StandsOnTheStepAndStays) {
  Find("step_handstand.toml");
  bool began_on_ground = false;
  double end = problem_.duration_s + problem_.settle_s;
  Rollout rollout(problem_, problem_.solver.step_s);
  const double later = 5;
  rollout.Visit(best_.x, later, [&](const MotionSample& sample) {
    for (const ActiveContact<Plane>& contact : sample.contacts) {
      if (sample.time_s < 0.01) began_on_ground |= ObstacleOf(contact) == "ground";
      if (sample.time_s < end + 1) continue;
      // From a second after the end on, only the feet of leg 2 touch anything, and that is the
      // step.
      EXPECT_EQ(ObstacleOf(contact), "step") << sample.time_s;
      EXPECT_EQ(
          problem_.scene.robot.shapes[static_cast<std::size_t>(contact.shape)].name.substr(0, 4),
          "leg2");
    }
    if (sample.time_s > end + 1) {
      EXPECT_NEAR(sample.q[2], M_PI / 2, 0.1) << sample.time_s;
      EXPECT_NEAR(sample.q[1], 0.385, 0.005) << "20 mm above where it stands on the ground";
    }
  });
  EXPECT_TRUE(began_on_ground);
}

}  // namespace
}  // namespace tumbler
