// Hybrid dynamics against DART, an independent engine, on the shipped robot: DART reads the URDF
// with its own loader, works in three dimensions, and uses another algorithm (articulated bodies).

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/dart_tumbler.h"
#include "tests/support/random_robot.h"

namespace tumbler {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

/// Compares `trials` random states with random forces at random points of random bodies.
/// @param prescribed  which joints have their acceleration given.
void Compare(const std::array<bool, 5>& prescribed, int trials, std::mt19937_64& random) {
  PlanarRobot robot = LoadTumbler();
  static const dart::dynamics::SkeletonPtr skeleton = LoadTumblerInDart();
  ASSERT_EQ(skeleton->getNumDofs(), 5U);
  std::array<dart::dynamics::Joint*, 5> joints{};
  for (std::size_t i = 0; i < 5; ++i) {
    robot.tree.dofs[i].prescribed = prescribed[i];
    joints[i] = skeleton->getJoint(kDartJoints[i]);
    ASSERT_NE(joints[i], nullptr) << kDartJoints[i];
    joints[i]->setActuatorType(prescribed[i] ? dart::dynamics::Joint::ACCELERATION
                                             : dart::dynamics::Joint::FORCE);
  }
  HybridDynamics<Plane> dynamics(robot.tree);
  for (int trial = 0; trial < trials; ++trial) {
    DynamicsState s = RandomState(random, 5);
    for (std::size_t i = 0; i < 5; ++i) {
      joints[i]->setPosition(0, s.q[i]);
      joints[i]->setVelocity(0, s.qd[i]);
      joints[i]->setCommand(0, prescribed[i] ? s.qdd[i] : s.tau[i]);
    }
    skeleton->clearExternalForces();
    dynamics.SetState(s.q, s.qd);
    for (int k = static_cast<int>(random() % 4); k > 0; --k) {
      const int body = 2 + static_cast<int>(random() % 3);
      const Plane::Vector point{Uniform(random, -0.3, 0.3), Uniform(random, -0.3, 0.3)};
      const Plane::Vector force{Uniform(random, -50, 50), Uniform(random, -50, 50)};
      joints[Index(body)]->getChildBodyNode()->addExtForce({force.x(), 0, force.y()},
                                                           {point.x(), 0, point.y()}, false, true);
      dynamics.AddWrench(
          body, Plane::ForceAt(dynamics.position(body) + dynamics.rotation(body) * point, force));
    }
    skeleton->computeForwardDynamics();
    dynamics.Solve(s.qdd, s.tau);
    double acceleration_scale = 1;
    double torque_scale = 1;
    for (std::size_t i = 0; i < 5; ++i) {
      acceleration_scale = std::max(acceleration_scale, std::abs(joints[i]->getAcceleration(0)));
      torque_scale = std::max(torque_scale, std::abs(joints[i]->getForce(0)));
    }
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_NEAR(s.qdd[i], joints[i]->getAcceleration(0), 1e-9 * acceleration_scale)
          << "trial " << trial << " joint " << kDartJoints[i];
      EXPECT_NEAR(s.tau[i], joints[i]->getForce(0), 1e-9 * torque_scale)
          << "trial " << trial << " joint " << kDartJoints[i];
    }
  }
}

TEST(DartOracle, AgreesOnTheTumblerWithPrescribedLegsAndExternalForces) {
  std::mt19937_64 random(41);
  Compare({false, false, false, true, true}, 1000, random);
}

TEST(DartOracle, AgreesForEveryChoiceOfPrescribedJoints) {
  std::mt19937_64 random(42);
  for (unsigned mask = 0; mask < 32; ++mask) {
    std::array<bool, 5> prescribed{};
    for (unsigned i = 0; i < 5; ++i) prescribed[i] = (mask >> i & 1U) != 0;
    SCOPED_TRACE(mask);
    Compare(prescribed, 20, random);
  }
}

TEST(DartOracle, AgreesOnEnergyAndMassCentre) {
  std::mt19937_64 random(43);
  const PlanarRobot robot = LoadTumbler();
  HybridDynamics<Plane> dynamics(robot.tree);
  const dart::dynamics::SkeletonPtr skeleton = LoadTumblerInDart();
  for (int trial = 0; trial < 100; ++trial) {
    const DynamicsState s = RandomState(random, 5);
    for (std::size_t i = 0; i < 5; ++i) {
      skeleton->getJoint(kDartJoints[i])->setPosition(0, s.q[i]);
      skeleton->getJoint(kDartJoints[i])->setVelocity(0, s.qd[i]);
    }
    dynamics.SetState(s.q, s.qd);
    const double kinetic = skeleton->computeKineticEnergy();
    // Not its computePotentialEnergy(), which puts every body's mass at the origin of its frame.
    const double potential = skeleton->getMass() * 9.81 * skeleton->getCOM().z();
    EXPECT_NEAR(dynamics.KineticEnergy(), kinetic, 1e-12 * (1 + kinetic));
    EXPECT_NEAR(dynamics.PotentialEnergy(), potential, 1e-11 * (1 + std::abs(potential)));
    const Eigen::Vector3d momentum = skeleton->getMass() * skeleton->getCOMLinearVelocity();
    EXPECT_NEAR(dynamics.Momentum().f.x(), momentum.x(), 1e-11);
    EXPECT_NEAR(dynamics.Momentum().f.y(), momentum.z(), 1e-11);
  }
}

}  // namespace
}  // namespace tumbler
