// A point of a link: where it is, how fast, and the derivatives of both.

#include "offline/problem/link_point.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "tests/support/random_robot.h"

namespace tumbler {
namespace {

using Axis = LinkPoint::Axis;
using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi;

/// A random robot with a link somewhere on each body.
PlanarRobot RandomRobot(std::mt19937_64& random) {
  PlanarRobot robot;
  robot.tree = RandomTree(random);
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    PlanarLink link;
    link.name = "link" + std::to_string(j);
    link.body = static_cast<int>(j);
    link.origin_m = {Uniform(random, -0.5, 0.5), Uniform(random, -0.5, 0.5)};
    const double turn = Uniform(random, -3, 3);
    link.x_axis = {std::cos(turn), std::sin(turn)};
    link.z_axis = {-std::sin(turn), std::cos(turn)};
    robot.links.push_back(link);
  }
  return robot;
}

/// A random point of a random link of a random robot, in a random state.
struct RandomPoint {
  explicit RandomPoint(std::uint64_t seed) : random(seed), robot(RandomRobot(random)) {
    const std::size_t n = robot.tree.dofs.size();
    link = robot.links[random() % n];
    in_link = {Uniform(random, -0.5, 0.5), Uniform(random, -0.5, 0.5)};
    point = PointOfLink(robot, link.name, in_link);
    const DynamicsState state = RandomState(random, n);
    q = state.q;
    qd = state.qd;
  }
  std::mt19937_64 random;
  PlanarRobot robot;
  PlanarLink link;
  std::array<double, 2> in_link{};
  LinkPoint point;
  std::vector<double> q, qd;
};

TEST(LinkPoint, IsWhereTheDynamicsHaveItsLinkAndMovesWithIt) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const RandomPoint r(seed);
    HybridDynamics<Plane> dynamics(r.robot.tree);
    dynamics.SetState(r.q, r.qd);
    const Plane::Vector in_body = {
        r.link.origin_m[0] + r.link.x_axis[0] * r.in_link[0] + r.link.z_axis[0] * r.in_link[1],
        r.link.origin_m[1] + r.link.x_axis[1] * r.in_link[0] + r.link.z_axis[1] * r.in_link[1]};
    const Plane::Vector place =
        dynamics.position(r.link.body) + dynamics.rotation(r.link.body) * in_body;
    const Plane::Vector velocity = dynamics.velocity(r.link.body).At(place);
    EXPECT_NEAR(r.point.Value(Axis::kX, false, r.q, r.qd), dynamics.origin().x() + place.x(),
                1e-12);
    EXPECT_NEAR(r.point.Value(Axis::kZ, false, r.q, r.qd), dynamics.origin().y() + place.y(),
                1e-12);
    EXPECT_NEAR(r.point.Value(Axis::kX, true, r.q, r.qd), velocity.x(), 1e-12);
    EXPECT_NEAR(r.point.Value(Axis::kZ, true, r.q, r.qd), velocity.y(), 1e-12);
  }
}

TEST(LinkPoint, HasTheDerivativesOfCentralDifferences) {
  constexpr double kStep = 1e-5, kScale = 0.7;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const RandomPoint r(seed);
    const std::size_t n = r.q.size();
    for (const Axis axis : {Axis::kX, Axis::kZ}) {
      for (const bool rate : {false, true}) {
        std::vector<double> by_q(n), by_qd(n);
        r.point.AddSlopes(axis, rate, kScale, r.q, r.qd, by_q, by_qd);
        for (std::size_t i = 0; i < n; ++i) {
          const auto difference = [&](bool of_velocity) {
            std::vector<double> q = r.q, qd = r.qd;
            double& moved = of_velocity ? qd[i] : q[i];
            const double middle = moved;
            moved = middle + kStep;
            const double above = r.point.Value(axis, rate, q, qd);
            moved = middle - kStep;
            return kScale * (above - r.point.Value(axis, rate, q, qd)) / (2 * kStep);
          };
          EXPECT_NEAR(by_q[i], difference(false), 1e-7) << "seed " << seed << " dof " << i;
          EXPECT_NEAR(by_qd[i], difference(true), 1e-7) << "seed " << seed << " dof " << i;
        }
      }
    }
  }
}

TEST(LinkPoint, MovesAtTheRateAtWhichItsPlaceChanges) {
  constexpr double kStep_s = 1e-5;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const RandomPoint r(seed);
    for (const Axis axis : {Axis::kX, Axis::kZ}) {
      const auto place_after = [&](double dt) {
        std::vector<double> q = r.q;
        for (std::size_t i = 0; i < q.size(); ++i) q[i] += dt * r.qd[i];
        return r.point.Value(axis, false, q, r.qd);
      };
      EXPECT_NEAR(r.point.Value(axis, true, r.q, r.qd),
                  (place_after(kStep_s) - place_after(-kStep_s)) / (2 * kStep_s), 1e-6);
    }
  }
}

/// A root with an arm on a joint whose own frame is turned, and a hand that is fixed to the arm at
/// a right angle.
constexpr const char* kArm = R"(<robot name="arm">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="arm"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="hand"/>
  <link name="rolled"/>
  <link name="stand"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/>
    <origin xyz="0.1 0 0.2" rpy="0 -1.5707963267948966 0"/><axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" velocity="10" effort="10"/></joint>
  <joint name="wrist" type="fixed"><parent link="arm"/><child link="hand"/>
    <origin xyz="0.5 0 0" rpy="0 1.5707963267948966 0"/></joint>
  <joint name="roll" type="fixed"><parent link="arm"/><child link="rolled"/>
    <origin xyz="0.5 0 0" rpy="1.5707963267948966 0 0"/></joint>
  <joint name="foot" type="fixed"><parent link="base"/><child link="stand"/></joint>
</robot>)";

TEST(LinkPoint, IsInTheFrameThatTheFileGivesItsLinkAlsoBehindFixedJoints) {
  const PlanarRobot robot = ParsePlanarRobot(kArm, "arm.urdf", RootKind::kPlanarXz);
  const std::vector<double> rest(4, 0.0);
  const auto at = [&](const char* link, std::array<double, 2> point, double angle) {
    std::vector<double> q = rest;
    q[0] = 1;
    q[1] = 2;
    q[3] = angle;
    const LinkPoint p = PointOfLink(robot, link, point);
    return std::array<double, 2>{p.Value(Axis::kX, false, q, rest),
                                 p.Value(Axis::kZ, false, q, rest)};
  };
  const auto expect_at = [](const std::array<double, 2>& is, double x, double z) {
    EXPECT_NEAR(is[0], x, 1e-12);
    EXPECT_NEAR(is[1], z, 1e-12);
  };
  expect_at(at("base", {0.3, 0.4}, 0.7), 1.3, 2.4);
  // The joint's frame is turned from x to z by a quarter: the arm's x points up, its z to the left.
  expect_at(at("arm", {0.5, 0}, 0), 1.1, 2.7);
  expect_at(at("arm", {0, 0.5}, 0), 0.6, 2.2);
  // The hand is turned back by a quarter at the arm's end.
  expect_at(at("hand", {0.05, 0.02}, 0), 1.15, 2.72);
  // The axis is -y, so that a positive angle turns from x to z: the arm to the left.
  expect_at(at("arm", {0.5, 0}, kPi / 2), 0.6, 2.2);
  expect_at(at("hand", {0.05, 0.02}, kPi / 2), 0.6 - 0.02, 2.2 + 0.05);
}

std::string ReasonAgainst(const PlanarRobot& robot, const char* link) {
  try {
    static_cast<void>(PointOfLink(robot, link, {0, 0}));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(LinkPoint, OfALinkThatIsNoneNeverMovesOrLeavesThePlaneIsRefused) {
  const PlanarRobot free = ParsePlanarRobot(kArm, "arm.urdf", RootKind::kPlanarXz);
  EXPECT_THAT(ReasonAgainst(free, "leg"),
              HasSubstr("no link of the robot; allowed: base, stand, arm, rolled, hand"));
  EXPECT_THAT(ReasonAgainst(free, "rolled"), HasSubstr("out of the robot's x-z plane"));
  EXPECT_EQ(ReasonAgainst(free, "stand"), "");
  const PlanarRobot fixed = ParsePlanarRobot(kArm, "arm.urdf", RootKind::kFixed);
  EXPECT_THAT(ReasonAgainst(fixed, "stand"), HasSubstr("never moves, because the root is fixed"));
  EXPECT_EQ(ReasonAgainst(fixed, "hand"), "");
}

}  // namespace
}  // namespace tumbler
