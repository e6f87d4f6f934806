// The shipped robots that are in space: the published figures of the Solo quadrupeds, and a tumbler
// that has feet with a width.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "offline/model/contact_model.h"
#include "offline/model/contact_shapes.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/robot_review.h"
#include "tests/support/random_robot.h"
#include "tests/support/solo_robot.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

using ::testing::IsEmpty;

/// What is published of a Solo, in SI units. The addresses are in the README beside each robot.
struct Published {
  std::string name;
  double total_kg;  ///< Of the built robot, in two digits.
  std::map<std::string, double> link_kg;
  SpaceVector hip_fe, knee, foot;  ///< From the base's centre, HFE, KFE, on the left in front.
  std::array<double, 3> base_moments_kg_m2;
  std::vector<std::string> joints;
};

/// robot_properties_solo of the Open Dynamic Robot Initiative: leg.xacro and solo12.urdf.xacro; the
/// total: open_robot_actuator_hardware, quadruped_robot_12dof_v1.
Published Solo12() {
  return {"solo12",
          2.5,
          {{"base_link", 1.25123725},
           {"SHOULDER", 0.14196048},
           {"UPPER_LEG", 0.14737324},
           {"LOWER_LEG", 0.02318294}},
          {0.2141 - 0.0195, 0.0875 + 0.014, 0},
          {0, 0.03745, -0.16},
          {0, 0.009, -0.16},
          {0.0026622, 0.0138851, 0.0160537},
          {"HAA", "HFE", "KFE"}};
}

/// solo.urdf of example-robot-data; the total: Grimminger et al., RA-L 2020.
Published Solo8() {
  return {"solo8",
          2.2,
          {{"base_link", 1.43315091},
           {"UPPER_LEG", 0.14853845},
           {"LOWER_LEG", 0.03070001},
           {"FOOT", 0.00693606}},
          {0.19, 0.1046, 0},
          {0, 0.03745, -0.16},
          {0, 0.008, -0.16},
          {0.00578574, 0.01938108, 0.02476124},
          {"HFE", "KFE"}};
}

class Solo : public ::testing::TestWithParam<Published> {};

TEST_P(Solo, HasThePublishedMasses) {
  const Published& published = GetParam();
  const Robot robot = LoadSolo(published.name);
  EXPECT_THAT(robot.findings, IsEmpty());
  double total = 0, expected = published.link_kg.at("base_link");
  for (const RobotLink& link : robot.links) {
    total += link.mass_kg;
    const std::string part = link.name == "base_link" ? link.name : link.name.substr(3);
    const auto found = published.link_kg.find(part);
    EXPECT_EQ(link.mass_kg, found == published.link_kg.end() ? 0 : found->second) << link.name;
    if (link.name != "base_link") expected += link.mass_kg;
  }
  EXPECT_NEAR(total, expected, 1e-12);
  EXPECT_NEAR(total, published.total_kg, 0.05);
  const SpaceMatrix& inertia = robot.tree.dofs[kFloatingDofs - 1].inertia_kg_m2;
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(inertia(i, i), published.base_moments_kg_m2[Index(i)], 1e-12);
}

TEST_P(Solo, HasThePublishedLengthsAndIsAsLongToEachSide) {
  const Published& published = GetParam();
  const Robot robot = LoadSolo(published.name);
  HybridDynamics<Spatial> dynamics(robot.tree);
  const std::vector<double> zero(robot.tree.dofs.size());
  dynamics.SetState(zero, zero);
  const std::size_t per_leg = published.joints.size();
  ASSERT_EQ(robot.tree.dofs.size(), kFloatingDofs + 4 * per_leg);
  for (std::size_t leg = 0; leg < 4; ++leg) {
    const std::string name = std::array{"FL", "FR", "HL", "HR"}[leg];
    const double side = name[1] == 'L' ? 1 : -1, end = name[0] == 'F' ? 1 : -1;
    const auto mirrored = [&](const SpaceVector& r) {
      return SpaceVector(end * r.x(), side * r.y(), r.z());
    };
    for (std::size_t j = 0; j < per_leg; ++j) {
      EXPECT_EQ(robot.tree.dofs[kFloatingDofs + per_leg * leg + j].name,
                name + "_" + published.joints[j]);
    }
    const SpaceVector hip = dynamics.position(robot.FindDof(name + "_HFE")),
                      knee = dynamics.position(robot.FindDof(name + "_KFE"));
    const RobotLink* const foot = robot.FindLink(name + "_FOOT");
    ASSERT_NE(foot, nullptr);
    EXPECT_LT((hip - mirrored(published.hip_fe)).norm(), 1e-12) << name;
    EXPECT_LT((knee - hip - mirrored(published.knee)).norm(), 1e-12) << name;
    EXPECT_LT((foot->pose.translation - mirrored(published.foot)).norm(), 1e-12) << name;
    EXPECT_EQ(foot->body, robot.FindDof(name + "_KFE"));
  }
}

TEST_P(Solo, HasTheTorqueOfItsMotorsAndTheRangesOfItsDrivesAndOfItsHips) {
  // 12 A x 0.025 N m/A x 9; solo12_driver.yaml.
  const std::map<std::string, double> range = {{"HFE", 1.45}, {"KFE", 2.8}};
  const Robot robot = LoadSolo(GetParam().name);
  for (std::size_t j = kFloatingDofs; j < robot.tree.dofs.size(); ++j) {
    const RobotJointLimits& limits = robot.joints[j].limits;
    const std::string& name = robot.tree.dofs[j].name;
    EXPECT_NEAR(limits.effort_nm, 12 * 0.025 * 9, 1e-12);
    EXPECT_EQ(limits.velocity_rad_s, 80);
    if (name.substr(3) == "HAA") {
      // Outwards a left leg turns about x, and a right one the other way round.
      const bool left = name[1] == 'L';
      const double out = left ? limits.upper_rad : -limits.lower_rad;
      const double in = left ? -limits.lower_rad : limits.upper_rad;
      constexpr double kDegree = M_PI / 180, kRounded = 0.01;
      EXPECT_LE(out, 140 * kDegree);
      EXPECT_GT(out, 140 * kDegree - kRounded);
      EXPECT_LE(in, 75 * kDegree);
      EXPECT_GT(in, 75 * kDegree - kRounded);
      continue;
    }
    EXPECT_EQ(limits.upper_rad, range.at(name.substr(3)));
    EXPECT_EQ(limits.lower_rad, -limits.upper_rad);
  }
}

TEST_P(Solo, TouchesWithItsBaseKneesAndFeetAndAllOfItIsDrawn) {
  const Robot robot = LoadSolo(GetParam().name);
  const ContactShapes<Spatial> contact = SpatialContactShapes(robot);
  EXPECT_THAT(contact.ignored, IsEmpty());
  EXPECT_EQ(contact.shapes.size(), 1U + 4 + 4);
  for (const RobotLink& link : robot.links) {
    const bool drawn = std::any_of(robot.visual_shapes.begin(), robot.visual_shapes.end(),
                                   [&](const RobotShape& s) { return s.link == link.name; });
    EXPECT_TRUE(drawn) << link.name;
  }
}

TEST_P(Solo, EnergyOfAFreeTumbleDriftsWithTheOrderOfTheMethod) {
  const Robot robot = LoadSolo(GetParam().name);
  const std::size_t n = robot.tree.dofs.size();
  HybridDynamics<Spatial> dynamics(robot.tree);
  const auto drift = [&](int steps) {
    std::mt19937_64 random(71);
    std::vector<double> q(n), qd(n), tau(n);
    for (std::size_t i = 0; i < n; ++i) {
      q[i] = Uniform(random, -0.5, 0.5);
      qd[i] = Uniform(random, -2, 2);
    }
    const auto energy = [&] {
      dynamics.SetState(q, qd);
      return dynamics.KineticEnergy() + dynamics.PotentialEnergy();
    };
    const double begin = energy(), h = 0.2 / steps;
    for (int step = 0; step < steps; ++step) {  // The classical method, whose order is four.
      constexpr std::array kAt = {0.0, 0.5, 0.5, 1.0}, kWeight = {1.0, 2.0, 2.0, 1.0};
      std::vector<double> q_sum(n), qd_sum(n), v(n), a(n);
      for (std::size_t stage = 0; stage < 4; ++stage) {
        std::vector<double> q_at(n), qd_at(n);
        for (std::size_t i = 0; i < n; ++i) {
          q_at[i] = q[i] + h * kAt[stage] * v[i];
          qd_at[i] = qd[i] + h * kAt[stage] * a[i];
        }
        dynamics.SetState(q_at, qd_at);
        dynamics.Solve(a, tau);
        v = qd_at;
        for (std::size_t i = 0; i < n; ++i) {
          q_sum[i] += h * kWeight[stage] / 6 * v[i];
          qd_sum[i] += h * kWeight[stage] / 6 * a[i];
        }
      }
      for (std::size_t i = 0; i < n; ++i) {
        q[i] += q_sum[i];
        qd[i] += qd_sum[i];
      }
    }
    return std::abs(energy() - begin);
  };
  const double coarse = drift(50), middle = drift(100), fine = drift(200);
  EXPECT_GT(std::log2(coarse / middle), 3.5) << coarse << " J, " << middle << " J";
  EXPECT_GT(std::log2(middle / fine), 3.5) << middle << " J, " << fine << " J";
  EXPECT_LT(fine, 1e-7);
}

TEST_P(Solo, InThePlaneItMovesWithEightJointsOnceTheOthersAreLocked) {
  const std::string& name = GetParam().name;
  const std::string path = testing::SourcePath("primitives/" + name + "/" + name + ".urdf");
  const RobotReview review = ReviewRobot(ReadTextFile(path), path, RootKind::kPlanarXz, {});
  EXPECT_THAT(review.mistakes, IsEmpty());
  EXPECT_THAT(review.notes, IsEmpty());
  EXPECT_THAT(review.left, IsEmpty());
  EXPECT_EQ(review.joints_left.size(), 8U);
  EXPECT_EQ(review.to_lock.size(), name == "solo12" ? 4U : 0U);
  EXPECT_TRUE(review.touches);
  EXPECT_TRUE(review.CanBePlanned());
}

INSTANTIATE_TEST_SUITE_P(Robots, Solo, ::testing::Values(Solo8(), Solo12()),
                         [](const auto& about) { return about.param.name; });

TEST(WideFeet, InThePlaneTheDynamicsAreTheTumblers) {
  const std::string path = testing::SourcePath("primitives/robots/tumbler_wide_feet.urdf");
  PlanarRobot wide = ParsePlanarRobot(ReadTextFile(path), path, RootKind::kPlanarXz);
  wide.tree.dofs[3].prescribed = wide.tree.dofs[4].prescribed = true;
  const PlanarRobot narrow = LoadTumbler();
  EXPECT_EQ(wide.own_shapes.size(), narrow.own_shapes.size() + std::size_t{2} * (2 + 1));
  // Two feet at one place in the plane: each has half of the ground.
  const ContactLaw law;
  ContactLaw half = law;
  half.stiffness_n_per_m /= 2;
  half.damping_n_s_per_m /= 2;
  const std::vector<Obstacle<Plane>> ground = {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})}};
  // The middle link's ends touch nothing at these heights.
  HybridDynamics<Plane> wide_dynamics(wide.tree), dynamics(narrow.tree);
  ContactModel<Plane> wide_contact(half, wide.shapes, ground), contact(law, narrow.shapes, ground);
  std::mt19937_64 random(72);
  std::size_t touched = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    DynamicsState s = RandomState(random, 5, 0.1);
    const bool stands = trial % 2 == 0;
    if (stands) {
      const double angle = std::acos(0.0) + Uniform(random, -0.02, 0.02);
      s.q = {Uniform(random, -1, 1), 0.2095, Uniform(random, -0.02, 0.02), -angle, angle};
    }
    DynamicsState t = s;
    wide_dynamics.SetState(s.q, s.qd);
    dynamics.SetState(t.q, t.qd);
    if (stands) {
      wide_contact.Apply(wide_dynamics);
      contact.Apply(dynamics);
      ASSERT_EQ(wide_contact.active().size(), 2 * contact.active().size());
      touched += contact.active().size();
    }
    wide_dynamics.Solve(s.qdd, s.tau);
    dynamics.Solve(t.qdd, t.tau);
    double scale = 1;
    for (const double a : t.qdd) scale = std::max(scale, std::abs(a));
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_NEAR(s.qdd[i], t.qdd[i], 1e-12 * scale);
      EXPECT_NEAR(s.tau[i], t.tau[i], 1e-12 * scale);
    }
  }
  EXPECT_GT(touched, 500U);
}

TEST(WideFeet, InSpaceTheyAreFourAtEachEndTwentyMillimetresFromThePlane) {
  const std::string path = testing::SourcePath("primitives/robots/tumbler_wide_feet.urdf");
  const Robot robot = ParseRobot(ReadTextFile(path), path, RootKind::kFloating);
  int feet = 0;
  for (const RobotShape& shape : robot.collision_shapes) {
    if (shape.link == "middle") continue;
    ++feet;
    EXPECT_EQ(std::abs(shape.pose.translation.y()), 0.02);
    EXPECT_EQ(shape.radius_m, 0.01);
  }
  EXPECT_EQ(feet, 8);
}

}  // namespace
}  // namespace tumbler
