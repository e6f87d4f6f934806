// A robot of MJCF, read by MuJoCo and written as a URDF, moves as MuJoCo's own dynamics have it.

#include "offline/model/mjcf.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "common/files/toml_reader.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/robot.h"
#include "tests/support/files.h"
#include "tests/support/random_robot.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

/// Offsets and turned frames everywhere, two joints on one body, and one that slides.
const char* const kArm = R"(<mujoco model="arm">
  <compiler angle="radian"/>
  <option><flag contact="disable" limit="disable"/></option>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="upper" pos="0.1 -0.2 0.9" quat="0.8 0.1 -0.3 0.2">
      <joint name="yaw" type="hinge" axis="0 0 1" pos="0.02 0.01 -0.03" damping="0.2"/>
      <joint name="pitch" type="hinge" axis="0 1 0.2" pos="-0.01 0.03 0.02" range="-1 0.5" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0.3 0.1 0.1" size="0.03" mass="1.2"/>
      <body name="fore" pos="0.3 0.1 0.1" euler="0.3 -0.5 1.1">
        <joint name="elbow" type="hinge" axis="1 0 0" pos="0 0.02 0.05" damping="0.1"/>
        <geom type="box" size="0.05 0.1 0.2" pos="0 0 0.1" mass="0.7"/>
        <geom type="sphere" size="0.02" contype="0" conaffinity="0" mass="0.1"/>
        <body pos="0 0 0.3" quat="0.7 0 0.7 0">
          <joint name="slide" type="slide" axis="0 1 1" armature="0.01"/>
          <geom type="cylinder" size="0.02 0.1" mass="0.3"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="pitch" gear="3" ctrlrange="-2 1.5" ctrllimited="true"/>
    <position joint="elbow" kp="10" forcerange="-4 4" forcelimited="true"/>
  </actuator>
</mujoco>
)";

TEST(Mjcf, ARobotOfItMovesAsMuJoCosOwnDynamicsHaveIt) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "arm.xml", kArm);
  const MjcfRobot read = ReadMjcf(folder / "arm.xml", 7.0);
  Robot robot = ParseRobot(read.urdf, "arm.urdf", RootKind::kFixed);
  ASSERT_EQ(robot.tree.dofs.size(), 4U) << read.urdf;
  robot.tree.dofs[3].rotor_inertia_kg_m2 = 0.01;
  std::array<char, 300> error{};
  const std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model(
      mj_loadXML((folder / "arm.xml").c_str(), nullptr, error.data(), 300), &mj_deleteModel);
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(model.get()),
                                                               &mj_deleteData);
  HybridDynamics<Spatial> dynamics(robot.tree);
  std::mt19937_64 random(3);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<double> q, qd, tau, qdd(4);
    for (std::size_t j = 0; j < 4; ++j) {
      q.push_back(Uniform(random, -1, 1));
      qd.push_back(Uniform(random, -3, 3));
      tau.push_back(Uniform(random, -5, 5));
      data->qpos[j] = q[j];
      data->qvel[j] = qd[j];
      data->qfrc_applied[j] = tau[j];
    }
    // The servo of the elbow asks for nothing where it is.
    data->ctrl[0] = 0;
    data->ctrl[1] = q[2];
    mj_forward(model.get(), data.get());
    dynamics.SetState(q, qd);
    dynamics.Solve(qdd, tau);
    for (std::size_t j = 0; j < 4; ++j)
      EXPECT_NEAR(qdd[j], data->qacc[j], 1e-8 * (1 + std::abs(qdd[j]))) << j;
  }
}

TEST(Mjcf, LimitsAndShapesAreThoseOfTheFileAndWhatIsLeftOutIsSaid) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "arm.xml", kArm);
  const MjcfRobot read = ReadMjcf(folder / "arm.xml", std::nullopt);
  const Robot robot = ParseRobot(read.urdf, "arm.urdf", RootKind::kFixed);
  EXPECT_EQ(robot.links.front().name, "world");
  EXPECT_EQ(robot.joints[1].limits.lower_rad, -1);
  EXPECT_EQ(robot.joints[1].limits.upper_rad, 0.5);
  EXPECT_DOUBLE_EQ(robot.joints[1].limits.effort_nm, 6);
  EXPECT_DOUBLE_EQ(robot.joints[2].limits.effort_nm, 4);
  EXPECT_TRUE(robot.joints[0].continuous);
  EXPECT_EQ(robot.tree.dofs[0].damping_nm_s_per_rad, 0.2);
  EXPECT_EQ(robot.collision_shapes.size(), 3U);
  EXPECT_EQ(robot.visual_shapes.size(), 1U);
  std::string notes;
  for (const std::string& note : read.notes) notes += note + '\n';
  EXPECT_THAT(notes, HasSubstr("link 'world': a plane, height field or ellipsoid is left out"));
  EXPECT_THAT(notes, HasSubstr("limits.slide.rotor_inertia_kg_m2 = 0.01"));
  EXPECT_THAT(notes, HasSubstr("--velocity gives them"));
}

TEST(Mjcf, ABodyThatIsFreeInTheWorldIsTheRootAndABadFileIsRefusedByName) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "free.xml",
                     R"(<mujoco><worldbody><body name="base" pos="0 0 1"><freejoint/>
    <geom type="sphere" size="0.1"/><body name="leg"><joint name="hip" axis="0 1 0"/>
    <geom type="sphere" size="0.1"/></body></body></worldbody></mujoco>)");
  const Robot robot =
      ParseRobot(ReadMjcf(folder / "free.xml", 5.0).urdf, "free.urdf", RootKind::kPlanarXz);
  EXPECT_EQ(robot.links.front().name, "base");
  EXPECT_EQ(robot.tree.dofs.size(), 4U);
  testing::WriteFile(folder / "bad.xml", "<mujoco><worldbody><bdoy/></worldbody></mujoco>");
  try {
    ReadMjcf(folder / "bad.xml", 5.0);
    FAIL() << "it was taken";
  } catch (const FileError& refusal) {
    EXPECT_THAT(refusal.what(), HasSubstr("bad.xml: MuJoCo does not take it: "));
  }
}

}  // namespace
}  // namespace tumbler
