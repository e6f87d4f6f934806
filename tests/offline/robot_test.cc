// Robots in space from URDF text, compared with sums by hand. Refusals of bad files are in
// bad_input_test.cc.

#include "offline/model/robot.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "offline/model/urdf_source.h"
#include "tests/offline/robot_texts.h"
#include "tests/support/random_robot.h"
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
using testing::ParseInSpace;
using testing::Refusal;
using testing::Replaced;
using testing::RobotText;
using testing::ShippedRobot;

std::vector<std::string> NamesInFileOrder(const Robot& robot) {
  std::vector<std::string> names;
  for (const int dof : robot.file_order)
    names.push_back(robot.tree.dofs[static_cast<std::size_t>(dof)].name);
  return names;
}

TEST(Robot, CoordinatesAreTheRootsThenTheJointsExactlyInTheFilesOrder) {
  // Children before parents, branches interleaved, a fixed joint in between.
  const std::string turn = std::string("<axis xyz='1 1 0'/>") + kLimit;
  const Robot robot = ParseInSpace(RobotText(
      Link("base") + Link("a") + Link("b") + Link("c") + Link("d") + Link("e") +
      Joint("c-d", "revolute", "c", "d", turn) + Joint("a-b", "revolute", "a", "b", turn) +
      Joint("b-c", "fixed", "b", "c", "") + Joint("base-e", "prismatic", "base", "e", turn) +
      Joint("base-a", "revolute", "base", "a", turn)));
  EXPECT_EQ(NamesInFileOrder(robot),
            (std::vector<std::string>{"x", "y", "z", "pitch", "roll", "yaw", "c-d", "a-b", "base-e",
                                      "base-a"}));
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j)
    EXPECT_LT(robot.tree.dofs[j].parent, static_cast<int>(j)) << "parents come first inside";
  EXPECT_EQ(robot.FindLink("c")->body, robot.FindDof("a-b"));
  EXPECT_EQ(robot.FindLink("base")->body, 5);
  EXPECT_EQ(robot.FindLink("nobody"), nullptr);
  EXPECT_EQ(NamesInFileOrder(ParseInSpace(ShippedRobot(), RootKind::kPlanarXz)),
            (std::vector<std::string>{"x", "z", "pitch", "leg1", "leg2"}));
}

TEST(Robot, AnAxisOutOfThePlaneIsRefusedOfAPlanarRobotOnly) {
  const std::string text = RobotText(
      Link("base") + Link("a") +
      Joint("turn", "revolute", "base", "a",
            std::string("<origin rpy='0 0 1.5707963267948966'/><axis xyz='0 -2 0'/>") + kLimit));
  const Robot robot = ParseInSpace(text, RootKind::kPlanarXz);
  EXPECT_LT((robot.tree.dofs[3].axis - SpaceVector(1, 0, 0)).norm(), 1e-15);
  EXPECT_THAT(Refusal(text), HasSubstr("joint 'turn': its axis in the robot's frame is (1, "));
}

TEST(Robot, AnAngleWrittenWithFewDigitsIsTheMultipleOfARightAngleThatWasMeant) {
  const auto with = [](const std::string& rpy) {
    return RobotText(Link("base") + Link("a") +
                     Joint("turn", "revolute", "base", "a",
                           "<origin rpy='" + rpy + "'/><axis xyz='1 0 0'/>" + kLimit));
  };
  const Robot exact = ParseInSpace(with("0 0 1.5707963267948966"), RootKind::kPlanarXz);
  for (const char* rounded : {"0 0 1.5708", "0 0 1.5707", "0 0 1.570796"}) {
    const Robot robot = ParseInSpace(with(rounded), RootKind::kPlanarXz);
    EXPECT_EQ(robot.tree.dofs[3].axis, exact.tree.dofs[3].axis) << rounded;
    EXPECT_NO_THROW(ReduceToPlane(robot)) << rounded;
    const UrdfSource source(with(rounded), "robot.urdf");
    ASSERT_EQ(source.rounded_angles().size(), 1U) << rounded;
    EXPECT_EQ(source.rounded_angles()[0].key, "joint 'turn'");
    EXPECT_EQ(source.rounded_angles()[0].taken_as, "pi/2");
  }
  const std::string several = with("-4.7124 3.14159 0.00005");
  const UrdfSource source(several, "robot.urdf");
  ASSERT_EQ(source.rounded_angles().size(), 2U) << "nobody has rounded to 5e-5";
  EXPECT_EQ(Describe(source.rounded_angles()[0]), "origin rpy -4.7124 is taken as -3 pi/2");
  EXPECT_EQ(Describe(source.rounded_angles()[1]), "origin rpy 3.14159 is taken as pi");
  EXPECT_EQ(source.rounded_angles()[0].line,
            static_cast<std::uint32_t>(LineOf(several, "-4.7124")));
  for (const char* as_given : {"0 0 1.5707963267948966", "0 0 1.571", "0 0 1.5706", "0 0 0"}) {
    EXPECT_TRUE(UrdfSource(with(as_given), "robot.urdf").rounded_angles().empty()) << as_given;
  }
}

TEST(Robot, WhatNoRealRobotHasIsFoundWithItsLineAndRefusedOfAPlanarOne) {
  const std::string text = ShippedRobot();
  EXPECT_TRUE(ParseInSpace(text).findings.empty());
  struct Doubt {
    std::string from, to, problem;
  };
  for (const Doubt& doubt :
       {Doubt{"<mass value=\"1.0\"/>", "<mass value=\"0\"/>", "inertial mass is 0 kg"},
        Doubt{"iyy=\"7.5e-3", "iyy=\"9.5e-3", "inertia is that of no body"},
        Doubt{"iyy=\"", "iyy=\"-", "inertia has the principal moment -"},
        Doubt{"effort=\"8", "effort=\"0", "limit effort = 0"}}) {
    const std::string wrong = Replaced(text, doubt.from, doubt.to);
    const Robot robot = ParseInSpace(wrong);
    ASSERT_EQ(robot.findings.size(), 1U) << doubt.to;
    EXPECT_EQ(robot.findings[0].line, static_cast<std::uint32_t>(LineOf(wrong, doubt.to)));
    EXPECT_THAT(robot.findings[0].problem, HasSubstr(doubt.problem));
    EXPECT_THAT(Refusal(wrong), HasSubstr(doubt.problem));
  }
}

TEST(Robot, KeepsItsCollisionShapesInTheTermsOfTheFile) {
  const Robot robot = ParseInSpace(RobotText(
      "<link name='base'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' "
      "iyz='0' izz='1'/></inertial>"
      "<collision><origin xyz='1 2 3'/><geometry><box size='0.1 0.2 0.3'/></geometry></collision>"
      "<collision><geometry><cylinder radius='0.1' length='0.5'/></geometry></collision></link>"));
  ASSERT_EQ(robot.collision_shapes.size(), 2U);
  const RobotShape& box = robot.collision_shapes[0];
  EXPECT_EQ(box.kind, RobotShape::Kind::kBox);
  EXPECT_EQ(box.name, "base/0");
  EXPECT_EQ(box.body, 5);
  EXPECT_EQ(box.size_m, SpaceVector(0.1, 0.2, 0.3));
  EXPECT_EQ(box.pose.translation, SpaceVector(1, 2, 3));
  EXPECT_EQ(robot.collision_shapes[1].kind, RobotShape::Kind::kCylinder);
  EXPECT_EQ(robot.collision_shapes[1].length_m, 0.5);
  const ContactShapes<Spatial> contact = SpatialContactShapes(robot);
  EXPECT_TRUE(contact.ignored.empty());
  ASSERT_EQ(contact.shapes.size(), 2U);
  EXPECT_EQ(contact.shapes[0].shape.half_extents, SpaceVector(0.05, 0.1, 0.15));
  EXPECT_EQ(contact.shapes[0].shape.centre, SpaceVector(1, 2, 3));
  EXPECT_EQ(contact.shapes[1].shape.kind(), ShapeKind::kCapsule);
  EXPECT_NEAR(contact.shapes[1].shape.half_extents[0], 0.15, 1e-15);
  EXPECT_EQ(contact.shapes[1].shape.rotation * SpaceVector(1, 0, 0), SpaceVector(0, 0, 1));
}

TEST(Robot, KnowsWhichDegreesOfFreedomMoveNoMass) {
  const std::string turn = std::string("<axis xyz='0 -1 0'/>") + kLimit;
  const Robot robot = ParseInSpace(RobotText(Link("base") + Link("between") + "<link name='end'/>" +
                                             Joint("j1", "revolute", "base", "between", turn) +
                                             Joint("j2", "revolute", "between", "end", turn)));
  EXPECT_TRUE(robot.MovesMass(0));
  EXPECT_TRUE(robot.MovesMass(robot.FindDof("j1")));
  EXPECT_FALSE(robot.MovesMass(robot.FindDof("j2")));
}

TEST(Robot, TheShippedOneMovesInSpaceAsInThePlane) {
  std::mt19937_64 random(71);
  const PlanarRobot planar = LoadTumbler();
  Robot robot = ParseInSpace(ShippedRobot(), RootKind::kPlanarXz);
  robot.tree.dofs[3].prescribed = robot.tree.dofs[4].prescribed = true;
  HybridDynamics<Plane> plane(planar.tree);
  HybridDynamics<Spatial> space(robot.tree);
  for (int trial = 0; trial < 100; ++trial) {
    DynamicsState s = RandomState(random, 5), t = s;
    plane.SetState(s.q, s.qd);
    plane.Solve(s.qdd, s.tau);
    space.SetState(t.q, t.qd);
    space.Solve(t.qdd, t.tau);
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_NEAR(s.qdd[i], t.qdd[i], 1e-12 * (100 + std::abs(s.qdd[i])));
      EXPECT_NEAR(s.tau[i], t.tau[i], 1e-12 * (100 + std::abs(s.tau[i])));
    }
  }
}

/// The findings of a file that holds no robot.
std::vector<RobotFinding> MistakesOf(const std::string& text) {
  try {
    ParseInSpace(text);
  } catch (const RobotFileError& error) {
    return error.findings();
  }
  return {};
}

/// A root and a link on a joint about y.
std::string Pair(const std::string& joint, const std::string& type = "revolute",
                 const std::string& more = "") {
  return RobotText(Link("base") + Link("a") + more +
                   Joint("turn", type, "base", "a", "<axis xyz='0 -1 0'/>" + joint));
}

TEST(Robot, HasTheDampingAndDryFrictionOfItsJoints) {
  const std::string text = Pair(kLimit + std::string("<dynamics damping='0.3' friction='0.2'/>"));
  const PlanarRobot robot = Parse(text);
  EXPECT_EQ(robot.tree.dofs[3].damping_nm_s_per_rad, 0.3);
  EXPECT_EQ(robot.dry_friction_nm, (std::vector<double>{0, 0, 0, 0.2}));
  const std::string negative = Pair(kLimit + std::string("<dynamics friction='-0.2'/>"));
  EXPECT_THAT(Refusal(negative), HasSubstr("dynamics friction = -0.2; allowed: >= 0"));
}

TEST(Robot, FramesWithoutMassOnFixedJointsArePartsOfTheirBody) {
  // A frame with numbers that are all 0, and a point of mass.
  const std::string frame =
      "<link name='frame'><inertial><mass value='0'/><inertia ixx='0' ixy='0' ixz='0' iyy='0' "
      "iyz='0' izz='0'/></inertial></link>";
  const std::string point = testing::Replaced(testing::Replaced(frame, "'frame'", "'point'"),
                                              "mass value='0'", "mass value='0.5'");
  const PlanarRobot robot =
      Parse(Pair(kLimit, "revolute",
                 frame + point + Joint("f", "fixed", "a", "frame", "") +
                     Joint("p", "fixed", "frame", "point", "<origin xyz='0.2 0 0'/>")));
  EXPECT_DOUBLE_EQ(robot.tree.dofs[3].mass_kg, 1.5);
  EXPECT_NEAR(robot.tree.dofs[3].inertia_kg_m2, 0.02 + 0.2 * 0.2 / 3, 1e-12);
  // What moves is judged: a point of mass alone is no body that turns.
  const std::string alone = RobotText(
      Link("base") + point +
      Joint("turn", "revolute", "base", "point", std::string("<axis xyz='0 1 0'/>") + kLimit));
  EXPECT_THAT(Refusal(alone), HasSubstr("link 'point': inertia has the principal moment 0"));
}

TEST(Robot, ACapsuleIsTheCylinderOfTheSameOverallLength) {
  const std::string capsule =
      "<link name='end'><visual><geometry><capsule radius='0.1' length='0.3'/></geometry></visual>"
      "<collision><geometry><capsule radius='0.1' length='0.3'/></geometry></collision></link>";
  const Robot robot =
      ParseInSpace(Pair(kLimit, "revolute", capsule + Joint("f", "fixed", "a", "end", "")));
  ASSERT_EQ(robot.collision_shapes.size(), 1U);
  EXPECT_EQ(robot.collision_shapes[0].kind, RobotShape::Kind::kCylinder);
  EXPECT_EQ(robot.collision_shapes[0].radius_m, 0.1);
  EXPECT_DOUBLE_EQ(robot.collision_shapes[0].length_m, 0.5);
  EXPECT_EQ(robot.visual_shapes.size(), 1U);
  const std::string elsewhere =
      testing::Replaced(capsule, "<visual>",
                        "<collision_checking><capsule name='end'/></collision_checking><visual>");
  EXPECT_TRUE(
      MistakesOf(Pair(kLimit, "revolute", elsewhere + Joint("f", "fixed", "a", "end", ""))).empty())
      << "of others' elements nothing is known";
}

TEST(Robot, AWorldThatTheFileDoesNotHaveCarriesTheRobot) {
  const std::string text = RobotText(
      Link("base") + Link("a") + Joint("stand", "fixed", "world", "base", "") +
      Joint("turn", "revolute", "base", "a", std::string("<axis xyz='0 1 0'/>") + kLimit));
  const Robot robot = ParseInSpace(text, RootKind::kFixed);
  EXPECT_EQ(robot.links.front().name, "world");
  EXPECT_EQ(robot.links.front().mass_kg, 0);
  EXPECT_EQ(robot.tree.dofs.size(), 1U);
  const UrdfSource source(text, "robot.urdf");
  ASSERT_EQ(source.notes().size(), 1U);
  EXPECT_EQ(source.notes()[0].key, "joint 'stand'");
  // One that nothing hangs on is left out.
  EXPECT_EQ(ParseInSpace(Pair(kLimit, "revolute", "<link name='world'/>")).links.front().name,
            "base");
  EXPECT_THAT(MistakesOf(testing::Replaced(text, "'world'", "'wrld'"))[0].problem,
              HasSubstr("<parent> is the link 'wrld', which is not in the file"));
}

TEST(Robot, ATextOfXacroIsNamedWithTheCommandThatMakesAUrdfOfIt) {
  const std::string text =
      "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'>\n<xacro:include "
      "filename='x'/>\n"
      "<xacro:leg side='left'/></robot>";
  const std::vector<RobotFinding> mistakes = MistakesOf(text);
  ASSERT_EQ(mistakes.size(), 1U);
  EXPECT_EQ(mistakes[0].line, 2U);
  EXPECT_THAT(mistakes[0].problem, HasSubstr("xacro robot.urdf > robot.urdf"));
}

TEST(Robot, AllMistakesOfAFileAreNamedAtOnce) {
  const auto problems = [](const std::string& inside) {
    std::vector<std::string> all;
    for (const RobotFinding& mistake : MistakesOf(RobotText(inside)))
      all.push_back(mistake.problem);
    return all;
  };
  const std::string astray = Joint("turn", "revolute", "a", "nobody", "<limit lower='x'/>");
  EXPECT_THAT(problems(Link("a", "heavy") + astray),
              ::testing::ElementsAre(HasSubstr("<mass> value is 'heavy'"),
                                     HasSubstr("<limit> lower is 'x'"),
                                     HasSubstr("<child> is the link 'nobody'")));
  // What may only follow from a name is not named.
  EXPECT_THAT(problems("<link/>" + Link("a") + Link("a") + astray),
              ::testing::ElementsAre(HasSubstr("has no name"), HasSubstr("the name is taken"),
                                     HasSubstr("<limit> lower is 'x'")));
}

TEST(Robot, WhatOnlyATaskNeedsDoesNotKeepItFromBeingLookedAt) {
  const auto findings = [](const std::string& text) {
    std::vector<std::string> problems;
    for (const RobotFinding& finding : ParseInSpace(text).findings)
      problems.push_back(finding.problem);
    return problems;
  };
  EXPECT_THAT(findings(Pair("")), ::testing::ElementsAre("lacks <limit>"));
  EXPECT_THAT(findings(Pair("<limit lower='-1' upper='1'/>")),
              ::testing::ElementsAre("<limit> lacks the attribute effort",
                                     "<limit> lacks the attribute velocity"));
  EXPECT_THAT(findings(Pair("", "floating")),
              ::testing::ElementsAre(HasSubstr("its type is 'floating'; allowed: revolute, ")));
  EXPECT_EQ(ParseInSpace(Pair("")).joints.back().limits.effort_nm,
            std::numeric_limits<double>::infinity());
  const std::string colour = "<visual><geometry><sphere radius='1'/></geometry></visual>";
  EXPECT_TRUE(
      findings(Pair(kLimit, "revolute", "<material name='red'/><material name='red'/>")).empty())
      << "colours count for nothing: " << colour;
}

TEST(Robot, ALockedJointIsLikeAFixedOneAtThatAngle) {
  const std::string slide =
      Joint("slide", "prismatic", "b", "c", std::string("<axis xyz='1 0 0'/>") + kLimit);
  const std::string free = RobotText(
      Link("base") + Link("a", "1", "0.3") + Link("b", "2", "0.1") + Link("c", "3", "0.2") +
      Joint("turn", "revolute", "base", "a",
            std::string("<origin xyz='0.1 0 0'/><axis xyz='0 1 0'/>") + kLimit) +
      Joint("knee", "revolute", "a", "b",
            std::string("<origin xyz='0.4 0 0'/><axis xyz='0 0 2'/>") + kLimit) +
      slide);
  std::string fixed = testing::Replaced(free, "<joint name='knee' type='revolute'>",
                                        "<joint name='knee' type='fixed'>");
  fixed =
      testing::Replaced(fixed, "<origin xyz='0.4 0 0'/>", "<origin xyz='0.4 0 0' rpy='0 0 0.7'/>");
  fixed = testing::Replaced(fixed, "<joint name='slide' type='prismatic'>",
                            "<joint name='slide' type='fixed'><origin xyz='-0.25 0 0'/>");
  const Robot locked =
      ParseRobot(free, "robot.urdf", RootKind::kPlanarXz, {{"knee", 0.7}, {"slide", -0.25}});
  const Robot expected = ParseRobot(fixed, "robot.urdf", RootKind::kPlanarXz);
  ASSERT_EQ(locked.tree.dofs.size(), expected.tree.dofs.size());
  const Dof<Spatial>& a = locked.tree.dofs.back();
  const Dof<Spatial>& b = expected.tree.dofs.back();
  EXPECT_NEAR(a.mass_kg, b.mass_kg, 1e-12);
  EXPECT_LT((a.mass_centre - b.mass_centre).norm(), 1e-12);
  for (int i = 0; i < 3; ++i)
    EXPECT_LT((a.inertia_kg_m2.col(i) - b.inertia_kg_m2.col(i)).norm(), 1e-12);
  EXPECT_LT(
      (locked.FindLink("c")->pose.translation - expected.FindLink("c")->pose.translation).norm(),
      1e-12);
  ASSERT_EQ(locked.locked.size(), 2U);
  EXPECT_EQ(locked.locked[0].limits.upper_rad, 1);
}

TEST(Robot, AJointThatFollowsAnotherIsLockedWithIt) {
  const std::string turn = std::string("<axis xyz='0 1 0'/>") + kLimit;
  const std::string text =
      RobotText(Link("base") + Link("a") + Link("b") + Link("c") +
                Joint("lead", "revolute", "base", "a", turn) +
                Joint("f1", "revolute", "a", "b",
                      turn + "<mimic joint='lead' multiplier='-2' offset='0.1'/>") +
                Joint("f2", "revolute", "b", "c", turn + "<mimic joint='f1' multiplier='0.5'/>"));
  EXPECT_EQ(ParseInSpace(text).findings.size(), 2U);
  EXPECT_EQ(ParseInSpace(text).joints.back().mimics, "f1");
  EXPECT_THAT(Refusal(text), HasSubstr("joint 'f1': follows joint 'lead' (mimic)"));
  const Robot robot = ParseRobot(text, "robot.urdf", RootKind::kPlanarXz, {{"lead", 0.2}});
  ASSERT_EQ(robot.locked.size(), 3U);
  EXPECT_TRUE(robot.findings.empty());
  EXPECT_DOUBLE_EQ(robot.locked[1].position_rad, -0.3);
  EXPECT_EQ(robot.locked[1].with, "lead");
  EXPECT_DOUBLE_EQ(robot.locked[2].position_rad, -0.15);
  // Alone it cannot be held.
  const Robot one = ParseRobot(text, "robot.urdf", RootKind::kPlanarXz, {{"f1", 0.7}});
  ASSERT_EQ(one.locked.size(), 1U);
  EXPECT_EQ(one.findings.size(), 2U);
  const std::string astray =
      testing::Replaced(text, "<mimic joint='lead'", "<mimic joint='nobody'");
  EXPECT_TRUE(ParseRobot(astray, "robot.urdf", RootKind::kPlanarXz, {{"f1", 0.7}}).findings.empty())
      << "nothing moves that it follows";
  // A circle of them ends nothing but itself.
  const std::string circle =
      testing::Replaced(text, "<child link='a'/>", "<child link='a'/><mimic joint='f2'/>");
  EXPECT_EQ(ParseInSpace(circle).findings.size(), 3U);
}

TEST(Robot, ANumberIsReadWhateverWhiteSpaceIsAroundIt) {
  const std::string text = ShippedRobot();
  const Robot expected = ParseInSpace(text);
  for (const auto& [given, spaced] :
       {std::pair("mass value=\"0.4\"", "mass value=\"0.4 \""),
        std::pair("sphere radius=\"0.01\"", "sphere radius=\"\n0.01\n\""),
        std::pair("origin xyz=\"0.20 0 0.04\"", "origin xyz=\"0.20\n0\t0.04\""),
        std::pair("effort=\"8", "effort=\" 8")}) {
    ASSERT_THAT(text, HasSubstr(given));
    const Robot robot = ParseInSpace(Replaced(text, given, spaced));
    ASSERT_EQ(robot.collision_shapes.size(), expected.collision_shapes.size()) << spaced;
    for (std::size_t i = 0; i < robot.collision_shapes.size(); ++i) {
      EXPECT_EQ(robot.collision_shapes[i].radius_m, expected.collision_shapes[i].radius_m);
      EXPECT_EQ(robot.collision_shapes[i].pose.translation,
                expected.collision_shapes[i].pose.translation);
    }
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      EXPECT_EQ(robot.tree.dofs[j].mass_kg, expected.tree.dofs[j].mass_kg) << spaced;
      EXPECT_EQ(robot.joints[j].limits.effort_nm, expected.joints[j].limits.effort_nm) << spaced;
    }
  }
}

TEST(Robot, AnOriginTurnsAboutFixedAxesXThenYThenZ) {
  const auto about = [](int axis, double angle) {
    const double s = std::sin(angle), c = std::cos(angle);
    SpaceMatrix turn = SpaceMatrix::Identity();
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    turn(a, a) = turn(b, b) = c;
    turn(b, a) = s;
    turn(a, b) = -s;
    return turn;
  };
  const std::string shape =
      "<collision><origin rpy='0.3 -1.1 2.5' xyz='1 2 3'/><geometry><box size='1 1 1'/></geometry>"
      "</collision></link>";
  const Robot robot = ParseInSpace(RobotText(Replaced(Link("a"), "</link>", shape) + Link("b") +
                                             Joint("j", "continuous", "a", "b", "")));
  const SpaceMatrix expected = about(2, 2.5) * about(1, -1.1) * about(0, 0.3);
  ASSERT_EQ(robot.collision_shapes.size(), 1U);
  const Pose& pose = robot.collision_shapes[0].pose;
  EXPECT_EQ(pose.translation, SpaceVector(1, 2, 3));
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(pose.rotation(i, k), expected(i, k), 1e-15);
  }
}

TEST(Robot, WhatItNamesAndLacksIsRefusedWithItsLine) {
  const std::string robot =
      RobotText(Link("a") + Link("b") + "\n" + Joint("j", "continuous", "a", "b", "<mimic/>"));
  EXPECT_EQ(Refusal(robot), "robot.urdf:2: joint 'j': <mimic> lacks the attribute joint");
  EXPECT_EQ(Refusal(Replaced(ShippedRobot(), "<sphere radius=\"0.03\"/>", "<mesh/>")),
            fmt::format("robot.urdf:{}: link 'middle': <mesh> lacks the attribute filename",
                        LineOf(ShippedRobot(), "<sphere radius=\"0.03\"/>")));
  EXPECT_EQ(Refusal("<robot name='r' version='2.0'/>"),
            "robot.urdf:1: robot: version is '2.0'; allowed: 1.0, or none");
}

}  // namespace
}  // namespace tumbler
