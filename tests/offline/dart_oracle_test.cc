// Hybrid dynamics against DART, an independent engine, which uses another algorithm (articulated
// bodies). On the shipped robot, in the plane: DART reads the URDF with its own loader, and works
// in three dimensions. In space: on random trees, and on a quadruped with its derivatives.

#include <gtest/gtest.h>

#include <cmath>
#include <dart/dynamics/PrismaticJoint.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <string>
#include <tuple>

#include "common/core/index.h"
#include "offline/model/hybrid_dynamics.h"
#include "tests/support/dart_tumbler.h"
#include "tests/support/random_robot.h"
#include "tests/support/solo_robot.h"
#include "tests/support/to_eigen.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

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
    // DART's computePotentialEnergy() puts every body's mass at the origin of its frame.
    const double potential = skeleton->getMass() * 9.81 * skeleton->getCOM().z();
    EXPECT_NEAR(dynamics.KineticEnergy(), kinetic, 1e-12 * (1 + kinetic));
    EXPECT_NEAR(dynamics.PotentialEnergy(), potential, 1e-11 * (1 + std::abs(potential)));
    const Eigen::Vector3d momentum = skeleton->getMass() * skeleton->getCOMLinearVelocity();
    EXPECT_NEAR(dynamics.Momentum().f.x(), momentum.x(), 1e-11);
    EXPECT_NEAR(dynamics.Momentum().f.y(), momentum.z(), 1e-11);
  }
}

/// The tree in DART. Rotor inertia and damping are left out: DART treats damping implicitly.
dart::dynamics::SkeletonPtr InDart(const Tree<Spatial>& tree) {
  dart::dynamics::SkeletonPtr skeleton = dart::dynamics::Skeleton::create();
  skeleton->setGravity(ToEigen(tree.gravity));
  std::vector<dart::dynamics::BodyNode*> bodies;
  for (const Dof<Spatial>& dof : tree.dofs) {
    dart::dynamics::BodyNode* const parent = dof.parent < 0 ? nullptr : bodies[Index(dof.parent)];
    // Each gets another name, because DART prints a message when it has to make one.
    const std::string name = "dof" + std::to_string(bodies.size());
    const dart::dynamics::BodyNode::AspectProperties body_properties(name);
    dart::dynamics::Joint* joint = nullptr;
    dart::dynamics::BodyNode* body = nullptr;
    if (dof.kind == JointKind::kRevolute) {
      dart::dynamics::RevoluteJoint::Properties properties;
      properties.mName = name;
      properties.mAxis = ToEigen(dof.axis);
      std::tie(joint, body) = skeleton->createJointAndBodyNodePair<dart::dynamics::RevoluteJoint>(
          parent, properties, body_properties);
    } else {
      dart::dynamics::PrismaticJoint::Properties properties;
      properties.mName = name;
      properties.mAxis = ToEigen(dof.direction);
      std::tie(joint, body) = skeleton->createJointAndBodyNodePair<dart::dynamics::PrismaticJoint>(
          parent, properties, body_properties);
    }
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    X.translation() = ToEigen(dof.offset);
    joint->setTransformFromParentBodyNode(X);
    joint->setActuatorType(dof.prescribed ? dart::dynamics::Joint::ACCELERATION
                                          : dart::dynamics::Joint::FORCE);
    const SpaceMatrix& I = dof.inertia_kg_m2;
    dart::dynamics::Inertia inertia;
    inertia.setMass(dof.mass_kg);
    inertia.setLocalCOM(ToEigen(dof.mass_centre));
    inertia.setMoment(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
    body->setInertia(inertia);
    bodies.push_back(body);
  }
  return skeleton;
}

TEST(DartOracle, AgreesOnRandomTreesInSpaceWithRandomPrescribedJointsAndForces) {
  std::mt19937_64 random(44);
  for (int trial = 0; trial < 400; ++trial) {
    Tree<Spatial> tree = RandomSpatialTree(random, 12);
    for (Dof<Spatial>& dof : tree.dofs) dof.rotor_inertia_kg_m2 = dof.damping_nm_s_per_rad = 0;
    const std::size_t n = tree.dofs.size();
    const dart::dynamics::SkeletonPtr skeleton = InDart(tree);
    HybridDynamics<Spatial> dynamics(tree);
    for (int state = 0; state < 4; ++state) {
      DynamicsState s = RandomState(random, n);
      for (std::size_t i = 0; i < n; ++i) {
        skeleton->getJoint(i)->setPosition(0, s.q[i]);
        skeleton->getJoint(i)->setVelocity(0, s.qd[i]);
        skeleton->getJoint(i)->setCommand(0, tree.dofs[i].prescribed ? s.qdd[i] : s.tau[i]);
      }
      skeleton->clearExternalForces();
      dynamics.SetState(s.q, s.qd);
      for (int k = static_cast<int>(random() % 4); k > 0; --k) {
        const int body = static_cast<int>(random() % n);
        const SpaceVector point = RandomVector(random, 0.3), force = RandomVector(random, 50),
                          moment = RandomVector(random, 5);
        skeleton->getBodyNode(Index(body))
            ->addExtForce(ToEigen(force), ToEigen(point), false, true);
        skeleton->getBodyNode(Index(body))->addExtTorque(ToEigen(moment), false);
        auto wrench =
            Spatial::ForceAt(dynamics.position(body) + dynamics.rotation(body) * point, force);
        wrench.n += moment;
        dynamics.AddWrench(body, wrench);
      }
      skeleton->computeForwardDynamics();
      dynamics.Solve(s.qdd, s.tau);
      double acceleration_scale = 1;
      double torque_scale = 1;
      for (std::size_t i = 0; i < n; ++i) {
        const auto* joint = skeleton->getJoint(i);
        acceleration_scale = std::max(acceleration_scale, std::abs(joint->getAcceleration(0)));
        torque_scale = std::max(torque_scale, std::abs(joint->getForce(0)));
      }
      for (std::size_t i = 0; i < n; ++i) {
        const auto* joint = skeleton->getJoint(i);
        EXPECT_NEAR(s.qdd[i], joint->getAcceleration(0), 1e-9 * acceleration_scale)
            << "trial " << trial << " of " << n << ", degree of freedom " << i;
        EXPECT_NEAR(s.tau[i], joint->getForce(0), 1e-9 * torque_scale)
            << "trial " << trial << " of " << n << ", degree of freedom " << i;
      }
      const double kinetic = skeleton->computeKineticEnergy();
      EXPECT_NEAR(dynamics.KineticEnergy(), kinetic, 1e-11 * (1 + kinetic));
    }
  }
}

/// Inverse dynamics and their derivatives by another's: DART has none of its own. Torques are
/// polynomials of the second degree in velocities, and in the sine and cosine of any one angle;
/// they are linear in a translation. Differences of the right points are exact for all of these.
class DartInverse {
 public:
  explicit DartInverse(const dart::dynamics::SkeletonPtr& skeleton) : skeleton_(skeleton) {}

  Eigen::VectorXd Torques(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                          const Eigen::VectorXd& qdd) {
    skeleton_->setPositions(q);
    skeleton_->setVelocities(qd);
    skeleton_->setAccelerations(qdd);
    skeleton_->computeInverseDynamics();
    return skeleton_->getForces();
  }

  /// By an angle: the derivative of the trigonometric polynomial through five points around it.
  Eigen::VectorXd ByPosition(Eigen::VectorXd q, const Eigen::VectorXd& qd,
                             const Eigen::VectorXd& qdd, Eigen::Index k) {
    constexpr int kPoints = 5;
    constexpr double kPi = 3.14159265358979323846;
    const double angle = q[k];
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(q.size());
    for (int point = 1; point < kPoints; ++point) {
      const double away = 2 * kPi * point / kPoints;
      q[k] = angle + away;
      // -D(away) of the Dirichlet kernel 1 + 2 cos + 2 cos 2.
      sum += (2 * std::sin(away) + 4 * std::sin(2 * away)) / kPoints * Torques(q, qd, qdd);
    }
    return sum;
  }

  Eigen::VectorXd ByVelocity(const Eigen::VectorXd& q, Eigen::VectorXd qd,
                             const Eigen::VectorXd& qdd, Eigen::Index k) {
    constexpr double kStep = 4;  // of the size of velocities, so that rounding stays small
    const double velocity = qd[k];
    qd[k] = velocity + kStep;
    const Eigen::VectorXd faster = Torques(q, qd, qdd);
    qd[k] = velocity - kStep;
    return (faster - Torques(q, qd, qdd)) / (2 * kStep);
  }

 private:
  dart::dynamics::SkeletonPtr skeleton_;
};

/// The largest differences from DART on states of Solo12, in relation to the largest number of the
/// same kind at that state.
struct SoloErrors {
  double acceleration = 0, torque = 0, by_position = 0, by_velocity = 0, by_input = 0;
};

Eigen::Map<const Eigen::VectorXd> ToEigen(const std::vector<double>& v) {
  return {v.data(), static_cast<Eigen::Index>(v.size())};
}

double Relative(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
  return (found - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff();
}

/// @param driven  whether the joints are given torques; else they follow paths.
SoloErrors CompareSolo(bool driven, bool derivatives, int trials, std::uint64_t seed) {
  Robot robot = LoadSolo("solo12");
  if (!driven) PrescribeJoints(robot);
  const std::size_t n = robot.tree.dofs.size();
  const auto size = static_cast<Eigen::Index>(n);
  const dart::dynamics::SkeletonPtr skeleton = InDart(robot.tree);
  DartInverse inverse(skeleton);
  HybridDynamics<Spatial> dynamics(robot.tree);
  std::mt19937_64 random(seed);
  SoloErrors errors;
  const auto note = [](double& worst, double error) { worst = std::max(worst, error); };
  for (int trial = 0; trial < trials; ++trial) {
    DynamicsState s = RandomState(random, n);
    s.q[4] = Uniform(random, -1, 1);  // of roll, away from the singularity
    for (std::size_t i = 0; i < n; ++i) {
      skeleton->getJoint(i)->setPosition(0, s.q[i]);
      skeleton->getJoint(i)->setVelocity(0, s.qd[i]);
      skeleton->getJoint(i)->setCommand(0, robot.tree.dofs[i].prescribed ? s.qdd[i] : s.tau[i]);
    }
    skeleton->computeForwardDynamics();
    dynamics.SetState(s.q, s.qd);
    dynamics.Solve(s.qdd, s.tau);
    note(errors.acceleration, Relative(ToEigen(s.qdd), skeleton->getAccelerations()));
    note(errors.torque, Relative(ToEigen(s.tau), skeleton->getForces()));
    if (!derivatives) continue;
    const Eigen::VectorXd q = ToEigen(s.q), qd = ToEigen(s.qd), qdd = ToEigen(s.qdd);
    const Eigen::MatrixXd M = skeleton->getMassMatrix();
    Eigen::MatrixXd by_q(size, size), by_qd(size, size);
    for (Eigen::Index k = 0; k < size; ++k) {
      by_qd.col(k) = inverse.ByVelocity(q, qd, qdd, k);
      by_q.col(k).setZero();  // Nothing depends on where the robot is.
      if (k >= 3) by_q.col(k) = inverse.ByPosition(q, qd, qdd, k);
    }
    // The free degrees of freedom come first: six, or all.
    const Eigen::Index free = driven ? size : kFloatingDofs, rest = size - free;
    const Eigen::LLT<Eigen::MatrixXd> inertia(M.topLeftCorner(free, free));
    const Eigen::MatrixXd M_ap = M.bottomLeftCorner(rest, free);
    const auto outputs = [&](const Eigen::MatrixXd& D) {
      Eigen::MatrixXd result(size, size);
      result.topRows(free) = inertia.solve(-D.topRows(free));
      result.bottomRows(rest) = D.bottomRows(rest) + M_ap * result.topRows(free);
      return result;
    };
    Eigen::MatrixXd given = M;  // of inverse dynamics by torques and accelerations
    given.leftCols(free) = -Eigen::MatrixXd::Identity(size, free);
    HybridDynamics<Spatial>::Derivatives d;
    dynamics.Differentiate(d);
    const auto block = [&](const auto& values) {
      return Eigen::MatrixXd::NullaryExpr(size, size, [&](Eigen::Index i, Eigen::Index k) {
        return values[static_cast<int>(i)][static_cast<int>(k)];
      });
    };
    note(errors.by_position, Relative(block(d.q), outputs(by_q)));
    note(errors.by_velocity, Relative(block(d.qd), outputs(by_qd)));
    note(errors.by_input, Relative(block(d.input), outputs(given)));
  }
  return errors;
}

TEST(DartOracle, AgreesOnSolo12FloatingAtTenThousandStates) {
  for (const bool driven : {false, true}) {
    const SoloErrors errors = CompareSolo(driven, false, 10000, 45);
    EXPECT_LT(errors.acceleration, 1e-12) << driven;
    EXPECT_LT(errors.torque, 1e-12) << driven;
  }
}

TEST(DartOracle, AgreesOnTheDerivativesOfSolo12) {
  for (const bool driven : {false, true}) {
    const SoloErrors errors = CompareSolo(driven, true, 100, 46);
    EXPECT_LT(errors.by_position, 1e-12) << driven;
    EXPECT_LT(errors.by_velocity, 1e-12) << driven;
    EXPECT_LT(errors.by_input, 1e-12) << driven;
  }
}

TEST(DartOracle, AgreesOnTheDerivativesOfSolo12AtTenThousandStates) {
  for (const bool driven : {false, true}) {
    const SoloErrors errors = CompareSolo(driven, true, 5000, 47);
    EXPECT_LT(errors.by_position, 1e-12) << driven;
    EXPECT_LT(errors.by_velocity, 1e-12) << driven;
    EXPECT_LT(errors.by_input, 1e-12) << driven;
  }
}

}  // namespace
}  // namespace tumbler
