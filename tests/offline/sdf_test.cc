// A robot of SDF, read by libsdformat and written as a URDF, is the robot that the file describes,
// wherever its frames are.

#include "offline/model/sdf.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/robot.h"
#include "tests/support/files.h"
#include "tests/support/random_robot.h"
#include "tests/support/random_sdf.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// What is made of a text, or the message of its refusal.
TranslatedRobot Read(const std::string& sdf, std::optional<double> velocity = 7.0) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "robot.sdf", sdf);
  return ReadSdf(folder / "robot.sdf", velocity);
}

std::string RefusalOf(const std::string& sdf) {
  try {
    return "it was taken: " + Read(sdf).urdf;
  } catch (const FileError& refusal) {
    const std::string text = refusal.what();
    return text.substr(text.find("robot.sdf"));
  }
}

std::string NotesOf(const TranslatedRobot& robot) {
  std::string notes;
  for (const std::string& note : robot.notes) notes += note + '\n';
  return notes;
}

/// Forces of both robots in random states, under random accelerations: mass matrix, velocities and
/// weight are all in them.
void ExpectSameDynamics(Tree<Spatial> one, Tree<Spatial> other, std::mt19937_64& random) {
  const std::size_t n = one.dofs.size();
  ASSERT_EQ(other.dofs.size(), n);
  for (Tree<Spatial>* tree : {&one, &other}) {
    for (Dof<Spatial>& dof : tree->dofs) dof.prescribed = true;
  }
  HybridDynamics<Spatial> first(one), second(other);
  for (int trial = 0; trial < 20; ++trial) {
    DynamicsState s = RandomState(random, n), t = s;
    first.SetState(s.q, s.qd);
    first.Solve(s.qdd, s.tau);
    second.SetState(t.q, t.qd);
    second.Solve(t.qdd, t.tau);
    double scale = 1;
    for (const double tau : s.tau) scale = std::max(scale, std::abs(tau));
    for (std::size_t j = 0; j < n; ++j) EXPECT_NEAR(s.tau[j], t.tau[j], 1e-12 * scale) << j;
  }
}

/// Link frames are not joints' frames, an inertial is turned, an axis is expressed in another
/// frame, and poses are relative to frames, links and joints.
const char* const kCrane = R"(<?xml version="1.0"?>
<!-- <mujoco> -->
<sdf version="1.9">
  <model name="crane">
    <pose>0 0 0.5 0 0 0</pose>
    <frame name="rail" attached_to="base"><pose>0 0 0.25 0 0 1.5707963267948966</pose></frame>
    <link name="base">
      <pose>0.5 0 0 0 0 0</pose>
      <inertial><mass>3</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial>
    </link>
    <link name="boom">
      <pose relative_to="rail">1 0 0 1.5707963267948966 0 0</pose>
      <inertial>
        <pose>0 0.5 0 0 0 1.5707963267948966</pose>
        <mass>2</mass>
        <inertia><ixx>0.2</ixx><iyy>0.3</iyy><izz>0.4</izz><ixy>0.01</ixy><ixz>0.02</ixz><iyz>0.03</iyz></inertia>
      </inertial>
      <collision name="c">
        <pose>0 0.5 0 0 0 0</pose>
        <geometry><box><size>0.25 1 0.125</size></box></geometry>
      </collision>
    </link>
    <link name="hook">
      <pose relative_to="slide"/>
      <inertial><mass>0.5</mass><inertia><ixx>0.001</ixx><iyy>0.002</iyy><izz>0.002</izz></inertia></inertial>
      <collision name="ball"><geometry><sphere><radius>0.0625</radius></sphere></geometry></collision>
      <visual name="look"><geometry><capsule><radius>0.02</radius><length>0.1</length></capsule></geometry></visual>
    </link>
    <joint name="feet" type="fixed"><parent>world</parent><child>base</child></joint>
    <joint name="swing" type="revolute">
      <pose relative_to="boom">0 0.25 0 0 0 0</pose>
      <parent>base</parent><child>boom</child>
      <axis>
        <xyz expressed_in="rail">1 0 0</xyz>
        <limit><lower>-1</lower><upper>0.5</upper><effort>6</effort><velocity>3</velocity></limit>
        <dynamics><damping>0.2</damping><friction>0.1</friction></dynamics>
      </axis>
    </joint>
    <joint name="slide" type="prismatic">
      <pose relative_to="boom">0 1 0 0 0 0</pose>
      <parent>boom</parent><child>hook</child>
      <axis><xyz>0 1 0</xyz><limit><lower>0</lower><upper>0.25</upper></limit></axis>
    </joint>
  </model>
</sdf>
)";
/// The same, by hand. Of boom x is the world's y, y is its z, and z its x, as those of the joint
/// are.
const char* const kCraneByHand = R"(<robot name="crane">
  <link name="world"/>
  <link name="base">
    <inertial><mass value="3"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
  </link>
  <link name="boom">
    <inertial>
      <origin xyz="0 0.25 0"/>
      <mass value="2"/>
      <inertia ixx="0.3" ixy="-0.01" ixz="-0.03" iyy="0.2" iyz="0.02" izz="0.4"/>
    </inertial>
  </link>
  <link name="hook">
    <inertial><mass value="0.5"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.002"/></inertial>
  </link>
  <joint name="feet" type="fixed">
    <parent link="world"/><child link="base"/><origin xyz="0.5 0 0.5"/>
  </joint>
  <joint name="swing" type="revolute">
    <parent link="base"/><child link="boom"/>
    <origin xyz="0 1 0.5" rpy="1.5707963267948966 0 1.5707963267948966"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="0.5" effort="6" velocity="3"/>
    <dynamics damping="0.2" friction="0.1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="boom"/><child link="hook"/>
    <origin xyz="0 0.75 0"/><axis xyz="0 1 0"/><limit lower="0" upper="0.25" effort="1" velocity="7"/>
  </joint>
</robot>
)";

TEST(Sdf, ARobotOfItIsTheOneThatIsWrittenByHand) {
  const TranslatedRobot read = Read(kCrane);
  const Robot robot = ParseRobot(read.urdf, "crane.urdf", RootKind::kFixed);
  const Robot by_hand = ParseRobot(kCraneByHand, "by_hand.urdf", RootKind::kFixed);
  std::mt19937_64 random(4);
  ExpectSameDynamics(robot.tree, by_hand.tree, random);
  EXPECT_EQ(robot.name, "crane");
  EXPECT_EQ(robot.links.front().name, "world");
  ASSERT_EQ(robot.joints.size(), 2U);
  EXPECT_EQ(robot.joints[0].limits.lower_rad, -1);
  EXPECT_EQ(robot.joints[0].limits.upper_rad, 0.5);
  EXPECT_EQ(robot.joints[0].limits.effort_nm, 6);
  EXPECT_EQ(robot.joints[0].limits.velocity_rad_s, 3);
  EXPECT_EQ(robot.joints[0].dry_friction_nm, 0.1);
  EXPECT_EQ(robot.joints[1].limits.velocity_rad_s, 7);
  EXPECT_EQ(robot.tree.dofs[0].damping_nm_s_per_rad, 0.2);
  ASSERT_EQ(robot.collision_shapes.size(), 2U);
  EXPECT_EQ(robot.collision_shapes[0].size_m, SpaceVector(0.25, 1, 0.125));
  // It is half a metre up the boom, a quarter of which is below the joint.
  EXPECT_NEAR(robot.collision_shapes[0].pose.translation.z(), 0.25, 1e-15);
  EXPECT_EQ(robot.collision_shapes[1].radius_m, 0.0625);
  EXPECT_EQ(robot.visual_shapes.size(), 1U);
}

TEST(Sdf, RandomRobotsMoveAsTheirPosesInTheWorldHaveIt) {
  std::mt19937_64 random(17);
  for (int trial = 0; trial < 25; ++trial) {
    const RandomSdf made = RandomSdfMaker(random).Make();
    const Robot robot = ParseRobot(Read(made.text).urdf, "random.urdf", RootKind::kFixed);
    ASSERT_TRUE(robot.locked.empty());
    ExpectSameDynamics(robot.tree, made.tree, random);
    if (HasFailure()) FAIL() << made.text;
  }
}

// ---- what is taken, noted and refused -----------------------------------------------------------

std::string Model(const std::string& content) {
  return "<sdf version='1.9'>\n<model name='m'>\n" + content + "\n</model></sdf>\n";
}
std::string Fixed(const std::string& name, const std::string& parent, const std::string& child) {
  return fmt::format("<joint name='{}' type='fixed'><parent>{}</parent><child>{}</child></joint>\n",
                     name, parent, child);
}

TEST(Sdf, WhatAUrdfHasNotIsSaidInALineEach) {
  const TranslatedRobot read = Read(R"(<sdf version="1.9"><world name="w">
    <gravity>0 0 -1.6</gravity>
    <model name="a"><static>true</static><pose>1 2 3 0 0 0</pose>
    <plugin name="p" filename="p.so"/><plugin name="q" filename="q.so"/>
    <link name="x"><inertail/><sensor name="s" type="imu"/>
      <visual name="v">
        <geometry><mesh><uri>model://a/v.stl</uri><scale>1 2 3</scale></mesh></geometry>
        <material><ambient>1 0 0 1</ambient></material></visual>
      <collision name="c"><geometry><plane/></geometry><surface/></collision></link>
    <link name="y"><gravity>0</gravity></link><link name="z"/>
    <joint name="j" type="revolute"><parent>x</parent><child>y</child>
      <axis><xyz>0 0 1</xyz><dynamics><spring_stiffness>3</spring_stiffness></dynamics></axis></joint>
    <joint name="k" type="ball"><parent>x</parent><child>z</child></joint></model>
    <model name="b"><link name="x"/></model></world></sdf>)",
                                    std::nullopt);
  const std::string notes = NotesOf(read);
  for (const char* const note :
       {"robot.sdf:5: XML Element[inertail]", "the world's gravity of 0 0 -1.6 is left out",
        "the model 'a' is taken, which has joints, and not 'b'",
        "link 'x': the shape 'c' is left out: a URDF has no <plane>",
        "SDF has 1 kg and 1 kg m^2: 'x', 'y', 'z'\n", "link 'y' has no <gravity>", "is <static>",
        "joint 'j': its spring of 3 is left out", "joint 'k' is of the type ball",
        "left out: materials (1)\n", "left out: plugins (2): 'p', 'q'\n",
        "left out: sensors (1): 's'\n", "left out: surfaces", "--velocity gives it"})
    EXPECT_THAT(notes, HasSubstr(note));
  // Its root hangs on the world where the model stands.
  const Robot robot = ParseRobot(read.urdf, "a.urdf", RootKind::kFixed);
  EXPECT_EQ(robot.links.front().name, "world");
  EXPECT_EQ(robot.FindLink("x")->pose.translation, SpaceVector(1, 2, 3));
  EXPECT_EQ(robot.held_joints, std::vector<std::string>{"k"});
  ASSERT_EQ(robot.visual_shapes.size(), 1U);
  EXPECT_EQ(robot.visual_shapes.front().mesh_file, "package://a/v.stl");
  EXPECT_EQ(robot.visual_shapes.front().mesh_scale, SpaceVector(1, 2, 3));
}

/// A world of these models.
std::string WorldOf(const std::string& models) {
  return "<sdf version='1.9'><world name='w'>" + models + "</world></sdf>";
}

/// A model of two links with a joint between them.
std::string ModelWithJoint(const std::string& name, const std::string& joint) {
  return "<model name='" + name + "'><link name='x'/><link name='y'/><joint name='j' type='" +
         joint +
         "'><parent>x</parent><child>y</child><axis><xyz>0 1 0</xyz></axis></joint></model>";
}

TEST(Sdf, OfAWorldTheModelWithJointsIsTakenWhereverItStands) {
  // A table of two links, glued, is no robot.
  const std::string ground = "<model name='ground'><static>1</static><link name='g'/></model>";
  const TranslatedRobot read =
      Read(WorldOf(ground + ModelWithJoint("table", "fixed") + ModelWithJoint("arm", "revolute")));
  EXPECT_THAT(read.urdf, HasSubstr("<robot name=\"arm\">"));
  EXPECT_THAT(NotesOf(read), HasSubstr("the model 'arm' is taken, which has joints, and not "
                                       "'ground', 'table'"));
  // What is wrong in its text is found there, too, and nothing of models that are not taken.
  const std::string lamp = "<model name='lamp'><link name='l'><inertial auto='1'/></link></model>";
  EXPECT_THAT(Read(WorldOf(ground + lamp + ModelWithJoint("arm", "revolute"))).urdf,
              HasSubstr("<robot name=\"arm\">"));
  EXPECT_THAT(RefusalOf(WorldOf(
                  ground + testing::Replaced(ModelWithJoint("arm", "revolute"), "0 1 0", "0 0 0"))),
              HasSubstr("joint 'j': <xyz> is '0 0 0'"));
}

TEST(Sdf, SeveralModelsWithJointsAreRefusedByName) {
  EXPECT_THAT(
      RefusalOf(WorldOf(ModelWithJoint("left", "revolute") + ModelWithJoint("right", "prismatic"))),
      HasSubstr("robot.sdf: several models have joints, and a robot is one of them: 'left', "
                "'right'; put the one that is meant into a file of its own"));
  EXPECT_THAT(RefusalOf("<sdf version='1.9'><model name='a'><link name='x'/></model>" +
                        ModelWithJoint("b", "revolute") + "</sdf>"),
              HasSubstr("model 'b': has joints, but libsdformat takes the first model of <sdf> "
                        "alone, 'a'"));
}

TEST(Sdf, OfSeveralModelsWithoutJointsTheFirstIsTakenAndTheOthersAreNamed) {
  const TranslatedRobot read = Read(
      "<sdf version='1.9'><model name='a'><link name='x'/></model>"
      "<model name='b'><link name='y'/></model></sdf>");
  EXPECT_THAT(read.urdf, HasSubstr("<robot name=\"a\">"));
  EXPECT_THAT(read.urdf, Not(HasSubstr("\"y\"")));
  EXPECT_THAT(NotesOf(read),
              HasSubstr("the model 'a' is taken, the first, as none has joints, and not 'b'"));
}

TEST(Sdf, AModelInAModelIsPartOfIt) {
  const Robot robot = ParseRobot(Read(Model(R"(<link name="base"/>
    <model name="arm"><pose>0 0 1 0 0 0</pose><link name="hand"><pose>0.5 0 0 0 0 0</pose></link>
    <frame name="grip" attached_to="hand"><pose>0 0 0.25 0 0 0</pose></frame></model>
    <link name="tip"><pose relative_to="arm::grip"/></link>
    <joint name="lift" type="prismatic"><parent>base</parent><child>arm::grip</child>
      <axis><xyz>0 0 1</xyz><limit><lower>0</lower></limit></axis></joint>)" +
                                            Fixed("end", "arm::hand", "tip")))
                                     .urdf,
                                 "m.urdf", RootKind::kFixed);
  ASSERT_EQ(robot.tree.dofs.size(), 1U);
  // Both links move with the joint, which is at the frame `grip`.
  EXPECT_EQ(robot.tree.dofs[0].offset, SpaceVector(0.5, 0, 1.25));
  EXPECT_EQ(robot.tree.dofs[0].mass_kg, 2);
  EXPECT_NE(robot.FindLink("arm::hand"), nullptr);
  EXPECT_EQ(robot.joints[0].limits.lower_rad, 0);
  EXPECT_EQ(robot.joints[0].limits.upper_rad, 1000);
}

TEST(Sdf, AnIncludeIsLookedForInFoldersAloneAndBadOnesAreRefused) {
  const testing::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "wheel");
  testing::WriteFile(folder / "wheel/model.config",
                     "<model><name>wheel</name><sdf version='1.9'>wheel.sdf</sdf></model>");
  testing::WriteFile(folder / "wheel/wheel.sdf", R"(<sdf version='1.9'><model name='wheel'>
    <link name='hub'><visual name='v'><geometry><mesh><uri>hub.stl</uri></mesh></geometry></visual>
    </link></model></sdf>)");
  testing::WriteFile(folder / "robot.sdf",
                     Model("<link name='b'/><include><uri>model://wheel</uri></include>" +
                           Fixed("j", "b", "wheel::hub")));
  const std::string urdf = ReadSdf(folder / "robot.sdf", 1.0).urdf;
  EXPECT_THAT(urdf, HasSubstr("<child link=\"wheel::hub\"/>"));
  EXPECT_THAT(urdf, HasSubstr("<mesh filename=\"" + (folder / "wheel/hub.stl") + "\"/>"));
  for (const char* const uri :
       {"https://fuel.gazebosim.org/1.0/x/models/wheel", "model://absent"}) {
    EXPECT_THAT(
        RefusalOf(Model(fmt::format("<link name='b'/>\n<include><uri>{}</uri></include>", uri))),
        HasSubstr(
            fmt::format("robot.sdf:4: libsdformat does not take it: Unable to find uri[{}]", uri)));
  }
}

TEST(Sdf, FilesThatIncludeThemselvesOrTooManyAreRefused) {
  const testing::TemporaryFolder folder;
  const auto include = [](const std::string& file) {
    return "<include><uri> " + file + " </uri></include>\n";
  };
  const auto refusal = [&] {
    try {
      return ReadSdf(folder / "robot.sdf", 1.0).urdf;
    } catch (const FileError& error) {
      return std::string(error.what());
    }
  };
  testing::WriteFile(folder / "robot.sdf", Model("<link name='b'/>\n" + include("other.sdf")));
  testing::WriteFile(folder / "other.sdf", Model("<!-- \n -->" + include("robot.sdf")));
  EXPECT_THAT(refusal(), HasSubstr("other.sdf:4: <include>: 'robot.sdf' leads back to this file"));
  // Ten of each, three deep.
  std::string ten;
  for (int k = 0; k < 10; ++k) ten += include("NEXT.sdf");
  for (const auto& [file, next] :
       {std::pair("robot", "a"), std::pair("a", "b"), std::pair("b", "c")}) {
    std::string text = ten;
    for (std::size_t at = 0; (at = text.find("NEXT")) != std::string::npos;)
      text.replace(at, 4, next);
    testing::WriteFile(folder / (std::string(file) + ".sdf"), Model(text));
  }
  testing::WriteFile(folder / "c.sdf", Model("<link name='c'/>"));
  EXPECT_THAT(refusal(), HasSubstr("<include>: there are more than 1000 of them in all"));
  // One that is commented out is none.
  testing::WriteFile(folder / "robot.sdf",
                     Model("<link name='b'/><!-- " + include("robot.sdf") + "-->"));
  EXPECT_THAT(refusal(), HasSubstr("<robot name=\"m\">"));
}

TEST(Sdf, WhatIsNoTreeIsRefusedByNameAndLine) {
  const std::string links = "<link name='x'/>\n<link name='y'/>\n<link name='z'/>\n";
  EXPECT_THAT(
      RefusalOf(Model(links + Fixed("j", "x", "y") + Fixed("k", "y", "z") + Fixed("l", "x", "z"))),
      HasSubstr("robot.sdf:8: joint 'l': its <child> 'z' is already that of joint 'k' (line 7)"));
  EXPECT_THAT(RefusalOf(Model(links + Fixed("j", "x", "y") + Fixed("k", "y", "x"))),
              HasSubstr("robot.sdf:3: link 'x': the joints above it lead back to itself"));
  EXPECT_THAT(RefusalOf(Model(links + Fixed("j", "x", "y"))),
              HasSubstr("robot.sdf:5: link 'z': no joint carries it, and none carries 'x'"));
  EXPECT_THAT(
      RefusalOf(Model(links + Fixed("j", "x", "y") + Fixed("k", "world", "z"))),
      HasSubstr("robot.sdf:3: link 'x': no joint carries it, and others hang on the world"));
}

TEST(Sdf, BadFilesAreRefusedByLineAndInTheLibrarysWords) {
  const std::pair<std::string, const char*> bad[] = {
      {"<sdf version='1.9'>\n<model name='m'>\n<link>\n</sdf>\n", "XML_ERROR_MISMATCHED_ELEMENT"},
      {"<sdf version='1.9'></sdf>", "robot.sdf: there is no <model> in it"},
      {"<sdf version='1.9'><world name='w'/></sdf>", "there is no <model> in it"},
      {"<sdf version='1.9'><model name='m'/></sdf>", "A model must have at least one link."},
      {Model("<link name='x'><pose>0 nan 0 0 0 0</pose></link>"),
       "robot.sdf:3: libsdformat does not take it: Pose values must be finite."},
      {Model("<link name='x'>\n<inertial><mass>nan</mass></inertial></link>"),
       "robot.sdf:3: libsdformat does not take it: A link named x has invalid inertia."},
      {Model("<link name='x'><collision name='c'><geometry><sphere><radius>inf</radius></sphere>"
             "</geometry></collision></link>"),
       "robot.sdf:3: link 'x': a size of a shape is inf; allowed: a finite number"},
      {Model("<link name='x'><pose relative_to='y'/></link>\n<link name='y'>"
             "<pose relative_to='x'/></link>"),
       "cycle"},
      {Model(
           "<frame name='f' attached_to='g'/>\n<frame name='g' attached_to='f'/><link name='x'/>"),
       "robot.sdf:3: libsdformat does not take it: FrameAttachedToGraph cycle detected"},
      {Model("<link name='x'/><link name='y'/><joint name='j' type='revolute'><parent>x</parent>"
             "<child>y</child><axis><xyz>0 0 0</xyz></axis></joint>"),
       "robot.sdf:3: joint 'j': <xyz> is '0 0 0'; allowed: a direction"},
      {Model("<link name='x'/><link name='y'/><joint name='j' type='revolute'><parent>x</parent>"
             "<child>y</child><axis><xyz>0 0 "
             "1</xyz><limit><lower>nan</lower></limit></axis></joint>"),
       "robot.sdf:3: joint 'j': an end of <limit> is NaN"},
      {Model("<link name='x'/><link name='y'/><joint name='j' type='revolute'><parent>x</parent>"
             "<child>y</child></joint>"),
       "lacks <axis>"},
      {Model("<link name='x'/>\n" + Fixed("j", "x", "absent")), "robot.sdf:4: "},
  };
  for (const auto& [text, message] : bad) EXPECT_THAT(RefusalOf(text), HasSubstr(message)) << text;
}

const char* const kInertial =
    "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>";

/// Links x and y, and the joint j between them, in line 4.
std::string Jointed(const std::string& axis, const std::string& type = "revolute") {
  return Model(
      fmt::format("<link name='x'/><link name='y'/>\n<joint name='j' type='{}'><parent>x</parent>"
                  "<child>y</child><axis>{}</axis></joint>",
                  type, axis));
}
std::string Limited(const std::string& limit) {
  return Jointed("<xyz>0 0 1</xyz><limit>" + limit + "</limit>");
}

TEST(Sdf, AnInertialThatGazeboWouldFindIsRefused) {
  for (const char* const yes : {"true", "1"}) {
    EXPECT_THAT(RefusalOf(fmt::format("<sdf version='1.11'><model name='m'>\n<link name='b'>"
                                      "<inertial auto='{}'><density>500</density></inertial>"
                                      "</link></model></sdf>",
                                      yes)),
                HasSubstr(fmt::format("robot.sdf:2: link 'b': <inertial auto='{}'>: masses are not "
                                      "found from shapes and densities here. Give <mass> and "
                                      "<inertia>",
                                      yes)));
  }
  // Not of a model that is not taken.
  EXPECT_THAT(RefusalOf(fmt::format("<sdf version='1.9'><world name='w'><model name='m'>"
                                    "<link name='a'>{}</link></model><model name='n'>"
                                    "<link name='b'><inertial auto='true'/></link></model>"
                                    "</world></sdf>",
                                    kInertial)),
              HasSubstr("it was taken"));
}

TEST(Sdf, EveryDefaultOfAnInertialIsNoted) {
  const auto notes = [](const std::string& inertial) {
    return NotesOf(Read(Model("<link name='b'><inertial>" + inertial + "</inertial></link>")));
  };
  EXPECT_THAT(notes("<mass>2</mass>"),
              HasSubstr("without <inertia>, for which SDF has 1 kg m^2: 'b'\n"));
  EXPECT_THAT(notes("<inertia><iyy>1</iyy><izz>1</izz></inertia>"),
              AllOf(HasSubstr("without <mass>, for which SDF has 1 kg: 'b'\n"),
                    HasSubstr("without <ixx>, for which SDF has 1 kg m^2: 'b'\n"),
                    HasSubstr("without <ixy>, <ixz> or <iyz>, for which SDF has 0: 'b'\n"),
                    Not(HasSubstr("<iyy>"))));
  EXPECT_EQ(notes("<mass>2</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz><ixy>0</ixy>"
                  "<ixz>0</ixz><iyz>0</iyz></inertia>"),
            "");
}

TEST(Sdf, VersionsThatTheLibraryCannotConvertAreRefusedAndNewerOnesNoted) {
  const auto of = [](const std::string& attribute) {
    return fmt::format("<!-- -->\n<sdf{}>\n<model name='m'><link name='b'>{}</link></model></sdf>",
                       attribute, kInertial);
  };
  for (const char* const version : {"1.0", "1.1", "0.9", "1", "1.x", "new", ""}) {
    EXPECT_THAT(
        RefusalOf(of(fmt::format(" version='{}'", version))),
        HasSubstr(fmt::format("robot.sdf:2: <sdf>: version = '{}'; allowed: 1.2 to 1.9", version)));
  }
  EXPECT_THAT(RefusalOf(of("")), HasSubstr("robot.sdf:2: <sdf>: lacks 'version'; allowed: 1.2 to"));
  for (const char* const version : {"1.2", "1.5", "1.9"}) {
    EXPECT_THAT(NotesOf(Read(of(fmt::format(" version='{}'", version)))), Not(HasSubstr("newer")));
  }
  EXPECT_THAT(NotesOf(Read(of(" version='1.11'"))),
              HasSubstr("robot.sdf: its version 1.11 is newer than 1.9"));
}

TEST(Sdf, AJointThatFollowsAnotherIsNotedToMoveForItself) {
  EXPECT_THAT(NotesOf(Read(Jointed("<xyz>0 0 1</xyz><mimic joint='k'><multiplier>2</multiplier>"
                                   "</mimic>"))),
              HasSubstr("joint 'j': its <mimic> is left out: the joint moves for itself\n"));
}

TEST(Sdf, EndsOfJointsAreThoseOfTheFileAndNeverCross) {
  const auto written = [](const std::string& limit) { return Read(Limited(limit)).urdf; };
  EXPECT_THAT(written("<lower>2000</lower><upper>3000</upper>"),
              HasSubstr("lower=\"2000\" upper=\"3000\""));
  EXPECT_THAT(written("<lower>2000</lower>"), HasSubstr("lower=\"2000\" upper=\"3000\""));
  EXPECT_THAT(written("<upper>-5</upper>"), HasSubstr("lower=\"-1005\" upper=\"-5\""));
  EXPECT_THAT(NotesOf(Read(Limited("<lower>-1</lower>"))),
              HasSubstr("joint 'j': its <limit> has no upper end: 1000 is written\n"));
  EXPECT_THAT(RefusalOf(Limited("<lower>1</lower><upper>-1</upper>")),
              HasSubstr("robot.sdf:4: joint 'j': <lower> is 1 and <upper> is -1; allowed"));
}

TEST(Sdf, TheJointOfAStaticModelGetsANameThatNoOtherHas) {
  const std::string urdf =
      Read(Model("<static>1</static><link name='b'/><link name='c'/><joint name='b_mount' "
                 "type='continuous'><parent>b</parent><child>c</child><axis><xyz>0 1 0</xyz></axis>"
                 "</joint>"))
          .urdf;
  EXPECT_THAT(urdf, HasSubstr("<joint name=\"b_mount_\""));
  EXPECT_EQ(ParseRobot(urdf, "m.urdf", RootKind::kFixed).links.size(), 3U);
}

TEST(Sdf, AxesWithoutADirectionAndSizesNotAboveZeroAreRefused) {
  for (const char* const axis : {"1e300 1e300 0", "1e-300 1e-300 0", "0 0 0", "0 1e-4 0"}) {
    EXPECT_THAT(RefusalOf(Jointed(fmt::format("<xyz>{}</xyz>", axis))),
                HasSubstr(fmt::format("robot.sdf:4: joint 'j': <xyz> is '{}'; allowed: a direction",
                                      axis)));
  }
  EXPECT_THAT(RefusalOf(Jointed("<xyz>0 -0.002 0</xyz>")), HasSubstr("axis xyz=\"0 -1 0\""));
  const std::pair<const char*, const char*> shapes[] = {
      {"<sphere><radius>-0.05</radius></sphere>", "<radius> is '-0.05'"},
      {"<cylinder><radius>0</radius><length>1</length></cylinder>", "<radius> is '0'"},
      {"<capsule><radius>1</radius><length>-1</length></capsule>", "<length> is '-1'"},
      {"<box><size>1 0 1</size></box>", "<size> is '1 0 1'"}};
  for (const auto& [shape, message] : shapes) {
    EXPECT_THAT(
        RefusalOf(Model(fmt::format("<link name='b'>\n<collision name='c'><geometry>{}"
                                    "</geometry></collision></link>",
                                    shape))),
        HasSubstr(fmt::format("robot.sdf:4: link 'b': {}; allowed: sizes above 0", message)));
  }
}

TEST(Sdf, ATextOfNumbersIsNumbersAsAWhole) {
  const auto link = [](const char* content) {
    return Model(fmt::format("<link name='b'>\n{}</link>", content));
  };
  const std::pair<std::string, const char*> bad[] = {
      {link("<inertial><mass>1,5</mass></inertial>"), "4: link 'b': <mass> is '1,5'; allowed: a n"},
      {link("<inertial><mass>1.5kg</mass></inertial>"), "4: link 'b': <mass> is '1.5kg'"},
      {link("<inertial><mass>1 5</mass></inertial>"), "4: link 'b': <mass> is '1 5'"},
      {link("<inertial><mass/></inertial>"), "4: link 'b': <mass> is ''"},
      {link("<inertial><inertia><iyy>1e</iyy></inertia></inertial>"), "4: link 'b': <iyy> is '1e'"},
      {link("<pose>0,1 0 0.5 0 0 0</pose>"),
       "4: link 'b': <pose> is '0,1 0 0.5 0 0 0'; allowed: "
       "numbers, which '0,1' is not"},
      {link("<visual name='v'><geometry><box><size>1 1</size></box></geometry></visual>"),
       "4: link 'b': <size> is '1 1'; allowed: 3 numbers"},
      {Limited("<lower>-1rad</lower>"), "4: joint 'j': <lower> is '-1rad'"},
      {Limited("<effort>5;</effort>"), "4: joint 'j': <effort> is '5;'"},
      {Jointed("<xyz>0 0 1 0</xyz>"), "4: joint 'j': <xyz> is '0 0 1 0'; allowed: 3 numbers"}};
  for (const auto& [text, message] : bad)
    EXPECT_THAT(RefusalOf(text), HasSubstr(std::string("robot.sdf:") + message)) << text;
  // Signs, exponents, infinities and spaces are those of numbers, and a plugin has its own.
  EXPECT_THAT(RefusalOf(Model("<plugin name='p' filename='f'><pose>here</pose></plugin>"
                              "<link name='x'/><link name='y'><pose> +1 -.5\n1.E1 0 0 0 </pose>"
                              "</link><joint name='j' type='revolute'><parent>x</parent>"
                              "<child>y</child><axis><xyz>0 0 +1</xyz><limit><lower>-inf</lower>"
                              "<upper>1e16</upper></limit></axis></joint>")),
              AllOf(HasSubstr("origin xyz=\"1 -0.5 10\""), HasSubstr("type=\"continuous\"")));
}

TEST(Sdf, AnUnknownTypeOfJointIsRefusedWithThoseThatThereAre) {
  EXPECT_THAT(RefusalOf(Jointed("<xyz>0 0 1</xyz>", "bogus")),
              HasSubstr("robot.sdf:4: joint 'j': its type is 'bogus'; allowed: revolute, "));
  EXPECT_THAT(RefusalOf(Model("<link name='x'/><link name='y'/>\n<joint name='j'><parent>x</parent>"
                              "<child>y</child></joint>")),
              HasSubstr("robot.sdf:4: libsdformat does not take it: "));
}

TEST(Sdf, OfSeveralCausesTheFirstIsSaidAndHowManyFollow) {
  EXPECT_THAT(
      RefusalOf(Model("<link name='x'><pose>0 0 1</pose></link>")),
      ::testing::ContainsRegex("robot.sdf:3: libsdformat does not take it: The value for "
                               "[^;]* 3 were found instead in '0 0 1'. \\(and [0-9]+ more\\)$"));
}

TEST(Sdf, JointsWithoutALimitOfEffortAreNoted) {
  EXPECT_THAT(NotesOf(Read(Limited("<lower>-1</lower><upper>1</upper>"))),
              HasSubstr("1 of 1 joints have no limit of effort"));
  EXPECT_THAT(NotesOf(Read(Limited("<effort>3</effort>"))), Not(HasSubstr("limit of effort")));
}

TEST(Sdf, FilesOfMoreFramesThanTheLibraryCanHoldAreRefusedBeforeItHasThem) {
  std::string frames = "<link\nname='l0'/>";
  for (int k = 1; k <= 3000; ++k)
    frames += fmt::format("<frame\tname='l{}' attached_to='l{}'/>", k, k - 1);
  EXPECT_THAT(RefusalOf(Model(frames)),
              HasSubstr("there are 3002 links, joints, frames and models in all; allowed: at most "
                        "3000"));
}

TEST(Sdf, NothingIsWrittenIntoTheHomeFolder) {
  const testing::TemporaryFolder home;
  // NOLINTNEXTLINE(concurrency-mt-unsafe)
  setenv("HOME", home.path().c_str(), 1);
  Read(kCrane);
  EXPECT_TRUE(std::filesystem::is_empty(home.path()));
  EXPECT_EQ(std::getenv("HOME"), home.path().string());  // NOLINT(concurrency-mt-unsafe)
}

TEST(Sdf, AFileIsKnownByItsOutermostElement) {
  const testing::TemporaryFolder folder;
  const auto is = [&](const std::string& text) {
    testing::WriteFile(folder / "file", text);
    return IsSdf(folder / "file");
  };
  EXPECT_TRUE(is(kCrane));
  EXPECT_TRUE(is("<sdf>"));
  EXPECT_TRUE(is("<?xml version='1.0'?><!DOCTYPE sdf>\n<!-- <a> --><sdf\nversion='1.9'/>"));
  for (const char* const other :
       {"", "<", "<!-- <sdf>", "<?xml", "<sdfx/>", "<sdf", "<mujoco/>", "<robot><sdf/></robot>"})
    EXPECT_FALSE(is(other)) << other;
}

}  // namespace
}  // namespace tumbler
