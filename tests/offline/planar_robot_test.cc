// Robots in the plane from URDF text, compared with sums by hand. Refusals of bad files are in
// bad_input_test.cc.

#include "offline/model/planar_robot.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "tests/offline/robot_texts.h"
#include "tests/support/task_files.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Joint;
using testing::kLimit;
using testing::LineOf;
using testing::Link;
using testing::Parse;
using testing::Refusal;
using testing::Replaced;
using testing::RobotText;
using testing::ShippedRobot;

TEST(PlanarRobot, OfTheShippedFileIsThatOfItsDescription) {
  const PlanarRobot robot = Parse(ShippedRobot());
  EXPECT_EQ(robot.name, "tumbler");
  ASSERT_EQ(robot.tree.dofs.size(), 5U);
  EXPECT_EQ(robot.root_dofs, 3);
  EXPECT_EQ(robot.FindDof("leg1"), 3);
  EXPECT_EQ(robot.FindDof("leg2"), 4);
  EXPECT_EQ(robot.FindDof("pitch"), -1) << "the root's coordinates are no joints";
  EXPECT_EQ(robot.FindDof("leg3"), -1);
  double mass = 0;
  for (const auto& dof : robot.tree.dofs) mass += dof.mass_kg;
  EXPECT_DOUBLE_EQ(mass, 1.8);
  EXPECT_NEAR(robot.tree.dofs[3].inertia_kg_m2, 0.4 * 0.2 * 0.2 / 12, 1e-12);
  EXPECT_NEAR(robot.tree.dofs[3].offset.x(), 0.15, 1e-15);
  EXPECT_NEAR(robot.tree.dofs[3].mass_centre.x(), 0.1, 1e-15);
  EXPECT_EQ(robot.tree.dofs[3].axis, 1) << "grows with pitch";
  EXPECT_EQ(robot.shapes.size(), 6U);
  EXPECT_TRUE(robot.ignored_shapes.empty());
  EXPECT_EQ(robot.limits[3].effort_nm, 8);
  EXPECT_EQ(robot.limits[4].lower_rad, -2.9);
}

TEST(PlanarRobot, LinksOnFixedJointsAreMergedWithTheirInertia) {
  const PlanarRobot robot = Parse(RobotText(
      Link("base") + Link("a", "2", "0.1") + Link("b", "3", "0.2") +
      Joint("fix", "fixed", "a", "b", "<origin xyz='0.5 0 0.4'/>") +
      Joint("turn", "revolute", "base", "a", std::string("<axis xyz='0 -1 0'/>") + kLimit)));
  ASSERT_EQ(robot.tree.dofs.size(), 4U);
  const auto& dof = robot.tree.dofs[3];
  EXPECT_DOUBLE_EQ(dof.mass_kg, 5);
  const double cx = (2 * 0.1 + 3 * 0.7) / 5, cz = 3 * 0.4 / 5;
  EXPECT_NEAR(dof.mass_centre.x(), cx, 1e-12);
  EXPECT_NEAR(dof.mass_centre.y(), cz, 1e-12);
  EXPECT_NEAR(dof.inertia_kg_m2,
              0.02 + 0.02 + 2 * (std::pow(0.1 - cx, 2) + cz * cz) +
                  3 * (std::pow(0.7 - cx, 2) + std::pow(0.4 - cz, 2)),
              1e-12);
}

TEST(PlanarRobot, AFixedRootHasNoCoordinatesAndItsOwnMassDoesNotCount) {
  const PlanarRobot robot = Parse(RobotText(Link("base") + Link("a") +
                                            Joint("turn", "revolute", "base", "a",
                                                  std::string("<axis xyz='0 1 0'/>") + kLimit)),
                                  RootKind::kFixed);
  ASSERT_EQ(robot.tree.dofs.size(), 1U);
  EXPECT_EQ(robot.root_dofs, 0);
  EXPECT_EQ(robot.tree.dofs[0].parent, -1);
  EXPECT_EQ(robot.tree.dofs[0].axis, -1) << "about +y is against pitch";
  EXPECT_EQ(robot.FindDof("turn"), 0);
}

TEST(PlanarRobot, JointsKeepTheFilesOrderNotTheAlphabets) {
  const std::string turn = std::string("<axis xyz='0 -1 0'/>") + kLimit;
  const PlanarRobot robot = Parse(RobotText(Link("base") + Link("l1") + Link("l2") + Link("l3") +
                                            Joint("zulu", "revolute", "base", "l1", turn) +
                                            Joint("mike", "revolute", "base", "l2", turn) +
                                            Joint("alpha", "revolute", "base", "l3", turn)));
  EXPECT_EQ(robot.tree.dofs[3].name, "zulu");
  EXPECT_EQ(robot.tree.dofs[4].name, "mike");
  EXPECT_EQ(robot.tree.dofs[5].name, "alpha");
}

TEST(PlanarRobot, ContinuousJointsHaveNoEndsAndPrismaticOnesADirection) {
  const PlanarRobot robot = Parse(RobotText(
      Link("base") + Link("a") + Link("b") +
      Joint("spin", "continuous", "base", "a", "<axis xyz='0 -1 0'/>") +
      Joint("slide", "prismatic", "base", "b",
            std::string("<origin rpy='0 -1.5707963267948966 0'/><axis xyz='1 0 0'/>") + kLimit)));
  EXPECT_EQ(robot.limits[3].lower_rad, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(robot.limits[3].effort_nm, std::numeric_limits<double>::infinity());
  EXPECT_NEAR(robot.tree.dofs[4].direction.x(), 0, 1e-12);
  EXPECT_NEAR(robot.tree.dofs[4].direction.y(), 1, 1e-12) << "x turned by -pi/2 about y points up";
}

TEST(PlanarRobot, ShapesThatContactDoesNotUseAreListedWithTheirLine) {
  const std::string text =
      Replaced(ShippedRobot(), "<sphere radius=\"0.03\"/>", "<mesh filename=\"a.stl\"/>");
  const PlanarRobot robot = Parse(text);
  EXPECT_EQ(robot.shapes.size(), 5U);
  ASSERT_EQ(robot.ignored_shapes.size(), 1U);
  EXPECT_EQ(robot.ignored_shapes[0].link, "middle");
  EXPECT_EQ(robot.ignored_shapes[0].line,
            static_cast<std::uint32_t>(LineOf(text, "<link name=\"middle\"")));
  EXPECT_EQ(robot.ignored_shapes[0].shape, "middle/0");
  EXPECT_EQ(robot.ignored_shapes[0].reason, "is a mesh");
}

TEST(PlanarRobot, LinksThatPassThroughTheGroundAreNamed) {
  EXPECT_EQ(LinksWithoutContact(Parse(ShippedRobot())), "");
  const std::string hopper = testing::SourcePath("tests/data/robots/hopper.urdf");
  EXPECT_EQ(LinksWithoutContact(Parse(testing::ReadFile(hopper))), "shank, thigh");
}

/// A robot whose only link has these collision elements.
std::string WithCollisions(const std::string& elements) {
  return RobotText(
      "<link name='base'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' "
      "iyz='0' izz='1'/></inertial>" +
      elements + "</link>");
}
std::string Collision(const std::string& geometry, const std::string& rpy = "0 0 0") {
  return "<collision><origin xyz='1 2 3' rpy='" + rpy + "'/><geometry><" + geometry +
         "/></geometry></collision>";
}

TEST(PlanarRobot, ContactSeesTheOutlinesOfCollisionShapesInThePlane) {
  const std::string quarter = "1.5707963267948966";
  const PlanarRobot robot = Parse(WithCollisions(
      Collision("sphere radius='0.1'") + Collision("cylinder radius='0.1' length='0.5'") +
      Collision("cylinder radius='0.1' length='0.05'", quarter + " 0 0") +
      Collision("cylinder radius='0.1' length='0.6'", "0.5235987755982988 0 0") +
      Collision("box size='0.4 0.2 0.6'", "0 0.3 0") +
      Collision("box size='0.4 0.2 0.6'", "0 0 " + quarter) +
      Collision("cylinder radius='0.1' length='0.1'") +
      Collision("box size='0.4 0.2 0.6'", "0.1 0 0")));
  ASSERT_EQ(robot.shapes.size(), 6U);
  for (const auto& own : robot.shapes) {
    EXPECT_EQ(own.body, 2);
    EXPECT_LT((own.shape.centre - Plane::Vector(1, 3)).norm(), 1e-15);
  }
  const auto shape = [&](std::size_t i) { return robot.shapes[i].shape; };
  EXPECT_EQ(shape(0).kind(), ShapeKind::kSphere);
  EXPECT_EQ(shape(0).radius_m, 0.1);
  EXPECT_EQ(shape(1).kind(), ShapeKind::kCapsule);
  EXPECT_NEAR(shape(1).half_extents.x(), 0.15, 1e-15) << "0.5 m in all, the round ends included";
  EXPECT_LT((shape(1).rotation * Plane::Vector(1, 0) - Plane::Vector(0, 1)).norm(), 1e-12);
  EXPECT_EQ(shape(2).kind(), ShapeKind::kSphere) << "along y: a disc";
  EXPECT_NEAR(shape(3).half_extents.x(), 0.2 * std::cos(0.5235987755982988), 1e-12) << "tilted";
  EXPECT_EQ(shape(4).kind(), ShapeKind::kBox);
  EXPECT_EQ(shape(4).radius_m, 0);
  // Turned about y: a corner of the outline is where the box has an edge.
  const Spatial::Vector corner =
      Spatial::RotationBy(Spatial::Vector::UnitY(), 0.3) * Spatial::Vector(0.2, 0, 0.3);
  double nearest = 1;
  for (const double x : {-1.0, 1.0}) {
    for (const double z : {-1.0, 1.0}) {
      const Plane::Vector at = shape(4).rotation * Plane::Vector(x * shape(4).half_extents.x(),
                                                                 z * shape(4).half_extents.y());
      nearest = std::min(nearest, (at - Plane::Vector(corner.x(), corner.z())).norm());
    }
  }
  EXPECT_LT(nearest, 1e-12);
  const Plane::Vector sides = shape(5).half_extents;
  EXPECT_NEAR(std::min(sides.x(), sides.y()), 0.1, 1e-12) << "what was along x is along y now";
  EXPECT_NEAR(std::max(sides.x(), sides.y()), 0.3, 1e-12);
  ASSERT_EQ(robot.ignored_shapes.size(), 2U);
  EXPECT_EQ(robot.ignored_shapes[0].shape, "base/6");
  EXPECT_THAT(robot.ignored_shapes[0].reason, HasSubstr("is a cylinder shorter than wide"));
  EXPECT_EQ(robot.ignored_shapes[1].shape, "base/7");
  EXPECT_THAT(robot.ignored_shapes[1].reason, HasSubstr("is a box without a side along y"));
}

TEST(PlanarRobot, AJointThatMovesNoMassIsRefusedButAMasslessLinkBetweenIsNot) {
  const std::string turn = std::string("<axis xyz='0 -1 0'/>") + kLimit;
  const std::string two_joints = Joint("j1", "revolute", "base", "between", turn) +
                                 Joint("j2", "revolute", "between", "end", turn);
  EXPECT_EQ(Refusal(RobotText(Link("base") + "<link name='between'/>" + Link("end") + two_joints)),
            "");
  EXPECT_THAT(
      Refusal(RobotText(Link("base") + Link("between") + "<link name='end'/>" + two_joints)),
      HasSubstr("link 'end': degree of freedom 'j2' moves no mass"));
}

TEST(PlanarRobot, AxisMayBeWrittenAtAnyLengthAndInATurnedFrame) {
  const auto with = [](const std::string& origin, const std::string& axis) {
    return Refusal(RobotText(
        Link("base") + Link("a") +
        Joint("j", "revolute", "base", "a",
              fmt::format("<origin rpy='{}'/><axis xyz='{}'/>{}", origin, axis, kLimit))));
  };
  EXPECT_EQ(with("0 0 0", "0 -5 0"), "");
  EXPECT_EQ(with("1.5707963267948966 0 0", "0 0 1"), "") << "z of the joint is -y of the robot";
  EXPECT_THAT(with("1.5707963267948966 0 0", "0 1 0"), HasSubstr("joint 'j'"));
}

TEST(PlanarRobot, MoreDegreesOfFreedomThanFitAreRefused) {
  std::string inside = Link("l0");
  for (int i = 1; i <= 20; ++i) {
    inside += Link(fmt::format("l{}", i));
    inside += Joint(fmt::format("j{}", i), "revolute", fmt::format("l{}", i - 1),
                    fmt::format("l{}", i), std::string("<axis xyz='0 -1 0'/>") + kLimit);
  }
  EXPECT_THAT(Refusal(RobotText(inside)), HasSubstr("degrees of freedom"));
}

TEST(PlanarRobot, NumbersMayHavePlusSignsAndExtraBlanks) {
  EXPECT_EQ(
      Refusal(Replaced(ShippedRobot(), "origin xyz=\"0.15 0 0\"", "origin xyz=\" +0.15  0 0 \"")),
      "");
}

}  // namespace
}  // namespace tumbler
