// A motion in space in MuJoCo's physics: its own dynamics, reader of URDFs, and contact.

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "common/files/primitive_toml.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/programs/mjcf.h"
#include "offline/scene/normal.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

/// By how much a robot differs from the model: factors.
struct Variation {
  std::vector<double> mass;
  double friction = 1;
};

/// A robot of a primitive in MuJoCo, on a floor, with the drives that the primitive names.
class RobotInMuJoCo {
 public:
  /// @param contact_s  time constant of MuJoCo's contact (solref).
  /// @param period_s   with which the drives get setpoints.
  RobotInMuJoCo(const PrimitiveFile& file, const Problem& problem, double contact_s,
                double period_s)
      : file_(file), problem_(problem), period_s_(period_s) {
    std::string urdf = file.provenance.robot_urdf;
    urdf.insert(urdf.rfind("</robot>"), R"(
      <mujoco><compiler inertiafromgeom="false"/></mujoco>
      <link name="world"/>
      <joint name="root" type="floating"><parent link="world"/><child link="base_link"/></joint>
    )");
    testing::WriteFile(folder_ / "robot.urdf", urdf);
    const Model robot = Load("robot.urdf");
    std::array<char, 300> error{};
    mj_saveLastXML((folder_ / "robot.xml").c_str(), robot.get(), error.data(), 300);
    std::string scene = testing::ReadFile(folder_ / "robot.xml");
    const std::string begin = "<worldbody>";
    scene.insert(scene.find(begin) + begin.size(),
                 R"(<geom name="floor" type="plane" size="5 5 0.1"/>)");
    testing::WriteFile(folder_ / "scene.xml", scene);
    model_ = Load("scene.xml");
    const int floor = mj_name2id(model_.get(), mjOBJ_GEOM, "floor");
    const auto geoms = static_cast<std::size_t>(model_->ngeom);
    for (std::size_t i = 0; i < geoms; ++i) {  // Nothing touches but the floor.
      model_->geom_contype[i] = static_cast<int>(i) == floor ? 0 : 1;
      model_->geom_conaffinity[i] = static_cast<int>(i) == floor ? 1 : 0;
      model_->geom_solref[mjNREF * i] = contact_s;
    }
    constexpr double kViscous_nm_s_per_rad = 0.02;  // as drives in the model have it
    for (std::size_t i = 6; i < Index(model_->nv); ++i) {
      model_->dof_armature[i] =
          problem.space->scene.robot.tree.dofs[Index(problem.joints.front().dof)]
              .rotor_inertia_kg_m2;
      model_->dof_damping[i] = kViscous_nm_s_per_rad;
    }
    model_->opt.timestep = 5e-4;
    model_->opt.integrator = mjINT_IMPLICIT;
    masses_.assign(model_->body_mass, model_->body_mass + model_->nbody);
    inertias_.assign(model_->body_inertia,
                     model_->body_inertia + std::ptrdiff_t{3} * model_->nbody);
    for (const JointMotion<double>& motion : file.primitive.motions()) {
      const std::string name(motion.name.view());
      const int joint = mj_name2id(model_.get(), mjOBJ_JOINT, name.c_str());
      position_at_.push_back(model_->jnt_qposadr[joint]);
      velocity_at_.push_back(model_->jnt_dofadr[joint]);
    }
  }

  [[nodiscard]] mjModel& model() { return *model_; }

  /// Lets the robot stand, plays the motion, and holds its end. @returns whether every position and
  /// misalignment of the root that the task asks for settled within its tolerance.
  bool Play(const Variation& variation) {
    Vary(variation);
    const Data data(mj_makeData(model_.get()), &mj_deleteData);
    Place(*data);
    const double lead_s = 0.5, end_s = lead_s + problem_.duration_s + problem_.settle_s;
    std::array<double, 2> start{};
    bool started = false;
    while (data->time < end_s) {
      if (!started && data->time >= lead_s) {
        start = {data->qpos[0], data->qpos[1]};
        started = true;
      }
      Drive(*data, data->time - lead_s);
      mj_step(model_.get(), data.get());
    }
    return AsAsked(*data, start);
  }

 private:
  using Model = std::unique_ptr<mjModel, decltype(&mj_deleteModel)>;
  using Data = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

  [[nodiscard]] Model Load(const std::string& name) const {
    std::array<char, 300> error{};
    Model model(mj_loadXML((folder_ / name).c_str(), nullptr, error.data(), 300), &mj_deleteModel);
    if (model == nullptr) throw std::runtime_error(error.data());
    return model;
  }

  void Vary(const Variation& variation) {
    for (std::size_t i = 0; i < Index(model_->ngeom); ++i)
      model_->geom_friction[3 * i] = problem_.contact().mu * variation.friction;
    for (std::size_t b = 1; b < masses_.size(); ++b) {
      const double factor = b - 1 < variation.mass.size() ? variation.mass[b - 1] : 1;
      model_->body_mass[b] = factor * masses_[b];
      for (std::size_t k = 3 * b; k < 3 * b + 3; ++k)
        model_->body_inertia[k] = factor * inertias_[k];
    }
  }

  void Place(mjData& data) const {
    data.qpos[0] = file_.entry.root_x_m;
    data.qpos[1] = file_.entry.root_y_m;
    data.qpos[2] = file_.entry.root_z_m + 1e-3;
    std::ranges::copy(file_.entry.root_quaternion, data.qpos + 3);
    for (std::size_t j = 0; j < position_at_.size(); ++j)
      data.qpos[position_at_[j]] = file_.entry.joint_positions_rad[j];
  }

  /// The torques of drives whose setpoints come once a period, 0.3 ms late.
  void Drive(mjData& data, double time_s) const {
    constexpr double kDelay_s = 3e-4;
    const double tick_s = period_s_ * std::floor((time_s - kDelay_s) / period_s_);
    const double t = std::clamp(tick_s, 0.0, problem_.duration_s);
    const bool moves = tick_s >= 0 && tick_s < problem_.duration_s;
    const DriveGains gains = problem_.drive_gains();
    for (std::size_t j = 0; j < position_at_.size(); ++j) {
      const JointMotion<double>& motion = file_.primitive.joints[j];
      const auto path = motion.position.Evaluate(t);
      const double torque =
          gains.kp_nm_per_rad * (path.value - data.qpos[position_at_[j]]) +
          gains.kd_nm_s_per_rad * ((moves ? path.first : 0) - data.qvel[velocity_at_[j]]) +
          motion.torque.Evaluate(t).value;
      const double limit = motion.limits.torque_max_nm;
      data.qfrc_applied[velocity_at_[j]] = std::clamp(torque, -limit, limit);
    }
  }

  /// @param start  x and y where the motion began.
  [[nodiscard]] bool AsAsked(const mjData& data, const std::array<double, 2>& start) const {
    std::array<double, 9> R{};
    mju_quat2Mat(R.data(), data.qpos + 3);
    for (const PurposeFigure& figure : file_.purpose) {
      const auto& d = figure.along;
      double value = 0;
      if (figure.of == PurposeTarget::Of::kPosition) {
        value = d[0] * (data.qpos[0] - start[0] + file_.entry.root_x_m) +
                d[1] * (data.qpos[1] - start[1] + file_.entry.root_y_m) + d[2] * data.qpos[2];
      } else {
        std::array<double, 3> e{};
        mju_rotVecMat(e.data(), figure.in_space.data(), R.data());
        for (std::size_t i = 0; i < 3; ++i) e[i] -= d[i];
        value = mju_norm3(e.data());
      }
      if (!figure.MetBy(value)) return false;
    }
    return true;
  }

  const PrimitiveFile& file_;
  const Problem& problem_;
  const double period_s_;
  const testing::TemporaryFolder folder_;
  Model model_{nullptr, &mj_deleteModel};
  std::vector<double> masses_, inertias_;
  std::vector<int> position_at_, velocity_at_;
};

/// Masses 5 %, friction 20 %.
Variation VariationOf(std::uint64_t index) {
  Normal normal(5, index);
  Variation variation;
  for (int i = 0; i < 16; ++i) variation.mass.push_back(1 + 0.05 * normal.Draw());
  variation.friction = 1 + 0.2 * normal.Draw();
  return variation;
}

/// A shipped motion, the period of the bus that its drives share, and whether it does what it is
/// for on MuJoCo's default contact, too.
struct Shipped {
  const char* name;
  double period_s;
  bool on_soft = true;
};
void PrintTo(const Shipped& shipped, std::ostream* out) { *out << shipped.name; }

class SpaceInMuJoCo : public ::testing::TestWithParam<Shipped> {};

using Model = std::unique_ptr<mjModel, decltype(&mj_deleteModel)>;
using Data = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

/// Accelerations of root and joints in a state, by the names of joints, with nothing that touches.
std::vector<double> Accelerations(mjModel& model, const std::vector<std::string>& joints,
                                  const std::vector<double>& state) {
  model.opt.disableflags |= mjDSBL_CONTACT | mjDSBL_LIMIT | mjDSBL_ACTUATION;
  const Data data(mj_makeData(&model), &mj_deleteData);
  std::size_t at = 0;
  for (int i = 0; i < 7; ++i) data->qpos[i] = state[at++];
  mju_normalize4(data->qpos + 3);
  for (int i = 0; i < 6; ++i) data->qvel[i] = state[at++];
  for (const std::string& name : joints) {
    const int joint = mj_name2id(&model, mjOBJ_JOINT, name.c_str());
    data->qpos[model.jnt_qposadr[joint]] = state[at++];
    data->qvel[model.jnt_dofadr[joint]] = state[at++];
  }
  mj_forward(&model, data.get());
  std::vector<double> accelerations(data->qacc, data->qacc + 6);
  for (const std::string& name : joints) {
    const int joint = mj_name2id(&model, mjOBJ_JOINT, name.c_str());
    accelerations.push_back(data->qacc[model.jnt_dofadr[joint]]);
  }
  return accelerations;
}

/// What tumbler export writes for MuJoCo is the robot that MuJoCo reads from its URDF.
TEST(ExportedInSpace, MovesAsTheRobotThatMuJoCoReadsFromItsUrdf) {
  const PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/solo12/get_up.toml"));
  const Task task = TaskOf(file, TaskSpaces::kPlaneAndSpace);
  const SimulatedMotion motion(LoadMotion(testing::SourcePath("primitives/solo12/get_up.toml")),
                               TaskSpaces::kPlaneAndSpace);
  const testing::TemporaryFolder folder;
  const std::string path = folder.path() / "exported.xml";
  testing::WriteFile(path, ToMjcf(motion, task.problem.drive_gains()));
  std::array<char, 300> error{};
  const Model exported(mj_loadXML(path.c_str(), nullptr, error.data(), 300), &mj_deleteModel);
  ASSERT_NE(exported, nullptr) << error.data();
  EXPECT_NEAR(mj_getTotalmass(exported.get()), task.problem.space->scene.robot.mass_kg(), 1e-12);
  RobotInMuJoCo robot(file, task.problem, 0.02, 3.4e-3);
  std::fill_n(robot.model().dof_damping, robot.model().nv, 0.0);
  std::vector<std::string> joints;
  for (const JointMotion<double>& joint : file.primitive.motions())
    joints.emplace_back(joint.name.view());
  for (std::uint64_t sample = 0; sample < 20; ++sample) {
    Normal normal(9, sample);
    std::vector<double> state;
    for (std::size_t i = 0; i < 13 + 2 * joints.size(); ++i) state.push_back(normal.Draw());
    const std::vector<double> a = Accelerations(*exported, joints, state);
    const std::vector<double> b = Accelerations(robot.model(), joints, state);
    // MuJoCo writes the robot that it has read with six digits.
    for (std::size_t i = 0; i < a.size(); ++i)
      EXPECT_NEAR(a[i], b[i], 1e-4 * (1 + std::abs(b[i]))) << i;
  }
  // And it starts as the motion does.
  const Data data(mj_makeData(exported.get()), &mj_deleteData);
  mj_resetDataKeyframe(exported.get(), data.get(), 0);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const int joint = mj_name2id(exported.get(), mjOBJ_JOINT, joints[j].c_str());
    EXPECT_EQ(data->qpos[exported->jnt_qposadr[joint]], file.entry.joint_positions_rad[j]);
  }
  EXPECT_NEAR(std::abs(data->qpos[4]), 1, 1e-3) << "on its back";
  // Its base just touches the ground.
  mj_forward(exported.get(), data.get());
  const int base = mj_name2id(exported.get(), mjOBJ_GEOM, "base_link/0");
  const double lowest = data->geom_xpos[3 * base + 2] - exported->geom_size[3 * base + 2];
  EXPECT_NEAR(lowest, 0, 1e-5);
}

TEST_P(SpaceInMuJoCo, DoesWhatItIsForInFourOfFiveRobotsAndMoreWhereThePageSaysSo) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath(std::string("primitives/") + GetParam().name + ".toml"));
  const Task task = TaskOf(file, TaskSpaces::kPlaneAndSpace);
  // With a contact of 5 ms, and as MuJoCo comes.
  for (const double contact_s : {0.005, 0.02}) {
    const bool does = contact_s < 0.01 || GetParam().on_soft;
    RobotInMuJoCo robot(file, task.problem, contact_s, GetParam().period_s);
    EXPECT_EQ(robot.Play({}), does);
    int as_asked = 0;
    constexpr int kRobots = 50;
    for (int i = 0; i < kRobots; ++i)
      as_asked += robot.Play(VariationOf(static_cast<std::uint64_t>(i))) ? 1 : 0;
    EXPECT_EQ(as_asked >= kRobots * 4 / 5, does) << as_asked << " with " << contact_s;
    RecordProperty(contact_s < 0.01 ? "hard" : "default", as_asked);
  }
}

INSTANTIATE_TEST_SUITE_P(Motions, SpaceInMuJoCo,
                         ::testing::Values(Shipped{"solo8/walk", 2.5e-3},
                                           Shipped{"solo12/get_up", 3.4e-3},
                                           Shipped{"solo12/turn", 3.4e-3},
                                           Shipped{"solo12/walk", 3.4e-3, false}),
                         [](const auto& motion) {
                           std::string name = motion.param.name;
                           std::ranges::replace(name, '/', '_');
                           return name;
                         });

}  // namespace
}  // namespace tumbler
