#include "offline/twin/twin.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/problem/space_task.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/stepper.h"

namespace tumbler {
namespace {

/// Stiffness and damping of a stop that a sliding joint without a motor meets, in units of a
/// turning one's: those of that at a lever of 0.1 m [1/m^2].
constexpr double kStopLever = 1 / (0.1 * 0.1);
/// Steps within an error bound are at most so long, times the fastest rate at which anything fades.
constexpr double kSlowEnough = 1.4;
/// What steps bear of a stop: parts of inertia / step^2 and of inertia / step, with room for what a
/// joint's inertia changes as the robot moves.
constexpr double kLargestStiffness = 0.1, kLargestDamping = 0.25;

template <class Robot>
int BodyOf(const Robot& robot, const std::string& link) {
  const std::vector<std::string>& names = robot.body_names;
  // All degrees of freedom of the root have the name of its link, and the last one moves it.
  for (std::size_t i = names.size(); i-- > 0;) {
    if (names[i] == link && !robot.tree.dofs[i].massless) return static_cast<int>(i);
  }
  throw std::invalid_argument("the robot has no link '" + link + "'");
}

template <class AScene>
int ObstacleOf(const AScene& scene, const std::string& name) {
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) {
    if (scene.obstacles[i].name == name) return static_cast<int>(i);
  }
  throw std::invalid_argument("there is no obstacle '" + name + "'");
}

/// The start, lifted by the stand.
PrimitivePose Lifted(PrimitivePose start, double stand_m) {
  start.root_z_m += stand_m;
  return start;
}

/// x and z, or all three.
template <class Space>
typename Space::Vector VectorIn(const std::array<double, 3>& v) {
  if constexpr (std::is_same_v<Space, Plane>) {
    return {v[0], v[2]};
  } else {
    return {v[0], v[1], v[2]};
  }
}

std::vector<double> StartPositions(const PrimitivePose& pose, const Scene& scene) {
  return PositionsIn(pose, scene.robot);
}
std::vector<double> StartPositions(const PrimitivePose& pose, const SpaceScene& scene) {
  if (pose.joint_positions_rad.size() != scene.robot.joint_count())
    throw std::invalid_argument("a pose needs every joint");
  return ToSpacePose(pose).q;
}

template <class Space>
RootChart<Space> ChartAt(const PrimitivePose& pose) {
  RootChart<Space> chart;
  if constexpr (RootChart<Space>::kMoves) chart.axes = ToRotation(pose.root_quaternion);
  return chart;
}

/// The friction of a joint in a twin.
template <class AScene>
Motor LossesOf(const AScene& scene, std::size_t joint, const TwinConfig& config) {
  const JointLosses losses = joint < config.joints.size() ? config.joints[joint] : JointLosses{};
  Motor motor{.viscous_friction_nm_s_per_rad = kUsualViscousFriction_nm_s_per_rad,
              .dry_friction_nm = scene.robot.dry_friction_nm[scene.robot.DofOfJoint(joint)]};
  if (joint < scene.motors.size()) motor = scene.motors[joint];
  if (losses.viscous_friction_nm_s_per_rad)
    motor.viscous_friction_nm_s_per_rad = *losses.viscous_friction_nm_s_per_rad;
  if (losses.dry_friction_nm) motor.dry_friction_nm = *losses.dry_friction_nm;
  return motor;
}

/// The scene with the twin's own contact law, obstacles, masses and losses, and with every joint
/// driven by a torque. In a stand the root stays where it is, and on a bar its x and z do.
template <class Space>
SceneOf<Space> Changed(SceneOf<Space> scene, const TwinConfig& config) {
  if (config.contact) scene.contact = *config.contact;
  const auto more = [&config] {
    if constexpr (std::is_same_v<Space, Plane>) {
      return config.obstacles;
    } else {
      return config.obstacles_in_space;
    }
  };
  for (const Obstacle<Space>& obstacle : more()) scene.obstacles.push_back(obstacle);
  std::vector<Dof<Space>>& dofs = scene.robot.tree.dofs;
  for (const auto& [link, factor] : config.mass_factor) {
    Dof<Space>& dof = dofs[Index(BodyOf(scene.robot, link))];
    dof.mass_kg *= factor;
    dof.inertia_kg_m2 = dof.inertia_kg_m2 * factor;
  }
  std::vector<Motor> motors;
  if (config.stand_m > 0) {
    for (std::size_t i = 0; i < Index(scene.robot.root_dofs); ++i) dofs[i].prescribed = true;
  }
  for (std::size_t j = 0; j < scene.robot.joint_count(); ++j) {
    Dof<Space>& dof = dofs[scene.robot.DofOfJoint(j)];
    dof.prescribed = false;
    const Motor motor = LossesOf(scene, j, config);
    // The scene's damping has the friction of its own motors.
    if (!scene.motors.empty())
      dof.damping_nm_s_per_rad -= scene.motors[j].viscous_friction_nm_s_per_rad;
    dof.damping_nm_s_per_rad += motor.viscous_friction_nm_s_per_rad;
    if (j < config.joints.size() && config.joints[j].rotor_inertia_kg_m2)
      dof.rotor_inertia_kg_m2 = *config.joints[j].rotor_inertia_kg_m2;
    motors.push_back(motor);
  }
  scene.motors = std::move(motors);
  return scene;
}

template <class Space>
class TwinIn final : public TwinBody {
  using Dynamics = SceneDynamicsIn<Space>;
  using Vector = typename Space::Vector;

 public:
  TwinIn(const SceneOf<Space>& nominal, const PrimitivePose& start, const TwinConfig& c,
         SimulatedBus& b, std::vector<SimulatedDrive*> d)
      : config_(c),
        scene_(Changed<Space>(nominal, c)),
        robot_(scene_),
        distances_(scene_.robot, scene_.self_contact.All()),
        bus_(b),
        drives_(std::move(d)),
        start_positions_(StartPositions(Lifted(start, c.stand_m), scene_)),
        start_state_(robot_.AtRest(start_positions_)),
        y_(start_state_),
        start_chart_(ChartAt<Space>(start)),
        chart_(start_chart_),
        stands_(c.stand_m > 0),
        held_(c.held && !stands_) {
    if (drives_.size() != scene_.robot.joint_count()) {
      throw std::invalid_argument("a twin needs one drive for each joint of its primitive");
    }
    if (config_.step_ns <= 0) throw std::invalid_argument("the twin's step must be positive");
    place_.assign(robot_.n, -1);
    for (std::size_t i = 0; i < robot_.free.size(); ++i)
      place_[Index(robot_.free[i])] = static_cast<int>(i);
    std::copy(start_positions_.begin(), start_positions_.end(), robot_.q.begin());
    robot_.Use(chart_);
    for (const Push& push : config_.pushes) push_bodies_.push_back(BodyOf(scene_.robot, push.link));
    for (const FrictionPatch& patch : config_.patches) {
      patch_obstacles_.push_back(ObstacleOf(scene_, patch.obstacle));
    }
    FindPassiveStops();
    const std::size_t joints = scene_.robot.joint_count(), passive = scene_.robot.passive.size();
    told_.joint_positions_rad.resize(joints);
    told_.joint_velocities_rad_s.resize(joints);
    told_.joint_torques_nm.resize(joints);
    told_.passive_positions_rad.resize(passive);
    told_.passive_velocities_rad_s.resize(passive);
    Drive();
  }

  void AdvanceTo(std::int64_t target_ns) override;
  [[nodiscard]] const TwinState& state() const override;
  [[nodiscard]] std::vector<TwinContact> contacts() const override;
  void Displace(std::span<const double> more_q, std::span<const double> more_v) override;
  void ForgetImpacts() override;
  void PutBack() override;

 private:
  void TellRoot() const;

  /// A joint without a motor has no rotor, so that its stop may be too hard for the steps.
  void FindPassiveStops() {
    robot_.SetFree(start_state_);
    robot_.Touch();
    const auto acceleration = [this](std::size_t dof, double torque) {
      robot_.tau = {};
      robot_.tau[dof] = torque;
      robot_.Solve();
      return robot_.qdd[dof];
    };
    const double h = 1e-9 * static_cast<double>(config_.step_ns);
    for (const PassiveJoint& joint : scene_.robot.passive) {
      const std::size_t dof = Index(joint.dof);
      const bool slides = scene_.robot.tree.dofs[dof].kind == JointKind::kPrismatic;
      const double units = slides ? kStopLever : 1;
      const double inertia = 1 / (acceleration(dof, 1) - acceleration(dof, 0));
      passive_stops_.emplace_back(dof, StopAt(dof,
                                              std::min(units * config_.stop_stiffness_nm_per_rad,
                                                       kLargestStiffness * inertia / (h * h)),
                                              std::min(units * config_.stop_damping_nm_s_per_rad,
                                                       kLargestDamping * inertia / h)));
    }
  }

  /// Lets every drive measure its joint and act for one step.
  void Drive() {
    bool all_enabled = !drives_.empty();
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const std::size_t dof = scene_.robot.DofOfJoint(j);
      drive_torque_[dof] = drives_[j]->Step(time_ns_, q(dof), qd(dof));
      all_enabled = all_enabled && drives_[j]->enabled();
    }
    if (!all_enabled) return;
    held_ = false;
    if (enabled_ns_ < 0) enabled_ns_ = time_ns_;
  }

  /// The torque of dry friction and of the stop at the joint's limit.
  [[nodiscard]] double Resistance(std::size_t j, double position, double velocity) const {
    return StopAt(scene_.robot.DofOfJoint(j), config_.stop_stiffness_nm_per_rad,
                  config_.stop_damping_nm_s_per_rad)
               .Torque(position, velocity) -
           EvaluateDryFriction(scene_.motors[j].dry_friction_nm, velocity).torque_nm;
  }

  [[nodiscard]] JointStop<double> StopAt(std::size_t dof, double stiffness, double damping) const {
    const RobotJointLimits& limits = scene_.robot.limits[dof];
    return {stiffness, damping, limits.lower_rad, limits.upper_rad};
  }

  [[nodiscard]] int BodyOfContact(const ActiveContact<Space>& active) const {
    return scene_.robot.shapes[Index(active.shape)].body;
  }

  /// Gives every contact on a patch the friction of the patch.
  void ApplyPatches() {
    HybridDynamics<Space>& dynamics = robot_.dynamics;
    for (const ActiveContact<Space>& active : robot_.contact->active()) {
      const double x = dynamics.origin().x() + active.point.x();
      const FrictionPatch* on = nullptr;
      for (std::size_t p = 0; p < config_.patches.size(); ++p) {
        const FrictionPatch& patch = config_.patches[p];
        if (patch_obstacles_[p] == active.obstacle && x >= patch.from_x_m && x <= patch.to_x_m)
          on = &patch;
      }
      if (on == nullptr) continue;
      const int body = BodyOfContact(active);
      const Vector v = dynamics.velocity(body).At(active.point);
      const Vector v_t = v - v.dot(active.normal) * active.normal;
      const double more = (on->mu - scene_.contact.mu) * std::abs(active.normal_force_n) *
                          EvaluateFrictionGain(scene_.contact, v_t.squaredNorm()).gain;
      dynamics.AddWrench(body, Space::ForceAt(active.point, -more * v_t));
    }
  }

  void ApplyPushes() {
    HybridDynamics<Space>& dynamics = robot_.dynamics;
    push_n_ = {};
    for (std::size_t p = 0; p < config_.pushes.size(); ++p) {
      const Push& push = config_.pushes[p];
      if (push.since_enabled && enabled_ns_ < 0) continue;
      const double since_s =
          1e-9 * static_cast<double>(time_ns_ - (push.since_enabled ? enabled_ns_ : 0));
      if (since_s < push.start_s || since_s >= push.start_s + push.duration_s) continue;
      const int body = push_bodies_[p];
      const Vector at =
          dynamics.position(body) + dynamics.rotation(body) * VectorIn<Space>(push.point_m);
      dynamics.AddWrench(body, Space::ForceAt(at, VectorIn<Space>(push.force_n)));
      for (std::size_t i = 0; i < 3; ++i) push_n_[i] += push.force_n[i];
    }
  }

  /// Finds what touches the robot in the state that it is in, and what pushes it.
  void Touch() {
    robot_.Touch();
    ApplyPatches();
    ApplyPushes();
  }

  /// The slope after Touch, with these torques of the drives.
  void Solve(const typename Dynamics::Numbers& torques, double* k) {
    robot_.tau = torques;
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const std::size_t dof = scene_.robot.DofOfJoint(j);
      robot_.tau[dof] += Resistance(j, robot_.q[dof], robot_.qd[dof]);
    }
    for (const auto& [dof, stop] : passive_stops_)
      robot_.tau[dof] += stop.Torque(robot_.q[dof], robot_.qd[dof]);
    robot_.Solve();
    robot_.TakeSlope(k);
  }

  void NoteContacts() {
    normal_force_ = 0;
    touching_.clear();
    for (const ActiveContact<Space>& a : robot_.contact->active()) {
      peak_penetration_ = std::max(peak_penetration_, a.depth_m);
      normal_force_ += a.normal_force_n;
      touching_.push_back(a);
      const double speed = ApproachOf(a);
      if (speed <= impact_) continue;
      impact_ = speed;
      impact_body_ = BodyOfContact(a);
    }
  }

  /// The speed with which a contact's point moves into what it touches.
  [[nodiscard]] double ApproachOf(const ActiveContact<Space>& active) const {
    const HybridDynamics<Space>& dynamics = robot_.dynamics;
    Vector v = dynamics.velocity(BodyOfContact(active)).At(active.point);
    if (active.other_shape >= 0) {
      const int other = scene_.robot.shapes[Index(active.other_shape)].body;
      v -= dynamics.velocity(other).At(active.point);
    }
    return -v.dot(active.normal);
  }

  /// Takes a step by the midpoint rule. The order suffices because the drives' loops need a step
  /// that is far shorter than contact would need.
  void Integrate(double h) {
    StepRungeKutta<kMidpoint>(y_, 2 * robot_.free.size(), h,
                              [this](int s, const typename Dynamics::State& state, double* k) {
                                robot_.SetFree(state);
                                Touch();
                                Solve(drive_torque_, k);
                                if (s == 0) NoteContacts();
                                return true;
                              });
    MoveChart();
  }

  /// Turns the root's axes after a step.
  void MoveChart() {
    if constexpr (RootChart<Space>::kMoves) {
      if (stands_) return;
      constexpr std::size_t kFirst = RootChart<Space>::kFirst;
      chart_.MoveOn(&y_[kFirst], &y_[robot_.free.size() + kFirst]);
      robot_.Use(chart_);
    }
  }

  /// The torques of the drives at a time after their last step, in the state that the robot is in.
  [[nodiscard]] typename Dynamics::Numbers TorquesAt(std::int64_t at_ns) const {
    typename Dynamics::Numbers torques{};
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const std::size_t dof = scene_.robot.DofOfJoint(j);
      torques[dof] = drives_[j]->TorqueAt(at_ns, robot_.q[dof], robot_.qd[dof]);
    }
    return torques;
  }

  /// The next time, at most `limit_ns`, at which something may change how the robot moves: a frame
  /// reaches a drive, a drive acts by itself, a push begins or ends.
  [[nodiscard]] std::int64_t NextChange(std::int64_t limit_ns) const {
    std::int64_t next = limit_ns;
    const auto consider = [this, &next](std::int64_t at_ns) {
      if (at_ns > time_ns_) next = std::min(next, at_ns);
    };
    consider(bus_.NextDelivery());
    for (const SimulatedDrive* drive : drives_) consider(drive->next_act_ns());
    for (const Push& push : config_.pushes) {
      if (push.since_enabled && enabled_ns_ < 0) continue;
      const double from_s =
          push.start_s + (push.since_enabled ? 1e-9 * static_cast<double>(enabled_ns_) : 0);
      consider(std::llround(1e9 * from_s));
      consider(std::llround(1e9 * (from_s + push.duration_s)));
    }
    return next;
  }

  /// Takes one step by the midpoint rule that ends at `end_ns` at the latest, and is as long as the
  /// error bound allows. Times that are left to `end_ns` are divided into equal steps.
  void StepWithinError(std::int64_t end_ns) {
    const std::size_t n = robot_.free.size();
    if (!config_.pushes.empty()) at_start_ = AtStart::kUnknown;  // One may begin or end here.
    if (at_start_ == AtStart::kUnknown) {
      robot_.SetFree(y_);
      Touch();
      slope_torque_ = drive_torque_;
      Solve(slope_torque_, slope_.data());
    }
    NoteContacts();
    const std::int64_t left_ns = end_ns - time_ns_;
    for (;;) {
      const std::int64_t steps = (left_ns + wanted_step_ns_ - 1) / wanted_step_ns_;
      const std::int64_t step_ns = (left_ns + steps - 1) / steps;
      const double h = 1e-9 * static_cast<double>(step_ns);
      typename Dynamics::State later, middle_slope, end_slope;
      for (std::size_t i = 0; i < 2 * n; ++i) later[i] = y_[i] + 0.5 * h * slope_[i];
      Evaluate(later, time_ns_ + step_ns / 2, middle_slope);
      for (std::size_t i = 0; i < 2 * n; ++i) later[i] = y_[i] + h * middle_slope[i];
      Evaluate(later, time_ns_ + step_ns, end_slope);
      double error = 0;  // of Simpson's rule against the midpoint's
      for (std::size_t i = n; i < 2 * n; ++i) {
        error = std::max(error, h / 6 * std::abs(slope_[i] - 2 * middle_slope[i] + end_slope[i]) /
                                    (kTwinStepError * (1 + std::abs(y_[i]))));
      }
      double factor = std::clamp(0.9 * portable::Power(std::max(error, 1e-3), -1.0 / 3), 0.3, 4.0);
      // A mode that the drives damp at the rate r makes the step unstable from h r = 2 on, before
      // any error shows where the robot rests. How slopes and states differ tells the fastest rate
      // that takes part.
      double changes = 0, moves = 0;
      for (std::size_t i = n; i < 2 * n; ++i) {
        const double change = end_slope[i] - middle_slope[i];
        const double move = h * (middle_slope[i] - 0.5 * slope_[i]);
        changes += change * change;
        moves += move * move;
      }
      if (const double rate = std::sqrt(changes / moves); h * factor * rate > kSlowEnough)
        factor = kSlowEnough / (h * rate);
      const auto advised_ns = static_cast<std::int64_t>(factor * static_cast<double>(step_ns));
      const bool shortest = step_ns <= config_.step_ns;
      if (error > 1 && !shortest) {
        wanted_step_ns_ = std::clamp(advised_ns, config_.step_ns, kTwinLongestStep_ns);
        continue;
      }
      // A step that had to end early says nothing against a longer one.
      if (factor < 1 || step_ns >= wanted_step_ns_ || advised_ns > wanted_step_ns_)
        wanted_step_ns_ = std::clamp(advised_ns, config_.step_ns, kTwinLongestStep_ns);
      y_ = later;
      slope_ = end_slope;
      time_ns_ += step_ns;
      at_start_ = AtStart::kSolved;
      if constexpr (RootChart<Space>::kMoves) {
        MoveChart();
        at_start_ = AtStart::kUnknown;  // The slope is that of the chart before.
      }
      return;
    }
  }

  /// The slope in a state at a time within a step.
  void Evaluate(const typename Dynamics::State& state, std::int64_t at_ns,
                typename Dynamics::State& k) {
    robot_.SetFree(state);
    Touch();
    slope_torque_ = TorquesAt(at_ns);
    Solve(slope_torque_, k.data());
  }

  /// Lets the drives take what has come up to now, and act.
  void PassBus() {
    // What a drive answers is what it measures when the frame has come.
    if (bus_.NextDelivery() <= time_ns_) Drive();
    bus_.AdvanceTo(time_ns_);
    Drive();
    if (at_start_ != AtStart::kSolved) return;
    typename Dynamics::Numbers more{}, acceleration{};
    for (std::size_t i = 0; i < robot_.n; ++i) more[i] = drive_torque_[i] - slope_torque_[i];
    robot_.dynamics.Respond({more.data(), robot_.n}, {acceleration.data(), robot_.n});
    for (std::size_t i = 0; i < robot_.free.size(); ++i)
      slope_[robot_.free.size() + i] += acceleration[robot_.free[i]];
    slope_torque_ = drive_torque_;
  }

  void AdvanceWithinError(std::int64_t target_ns) {
    while (time_ns_ < target_ns) {
      PassBus();
      const std::int64_t change_ns = NextChange(target_ns);
      if (held_) {
        time_ns_ = std::min(change_ns, time_ns_ + kTwinLongestStep_ns);
        continue;
      }
      StepWithinError(change_ns);
    }
    PassBus();
  }

  [[nodiscard]] double q(std::size_t dof) const {
    return place_[dof] < 0 ? start_positions_[dof] : y_[Index(place_[dof])];
  }
  [[nodiscard]] double qd(std::size_t dof) const {
    return place_[dof] < 0 ? 0 : y_[robot_.free.size() + Index(place_[dof])];
  }

  TwinConfig config_;
  SceneOf<Space> scene_;
  Dynamics robot_;
  mutable SelfDistancesIn<Space> distances_;  // with room for its work
  SimulatedBus& bus_;
  std::vector<SimulatedDrive*> drives_;
  std::vector<double> start_positions_;  // of all degrees of freedom
  typename Dynamics::State start_state_, y_;
  RootChart<Space> start_chart_, chart_;
  std::vector<int> place_;  // of each degree of freedom in the state; -1: stand or bar holds it
  typename Dynamics::Numbers drive_torque_{};
  std::vector<std::pair<std::size_t, JointStop<double>>> passive_stops_;  // with their places
  std::vector<int> push_bodies_, patch_obstacles_;
  std::vector<ActiveContact<Space>> touching_;
  std::array<double, 3> push_n_{};
  std::int64_t time_ns_ = 0;
  std::int64_t enabled_ns_ = -1;  // when all drives were first enabled; -1: not yet
  bool stands_;
  bool held_;
  /// Of steps within an error bound: what is known of the state y.
  enum class AtStart : std::uint8_t {
    kUnknown,
    kSolved,  ///< The slope with these torques of the drives. `robot` is in the state.
  };
  AtStart at_start_ = AtStart::kUnknown;
  typename Dynamics::State slope_{};
  typename Dynamics::Numbers slope_torque_{};  // with which the last slope was found
  std::int64_t wanted_step_ns_ = config_.step_ns;
  mutable TwinState told_;  // with room for its work
  mutable bool told_is_true_ = false;
  double peak_penetration_ = 0;
  double normal_force_ = 0;
  double impact_ = 0;
  int impact_body_ = -1;  // -1: nothing was touched
};

template <class Space>
void TwinIn<Space>::AdvanceTo(std::int64_t target_ns) {
  told_is_true_ = false;
  if (config_.steps == TwinConfig::Steps::kErrorBound) return AdvanceWithinError(target_ns);
  while (time_ns_ < target_ns) {
    const std::int64_t next = std::min(time_ns_ + config_.step_ns, target_ns);
    bus_.AdvanceTo(time_ns_);
    Drive();
    if (!held_) Integrate(1e-9 * static_cast<double>(next - time_ns_));
    time_ns_ = next;
  }
  bus_.AdvanceTo(target_ns);
  Drive();
}

template <class Space>
void TwinIn<Space>::TellRoot() const {
  if constexpr (std::is_same_v<Space, Plane>) {
    if (scene_.robot.root_dofs != 3) return;
    told_.root_x_m = q(0);
    told_.root_z_m = q(1);
    told_.root_pitch_rad = q(2);
    told_.root_vx_m_s = qd(0);
    told_.root_vz_m_s = qd(1);
    told_.root_pitch_rate_rad_s = qd(2);
  } else {
    told_.root_x_m = q(0);
    told_.root_y_m = q(1);
    told_.root_z_m = q(2);
    told_.root_vx_m_s = qd(0);
    told_.root_vy_m_s = qd(1);
    told_.root_vz_m_s = qd(2);
    // Between steps the angles are 0, and their rates the angular velocity about -y, x and z.
    told_.root_quaternion = ToQuaternion(chart_.axes);
    const SpaceVector w = chart_.axes * SpaceVector(qd(4), -qd(3), qd(5));
    told_.root_angular_velocity_rad_s = {w.x(), w.y(), w.z()};
  }
}

template <class Space>
const TwinState& TwinIn<Space>::state() const {
  if (told_is_true_) return told_;
  told_is_true_ = true;
  told_.time_ns = time_ns_;
  told_.held = held_ || stands_;
  told_.enabled_ns = enabled_ns_;
  told_.push_n = push_n_;
  TellRoot();
  for (std::size_t j = 0; j < scene_.robot.joint_count(); ++j) {
    const std::size_t dof = scene_.robot.DofOfJoint(j);
    told_.joint_positions_rad[j] = q(dof);
    told_.joint_velocities_rad_s[j] = qd(dof);
    told_.joint_torques_nm[j] = drive_torque_[dof];
  }
  for (std::size_t i = 0; i < scene_.robot.passive.size(); ++i) {
    const std::size_t dof = Index(scene_.robot.passive[i].dof);
    told_.passive_positions_rad[i] = q(dof);
    told_.passive_velocities_rad_s[i] = qd(dof);
  }
  told_.peak_penetration_m = peak_penetration_;
  told_.impact_m_s = impact_;
  told_.impact_link.clear();
  if (impact_body_ >= 0) told_.impact_link = scene_.robot.body_names[Index(impact_body_)];
  typename Dynamics::Numbers positions{};
  for (std::size_t dof = 0; dof < robot_.n; ++dof) positions[dof] = q(dof);
  const SelfClearance own = distances_.Nearest({positions.data(), robot_.n}, 0);
  const bool overlaps = own.distance_m < 0;
  told_.self_overlap_m = overlaps ? -own.distance_m : 0;
  told_.overlapping = overlaps ? NameOf(scene_.robot, own.pair) : "";
  told_.normal_force_n = normal_force_;
  return told_;
}

template <class Space>
std::vector<TwinContact> TwinIn<Space>::contacts() const {
  std::vector<TwinContact> contacts;
  for (const ActiveContact<Space>& active : touching_) {
    contacts.push_back({scene_.robot.body_names[Index(BodyOfContact(active))],
                        TouchedName(scene_, active), active.normal_force_n});
  }
  return contacts;
}

template <class Space>
void TwinIn<Space>::Displace(std::span<const double> more_q, std::span<const double> more_v) {
  told_is_true_ = false;
  const std::size_t root = Index(scene_.robot.root_dofs);
  const std::size_t count = root + scene_.robot.joint_count();
  if (more_q.size() != count || more_v.size() != count)
    throw std::invalid_argument("the root's degrees of freedom and each joint need one number");
  for (std::size_t i = 0; i < count; ++i) {
    const int at = place_[i < root ? i : scene_.robot.DofOfJoint(i - root)];
    if (at < 0) continue;
    y_[Index(at)] += more_q[i];
    y_[robot_.free.size() + Index(at)] += more_v[i];
  }
  MoveChart();
  at_start_ = AtStart::kUnknown;
}

template <class Space>
void TwinIn<Space>::ForgetImpacts() {
  told_is_true_ = false;
  impact_ = 0;
  impact_body_ = -1;
}

template <class Space>
void TwinIn<Space>::PutBack() {
  told_is_true_ = false;
  y_ = start_state_;
  chart_ = start_chart_;
  robot_.Use(chart_);
  at_start_ = AtStart::kUnknown;
  touching_.clear();
  normal_force_ = 0;
  held_ = config_.held && !stands_;
  Drive();
}

}  // namespace

Twin::Twin(const Scene& scene, const PrimitivePose& start, const TwinConfig& config,
           SimulatedBus& bus, std::vector<SimulatedDrive*> drives)
    : body_(config.engine
                ? config.engine(Changed<Plane>(scene, config), start, bus, std::move(drives))
                : std::make_unique<TwinIn<Plane>>(scene, start, config, bus, std::move(drives))) {}
Twin::Twin(const SpaceScene& scene, const PrimitivePose& start, const TwinConfig& config,
           SimulatedBus& bus, std::vector<SimulatedDrive*> drives)
    : body_(std::make_unique<TwinIn<Spatial>>(scene, start, config, bus, std::move(drives))) {}
Twin::~Twin() = default;

void Twin::AdvanceTo(std::int64_t time_ns) { body_->AdvanceTo(time_ns); }
const TwinState& Twin::state() const { return body_->state(); }
std::vector<TwinContact> Twin::contacts() const { return body_->contacts(); }
void Twin::Displace(std::span<const double> q, std::span<const double> v) { body_->Displace(q, v); }
void Twin::ForgetImpacts() { body_->ForgetImpacts(); }
void Twin::PutBack() { body_->PutBack(); }

}  // namespace tumbler
