// A robot of MJCF, read by MuJoCo and written as a URDF, moves as MuJoCo's own dynamics have it.

#include "offline/model/mjcf.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/robot.h"
#include "tests/support/files.h"
#include "tests/support/random_robot.h"
#include "tests/support/solo_robot.h"

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
  const TranslatedRobot read = ReadMjcf(folder / "arm.xml", 7.0);
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
  const TranslatedRobot read = ReadMjcf(folder / "arm.xml", std::nullopt);
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

/// Solo12 as MuJoCo's own reader of URDF has it, on a joint that is free. Where it touches, and how
/// far its joints go, counts for nothing.
class SoloInMuJoCo {
 public:
  SoloInMuJoCo() {
    std::string urdf = ReadTextFile(testing::SourcePath("primitives/solo12/solo12.urdf"));
    // Links without an <inertial> are not to be weighed by their shapes.
    urdf.insert(urdf.rfind("</robot>"), R"(
      <mujoco><compiler inertiafromgeom="false"/></mujoco>
      <link name="world"/>
      <joint name="root" type="floating"><parent link="world"/><child link="base_link"/></joint>
    )");
    testing::WriteFile(folder_ / "solo12.urdf", urdf);
    std::array<char, 300> error{};
    model_.reset(mj_loadXML((folder_ / "solo12.urdf").c_str(), nullptr, error.data(), 300));
    if (model_ == nullptr) throw std::runtime_error(error.data());
    mj_saveLastXML((folder_ / "solo12.xml").c_str(), model_.get(), error.data(), 300);
    model_->opt.disableflags |= mjDSBL_CONTACT | mjDSBL_LIMIT;
    data_.reset(mj_makeData(model_.get()));
  }

  /// The same robot as MuJoCo writes it.
  [[nodiscard]] std::string mjcf() const { return folder_ / "solo12.xml"; }
  [[nodiscard]] mjModel& model() const { return *model_; }
  [[nodiscard]] mjData& data() const { return *data_; }

  /// Takes over a state. MuJoCo's root has a velocity in the world, and turns in its own axes.
  void Set(const Robot& robot, HybridDynamics<Spatial>& dynamics, const std::vector<double>& q,
           const std::vector<double>& qd) const {
    dynamics.SetState(q, qd);
    const SpaceMatrix& R = dynamics.rotation(kBase).m;
    const std::array rows = {R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1),
                             R(1, 2), R(2, 0), R(2, 1), R(2, 2)};
    std::copy(q.begin(), q.begin() + 3, data_->qpos);
    mju_mat2Quat(data_->qpos + 3, rows.data());
    const SpaceVector v = dynamics.velocity(kBase).v,
                      w = R.TransposeTimes(dynamics.velocity(kBase).w);
    for (int i = 0; i < 3; ++i) {
      data_->qvel[i] = v[i];
      data_->qvel[3 + i] = w[i];
    }
    for (std::size_t j = kFloatingDofs; j < q.size(); ++j) {
      const int joint = mj_name2id(model_.get(), mjOBJ_JOINT, robot.tree.dofs[j].name.c_str());
      data_->qpos[model_->jnt_qposadr[joint]] = q[j];
      data_->qvel[model_->jnt_dofadr[joint]] = qd[j];
    }
  }

  /// The largest difference of positions [m, rad] and of the base's axes.
  [[nodiscard]] double Distance(const Robot& robot, HybridDynamics<Spatial>& dynamics,
                                const std::vector<double>& q, const std::vector<double>& qd) const {
    dynamics.SetState(q, qd);
    double distance = 0;
    const auto note = [&](double a, double b) { distance = std::max(distance, std::abs(a - b)); };
    for (int i = 0; i < 3; ++i) note(q[Index(i)], data_->qpos[i]);
    const SpaceMatrix R =
        Pose::RotationOf(data_->qpos[4], data_->qpos[5], data_->qpos[6], data_->qpos[3]);
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) note(dynamics.rotation(kBase).m(i, k), R(i, k));
    }
    for (std::size_t j = kFloatingDofs; j < q.size(); ++j) {
      const int joint = mj_name2id(model_.get(), mjOBJ_JOINT, robot.tree.dofs[j].name.c_str());
      note(q[j], data_->qpos[model_->jnt_qposadr[joint]]);
    }
    return distance;
  }

  static constexpr int kBase = kFloatingDofs - 1;

 private:
  const testing::TemporaryFolder folder_;
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model_{nullptr, &mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_{nullptr, &mj_deleteData};
};

TEST(Mjcf, Solo12FallsAndTumblesAsItDoesInMuJoCo) {
  const SoloInMuJoCo mujoco;
  const Robot robot = LoadSolo("solo12");
  const std::size_t n = robot.tree.dofs.size();
  ASSERT_EQ(mujoco.model().nv, static_cast<int>(n));
  HybridDynamics<Spatial> dynamics(robot.tree);
  std::mt19937_64 random(8);
  std::vector<double> q(n), qd(n), tau(n);
  for (std::size_t i = 0; i < n; ++i) {
    q[i] = Uniform(random, -0.5, 0.5);
    qd[i] = Uniform(random, -2, 2);
  }
  mujoco.Set(robot, dynamics, q, qd);
  mujoco.model().opt.integrator = mjINT_RK4;
  mujoco.model().opt.timestep = 1e-3;
  const double h = mujoco.model().opt.timestep;
  for (int step = 0; step < 500; ++step) {  // The classical method here, too.
    constexpr std::array kAt = {0.0, 0.5, 0.5, 1.0}, kWeight = {1.0, 2.0, 2.0, 1.0};
    std::vector<double> q_sum = q, qd_sum = qd, v(n), a(n);
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
    q = q_sum;
    qd = qd_sum;
    mj_step(&mujoco.model(), &mujoco.data());
  }
  EXPECT_LT(q[2], -0.5);
  EXPECT_LT(mujoco.Distance(robot, dynamics, q, qd), 1e-4);
}

TEST(Mjcf, AFloatingRobotOfItMovesAsInMuJoCo) {
  const SoloInMuJoCo mujoco;
  const Robot robot =
      ParseRobot(ReadMjcf(mujoco.mjcf(), 80.0).urdf, "solo12.urdf", RootKind::kFloating);
  const std::size_t n = robot.tree.dofs.size();
  ASSERT_EQ(n, 18U);
  HybridDynamics<Spatial> dynamics(robot.tree);
  std::mt19937_64 random(9);
  for (int trial = 0; trial < 100; ++trial) {
    DynamicsState s = RandomState(random, n);
    s.q[4] = Uniform(random, -1, 1);  // of roll, away from the singularity
    std::fill(s.tau.begin(), s.tau.begin() + kFloatingDofs, 0.0);
    mujoco.Set(robot, dynamics, s.q, s.qd);
    const auto dof_of = [&](std::size_t j) {
      return mujoco.model()
          .jnt_dofadr[mj_name2id(&mujoco.model(), mjOBJ_JOINT, robot.tree.dofs[j].name.c_str())];
    };
    for (std::size_t j = kFloatingDofs; j < n; ++j)
      mujoco.data().qfrc_applied[dof_of(j)] = s.tau[j];
    mj_forward(&mujoco.model(), &mujoco.data());
    dynamics.Solve(s.qdd, s.tau);
    // MuJoCo writes six digits of each number.
    double tolerance = 1e-5;
    for (const double a : s.qdd) tolerance = std::max(tolerance, 1e-5 * std::abs(a));
    for (std::size_t j = kFloatingDofs; j < n; ++j)
      EXPECT_NEAR(s.qdd[j], mujoco.data().qacc[dof_of(j)], tolerance) << j;
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(s.qdd[i], mujoco.data().qacc[i], tolerance) << i;
  }
}

}  // namespace
}  // namespace tumbler
