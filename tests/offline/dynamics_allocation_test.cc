#include <gtest/gtest.h>

#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/random_robot.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

TEST(DynamicsAllocation, DynamicsContactsAndTheirDerivativesAllocateNothing) {
  const PlanarRobot robot = LoadTumbler();
  const Obstacle<Plane> ground{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})};
  const Obstacle<Plane> bump{"bump", Shape<Plane>::Sphere({0, 0}, 0.15)};
  ContactModel<Plane> contact({}, robot.shapes, {ground, bump});
  HybridDynamics<Plane> dynamics(robot.tree);
  DynamicsDerivatives<Plane> derivatives;
  std::mt19937_64 random(32);
  std::size_t contacts = 0;
  for (int trial = 0; trial < 200; ++trial) {
    DynamicsState s = RandomState(random, 5);
    s.q[0] = Uniform(random, -0.5, 0.5);
    s.q[1] = Uniform(random, 0.0, 0.35);
    const testing::AllocationGuard guard;
    dynamics.SetState(s.q, s.qd);
    contact.Apply(dynamics);
    dynamics.Solve(s.qdd, s.tau);
    contact.Differentiate(dynamics);
    dynamics.Differentiate(derivatives);
    contacts += contact.active().size();
  }
  EXPECT_GT(contacts, 100U);
}

}  // namespace
}  // namespace tumbler
