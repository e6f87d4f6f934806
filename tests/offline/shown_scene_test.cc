// What of a robot the pages show, and as which link.

#include "offline/pages/shown_scene.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "offline/pages/motion_report.h"
#include "offline/solve/guess.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;

constexpr const char* kInertial =
    R"(<inertial><origin xyz="0 0 0.05"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>)";

/// A base, a thigh that `thigh` draws, and a shank that is a box. Of a mesh no file is there.
std::string Robot(const std::string& base, const std::string& thigh) {
  const std::string limits = R"(<axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="10" effort="10"/>)";
  return R"(<robot name="r"><link name="base">)" + std::string(kInertial) + base +
         R"(</link><link name="thigh">)" + kInertial + thigh + R"(</link><link name="shank">)" +
         kInertial + R"(<visual><geometry><box size="0.02 0.02 0.2"/></geometry></visual></link>
  <joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/>
    <origin xyz="0.1 0 -0.3"/>)" +
         limits + R"(</joint>
  <joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/>
    <origin xyz="0 0 -0.25"/>)" +
         limits + "</joint></robot>";
}

constexpr const char* kMesh =
    R"(<visual><geometry><mesh filename="package://nowhere/base.dae"/></geometry></visual>)";

Problem ProblemOf(const std::string& urdf, RootKind root) {
  Problem problem;
  problem.scene.robot = ParsePlanarRobot(urdf, "r.urdf", root);
  for (const char* joint : {"hip", "knee"}) {
    problem.joints.push_back({});
    problem.joints.back().dof = problem.scene.robot.FindDof(joint);
  }
  return problem;
}

std::vector<std::string> NamesOf(const ReportData& data) {
  std::vector<std::string> names;
  for (const ReportLink& link : data.links) names.push_back(link.name);
  return names;
}

TEST(ShownScene, TheRootIsTheFirstLinkWithAShapeOrWithout) {
  for (const RootKind root : {RootKind::kPlanarXz, RootKind::kHingeY, RootKind::kFixed}) {
    const ReportData data = ReportScene(ProblemOf(Robot(kMesh, ""), root));
    EXPECT_THAT(NamesOf(data), ElementsAre("base", "thigh", "shank"));
    EXPECT_THAT(data.joint_links, ElementsAre(1, 2)) << "no joint has the colour of the root";
  }
}

TEST(ShownScene, ABodyWithoutAShapeIsRodsToItsMassAndToWhatItCarries) {
  const ReportData data = ReportScene(ProblemOf(Robot(kMesh, ""), RootKind::kPlanarXz));
  const std::vector<ReportShape>& base = data.links[0].shapes;
  ASSERT_EQ(base.size(), 2U);
  EXPECT_THAT(base[0].corners_m, ElementsAre(ElementsAre(0, 0), ElementsAre(0, 0.05)));
  EXPECT_THAT(base[1].corners_m, ElementsAre(ElementsAre(0, 0), ElementsAre(0.1, -0.3)));
  ASSERT_EQ(data.links[1].shapes.size(), 2U);
  EXPECT_THAT(data.links[1].shapes[1].corners_m,
              ElementsAre(ElementsAre(0, 0), ElementsAre(0, -0.25)));
  ASSERT_EQ(data.links[2].shapes.size(), 1U) << "the box that it has";
  EXPECT_EQ(data.links[2].shapes[0].corners_m.size(), 4U);
}

TEST(ShownScene, ABodyThatHasOnlyAFootToTouchWithIsRodsAndTheFoot) {
  const std::string foot =
      R"(<collision><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.01"/></geometry></collision>)";
  const ReportData data = ReportScene(ProblemOf(Robot(kMesh, foot), RootKind::kPlanarXz));
  const std::vector<ReportShape>& thigh = data.links[1].shapes;
  ASSERT_EQ(thigh.size(), 4U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_FALSE(thigh[i].collides);
  EXPECT_THAT(thigh[1].corners_m, ElementsAre(ElementsAre(0, 0), ElementsAre(0, -0.2)));
  EXPECT_TRUE(thigh[3].collides);
  EXPECT_EQ(thigh[3].radius_m, 0.01);
}

TEST(ShownScene, OfAFixedRootTheBaseIsShownWhereItIs) {
  const std::string box = R"(<visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual>)";
  const Problem problem = ProblemOf(Robot(box, ""), RootKind::kFixed);
  const ReportData data = ReportScene(problem);
  ASSERT_EQ(data.links[0].shapes.size(), 1U);
  EXPECT_EQ(data.links[0].shapes[0].corners_m.size(), 4U);
  HybridDynamics<Plane> dynamics(problem.scene.robot.tree);
  MotionSample sample;
  sample.q = {0.5, 0.25};
  sample.qd = {0, 0};
  sample.torque = {0, 0};
  dynamics.SetState(sample.q, sample.qd);
  sample.dynamics = &dynamics;
  const ReportSample shown = ShownSample(problem, sample);
  ASSERT_EQ(shown.link_poses.size(), 3U);
  EXPECT_THAT(shown.link_poses[0], ElementsAre(0, 0, 0));
  EXPECT_NEAR(shown.link_poses[1][0], 0.1, 1e-12);
  EXPECT_NEAR(shown.link_poses[1][1], -0.3, 1e-12);
  EXPECT_NEAR(shown.link_poses[2][2], -0.75, 1e-12) << "the pitch is about -y";
}

TEST(MotionPage, HasATableOfTheGroundOnWhichTheModelIsAsAskedOrSaysThatItWasNotLookedFor) {
  PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  const Task task = TaskOf(file);
  Solution solution;
  solution.x = ParametersOf(file.primitive);
  GroundWindow& window = file.window.emplace();
  window.mu = {0.05, 0.474};
  window.mu_scanned = {0.05, 2};
  window.stiffness_n_per_m = {3300.2, 379000};
  window.stiffness_scanned_n_per_m = {1250, 500000};
  window.damping_n_s_per_m = {5.2, 2000};
  window.damping_scanned_n_s_per_m = {5, 2000};
  window.hold_s = 2;
  const ReportData found = MakeReportData(task, {}, solution, file);
  EXPECT_THAT(found.window.rows,
              ElementsAre(ElementsAre("friction", "0.05 or less", "0.474", "0.05 to 2"),
                          ElementsAre("stiffness [N/m]", "3300", "379000", "1250 to 500000"),
                          ElementsAre("damping [N s/m]", "5.2", "2000 or more", "5 to 2000")));
  EXPECT_THAT(found.window_note, ::testing::HasSubstr("Played in lanes with default drives"));
  file.window.reset();
  const ReportData none = MakeReportData(task, {}, solution, file);
  EXPECT_TRUE(none.window.rows.empty());
  EXPECT_THAT(none.window_note, ::testing::HasSubstr("was not looked for"));
}

}  // namespace
}  // namespace tumbler
