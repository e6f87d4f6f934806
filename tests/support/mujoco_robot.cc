#include "tests/support/mujoco_robot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/programs/mjcf.h"
#include "offline/scene/self_clearance.h"
#include "tests/support/mujoco_model.h"

namespace tumbler::testing {
namespace {

class MujocoRobot final : public TwinBody {
 public:
  MujocoRobot(const SimulatedMotion& motion, const MujocoContacts& contacts, Scene scene,
              const PrimitivePose& start, SimulatedBus& bus, std::vector<SimulatedDrive*> drives)
      : scene_(std::move(scene)),
        distances_(scene_.robot, scene_.self_contact.All()),
        bus_(bus),
        drives_(std::move(drives)),
        model_(LoadMjcf(ToMjcf(motion, scene_, {0, 0}))),
        data_(mj_makeData(model_.get())) {
    if (drives_.size() != scene_.robot.joint_count() || model_->nu != model_->nq - 3)
      throw std::invalid_argument("a robot in MuJoCo needs one drive for each joint");
    const double stiffer =
        std::sqrt(scene_.contact.stiffness_n_per_m / contacts.model.stiffness_n_per_m);
    const double damped = scene_.contact.damping_n_s_per_m / contacts.model.damping_n_s_per_m;
    for (int i = 0; i < model_->ngeom; ++i) {
      NumbersOf<mjNREF>(model_->geom_solref, i)[0] = contacts.time_constant_s / stiffer;
      NumbersOf<mjNREF>(model_->geom_solref, i)[1] = contacts.damping_ratio * damped / stiffer;
    }
    for (const Dof<Plane>& dof : scene_.robot.tree.dofs) {
      const int joint = mj_name2id(model_.get(), mjOBJ_JOINT, dof.name.c_str());
      if (joint < 0) throw std::invalid_argument("MuJoCo has no joint '" + dof.name + "'");
      position_at_.push_back(model_->jnt_qposadr[joint]);
      velocity_at_.push_back(model_->jnt_dofadr[joint]);
    }
    start_ = PositionsIn(start, scene_.robot);
    start_[1] -= ClearanceAt(scene_, start_);
    told_.joint_positions_rad.resize(drives_.size());
    told_.joint_velocities_rad_s.resize(drives_.size());
    told_.joint_torques_nm.resize(drives_.size());
    PutBack();
  }

  void AdvanceTo(std::int64_t target_ns) override {
    while (time_ns_ < target_ns) {
      const std::int64_t next = std::min(time_ns_ + kStep_ns, target_ns);
      PassBus(time_ns_);
      if (!held_) {
        model_->opt.timestep = 1e-9 * static_cast<double>(next - time_ns_);
        mj_step(model_.get(), data_.get());
      }
      time_ns_ = next;
    }
    PassBus(target_ns);
  }

  [[nodiscard]] const TwinState& state() const override {
    told_.time_ns = time_ns_;
    told_.held = held_;
    told_.enabled_ns = enabled_ns_;
    told_.root_x_m = q(0);
    told_.root_z_m = q(1);
    told_.root_pitch_rad = q(2);
    told_.root_vx_m_s = qd(0);
    told_.root_vz_m_s = qd(1);
    told_.root_pitch_rate_rad_s = qd(2);
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const std::size_t dof = scene_.robot.DofOfJoint(j);
      told_.joint_positions_rad[j] = q(dof);
      told_.joint_velocities_rad_s[j] = qd(dof);
      told_.joint_torques_nm[j] = data_->ctrl[j];
    }
    std::vector<double> positions;
    for (std::size_t dof = 0; dof < position_at_.size(); ++dof) positions.push_back(q(dof));
    const SelfClearance own = distances_.Nearest(positions, 0);
    const bool overlaps = own.distance_m < 0;
    told_.self_overlap_m = overlaps ? -own.distance_m : 0;
    told_.overlapping = overlaps ? NameOf(scene_.robot, own.pair) : "";
    told_.normal_force_n = 0;
    for (const TwinContact& contact : contacts()) told_.normal_force_n += contact.normal_force_n;
    return told_;
  }

  [[nodiscard]] std::vector<TwinContact> contacts() const override {
    std::vector<TwinContact> contacts;
    for (int i = 0; i < data_->ncon; ++i) {
      const mjContact& contact = data_->contact[i];
      std::array<mjtNum, 6> force{};
      mj_contactForce(model_.get(), data_.get(), i, force.data());
      const bool first_moves = model_->geom_bodyid[contact.geom1] != 0;
      const int own = first_moves ? contact.geom1 : contact.geom2;
      const int other = first_moves ? contact.geom2 : contact.geom1;
      contacts.push_back({mj_id2name(model_.get(), mjOBJ_BODY, model_->geom_bodyid[own]),
                          mj_id2name(model_.get(), mjOBJ_GEOM, other), force[0]});
    }
    return contacts;
  }

  void Displace(std::span<const double> more_q, std::span<const double> more_v) override {
    for (std::size_t i = 0; i < more_q.size(); ++i) {
      data_->qpos[position_at_[i]] += more_q[i];
      data_->qvel[velocity_at_[i]] += more_v[i];
    }
  }
  void ForgetImpacts() override {}

  void PutBack() override {
    mj_resetData(model_.get(), data_.get());
    for (std::size_t i = 0; i < start_.size(); ++i) data_->qpos[position_at_[i]] = start_[i];
    mj_forward(model_.get(), data_.get());
    held_ = true;
  }

 private:
  static constexpr std::int64_t kStep_ns = 50'000;

  void PassBus(std::int64_t time_ns) {
    bus_.AdvanceTo(time_ns);
    bool all_enabled = true;
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const std::size_t dof = scene_.robot.DofOfJoint(j);
      data_->ctrl[j] = drives_[j]->Step(time_ns, q(dof), qd(dof));
      all_enabled = all_enabled && drives_[j]->enabled();
    }
    if (!all_enabled) return;
    held_ = false;
    if (enabled_ns_ < 0) enabled_ns_ = time_ns;
  }

  [[nodiscard]] double q(std::size_t dof) const { return data_->qpos[position_at_[dof]]; }
  [[nodiscard]] double qd(std::size_t dof) const { return data_->qvel[velocity_at_[dof]]; }

  Scene scene_;
  mutable SelfDistancesIn<Plane> distances_;  // with room for its work
  SimulatedBus& bus_;
  std::vector<SimulatedDrive*> drives_;
  MujocoModel model_;
  MujocoData data_;
  std::vector<int> position_at_, velocity_at_;  // of our degrees of freedom
  std::vector<double> start_;
  std::int64_t time_ns_ = 0, enabled_ns_ = -1;
  bool held_ = true;
  mutable TwinState told_;
};

}  // namespace

TwinEngine MujocoEngine(const SimulatedMotion& motion, const MujocoContacts& contacts) {
  return [motion, contacts](const Scene& scene, const PrimitivePose& start, SimulatedBus& bus,
                            std::vector<SimulatedDrive*> drives) {
    return std::make_unique<MujocoRobot>(motion, contacts, scene, start, bus, std::move(drives));
  };
}

}  // namespace tumbler::testing
