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

}  // namespace

/// A twin in the plane or in space, by what `Twin` does.
class TwinBody {
 public:
  TwinBody() = default;
  virtual ~TwinBody() = default;
  TwinBody(const TwinBody&) = delete;
  TwinBody& operator=(const TwinBody&) = delete;
  virtual void AdvanceTo(std::int64_t time_ns) = 0;
  [[nodiscard]] virtual const TwinState& state() const = 0;
  [[nodiscard]] virtual std::vector<TwinContact> contacts() const = 0;
  virtual void Displace(std::span<const double> q, std::span<const double> v) = 0;
  virtual void ForgetImpacts() = 0;
  virtual void PutBack() = 0;
};

namespace {

template <class Space>
class TwinIn final : public TwinBody {
  using Dynamics = SceneDynamicsIn<Space>;
  using Vector = typename Space::Vector;

 public:
  TwinIn(const SceneOf<Space>& nominal, const PrimitivePose& start, const TwinConfig& c,
         SimulatedBus& b, std::vector<SimulatedDrive*> d)
      : config(c),
        scene(Changed<Space>(nominal, c)),
        robot(scene),
        distances(scene.robot, scene.self_contact.All()),
        bus(b),
        drives(std::move(d)),
        start_positions(StartPositions(Lifted(start, c.stand_m), scene)),
        start_state(robot.AtRest(start_positions)),
        y(start_state),
        start_chart(ChartAt<Space>(start)),
        chart(start_chart),
        stands(c.stand_m > 0),
        held(c.held && !stands) {
    if (drives.size() != scene.robot.joint_count()) {
      throw std::invalid_argument("a twin needs one drive for each joint of its primitive");
    }
    if (config.step_ns <= 0) throw std::invalid_argument("the twin's step must be positive");
    place.assign(robot.n, -1);
    for (std::size_t i = 0; i < robot.free.size(); ++i)
      place[Index(robot.free[i])] = static_cast<int>(i);
    std::copy(start_positions.begin(), start_positions.end(), robot.q.begin());
    robot.Use(chart);
    for (const Push& push : config.pushes) push_bodies.push_back(BodyOf(scene.robot, push.link));
    for (const FrictionPatch& patch : config.patches) {
      patch_obstacles.push_back(ObstacleOf(scene, patch.obstacle));
    }
    FindPassiveStops();
    const std::size_t joints = scene.robot.joint_count(), passive = scene.robot.passive.size();
    told.joint_positions_rad.resize(joints);
    told.joint_velocities_rad_s.resize(joints);
    told.joint_torques_nm.resize(joints);
    told.passive_positions_rad.resize(passive);
    told.passive_velocities_rad_s.resize(passive);
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
    robot.SetFree(start_state);
    robot.Touch();
    const auto acceleration = [this](std::size_t dof, double torque) {
      robot.tau = {};
      robot.tau[dof] = torque;
      robot.Solve();
      return robot.qdd[dof];
    };
    const double h = 1e-9 * static_cast<double>(config.step_ns);
    for (const PassiveJoint& joint : scene.robot.passive) {
      const std::size_t dof = Index(joint.dof);
      const bool slides = scene.robot.tree.dofs[dof].kind == JointKind::kPrismatic;
      const double units = slides ? kStopLever : 1;
      const double inertia = 1 / (acceleration(dof, 1) - acceleration(dof, 0));
      passive_stops.emplace_back(dof, StopAt(dof,
                                             std::min(units * config.stop_stiffness_nm_per_rad,
                                                      kLargestStiffness * inertia / (h * h)),
                                             std::min(units * config.stop_damping_nm_s_per_rad,
                                                      kLargestDamping * inertia / h)));
    }
  }

  /// Lets every drive measure its joint and act for one step.
  void Drive() {
    bool all_enabled = !drives.empty();
    for (std::size_t j = 0; j < drives.size(); ++j) {
      const std::size_t dof = scene.robot.DofOfJoint(j);
      drive_torque[dof] = drives[j]->Step(time_ns, q(dof), qd(dof));
      all_enabled = all_enabled && drives[j]->enabled();
    }
    if (!all_enabled) return;
    held = false;
    if (enabled_ns < 0) enabled_ns = time_ns;
  }

  /// The torque of dry friction and of the stop at the joint's limit.
  [[nodiscard]] double Resistance(std::size_t j, double position, double velocity) const {
    return StopAt(scene.robot.DofOfJoint(j), config.stop_stiffness_nm_per_rad,
                  config.stop_damping_nm_s_per_rad)
               .Torque(position, velocity) -
           EvaluateDryFriction(scene.motors[j].dry_friction_nm, velocity).torque_nm;
  }

  [[nodiscard]] JointStop<double> StopAt(std::size_t dof, double stiffness, double damping) const {
    const RobotJointLimits& limits = scene.robot.limits[dof];
    return {stiffness, damping, limits.lower_rad, limits.upper_rad};
  }

  [[nodiscard]] int BodyOfContact(const ActiveContact<Space>& active) const {
    return scene.robot.shapes[Index(active.shape)].body;
  }

  /// Gives every contact on a patch the friction of the patch.
  void ApplyPatches() {
    HybridDynamics<Space>& dynamics = robot.dynamics;
    for (const ActiveContact<Space>& active : robot.contact->active()) {
      const double x = dynamics.origin().x() + active.point.x();
      const FrictionPatch* on = nullptr;
      for (std::size_t p = 0; p < config.patches.size(); ++p) {
        const FrictionPatch& patch = config.patches[p];
        if (patch_obstacles[p] == active.obstacle && x >= patch.from_x_m && x <= patch.to_x_m)
          on = &patch;
      }
      if (on == nullptr) continue;
      const int body = BodyOfContact(active);
      const Vector v = dynamics.velocity(body).At(active.point);
      const Vector v_t = v - v.dot(active.normal) * active.normal;
      const double more = (on->mu - scene.contact.mu) * std::abs(active.normal_force_n) *
                          EvaluateFrictionGain(scene.contact, v_t.squaredNorm()).gain;
      dynamics.AddWrench(body, Space::ForceAt(active.point, -more * v_t));
    }
  }

  void ApplyPushes() {
    HybridDynamics<Space>& dynamics = robot.dynamics;
    push_n = {};
    for (std::size_t p = 0; p < config.pushes.size(); ++p) {
      const Push& push = config.pushes[p];
      if (push.since_enabled && enabled_ns < 0) continue;
      const double since_s =
          1e-9 * static_cast<double>(time_ns - (push.since_enabled ? enabled_ns : 0));
      if (since_s < push.start_s || since_s >= push.start_s + push.duration_s) continue;
      const int body = push_bodies[p];
      const Vector at =
          dynamics.position(body) + dynamics.rotation(body) * VectorIn<Space>(push.point_m);
      dynamics.AddWrench(body, Space::ForceAt(at, VectorIn<Space>(push.force_n)));
      for (std::size_t i = 0; i < 3; ++i) push_n[i] += push.force_n[i];
    }
  }

  /// Finds what touches the robot in the state that it is in, and what pushes it.
  void Touch() {
    robot.Touch();
    ApplyPatches();
    ApplyPushes();
  }

  /// The slope after Touch, with these torques of the drives.
  void Solve(const typename Dynamics::Numbers& torques, double* k) {
    robot.tau = torques;
    for (std::size_t j = 0; j < drives.size(); ++j) {
      const std::size_t dof = scene.robot.DofOfJoint(j);
      robot.tau[dof] += Resistance(j, robot.q[dof], robot.qd[dof]);
    }
    for (const auto& [dof, stop] : passive_stops)
      robot.tau[dof] += stop.Torque(robot.q[dof], robot.qd[dof]);
    robot.Solve();
    robot.TakeSlope(k);
  }

  void NoteContacts() {
    normal_force = 0;
    touching.clear();
    for (const ActiveContact<Space>& a : robot.contact->active()) {
      peak_penetration = std::max(peak_penetration, a.depth_m);
      normal_force += a.normal_force_n;
      touching.push_back(a);
      const double speed = ApproachOf(a);
      if (speed <= impact) continue;
      impact = speed;
      impact_body = BodyOfContact(a);
    }
  }

  /// The speed with which a contact's point moves into what it touches.
  [[nodiscard]] double ApproachOf(const ActiveContact<Space>& active) const {
    const HybridDynamics<Space>& dynamics = robot.dynamics;
    Vector v = dynamics.velocity(BodyOfContact(active)).At(active.point);
    if (active.other_shape >= 0) {
      const int other = scene.robot.shapes[Index(active.other_shape)].body;
      v -= dynamics.velocity(other).At(active.point);
    }
    return -v.dot(active.normal);
  }

  /// Takes a step by the midpoint rule. The order suffices because the drives' loops need a step
  /// that is far shorter than contact would need.
  void Integrate(double h) {
    StepRungeKutta<kMidpoint>(y, 2 * robot.free.size(), h,
                              [this](int s, const typename Dynamics::State& state, double* k) {
                                robot.SetFree(state);
                                Touch();
                                Solve(drive_torque, k);
                                if (s == 0) NoteContacts();
                                return true;
                              });
    MoveChart();
  }

  /// Turns the root's axes after a step.
  void MoveChart() {
    if constexpr (RootChart<Space>::kMoves) {
      if (stands) return;
      constexpr std::size_t kFirst = RootChart<Space>::kFirst;
      chart.MoveOn(&y[kFirst], &y[robot.free.size() + kFirst]);
      robot.Use(chart);
    }
  }

  /// The torques of the drives at a time after their last step, in the state that the robot is in.
  [[nodiscard]] typename Dynamics::Numbers TorquesAt(std::int64_t at_ns) const {
    typename Dynamics::Numbers torques{};
    for (std::size_t j = 0; j < drives.size(); ++j) {
      const std::size_t dof = scene.robot.DofOfJoint(j);
      torques[dof] = drives[j]->TorqueAt(at_ns, robot.q[dof], robot.qd[dof]);
    }
    return torques;
  }

  /// The next time, at most `limit_ns`, at which something may change how the robot moves: a frame
  /// reaches a drive, a drive acts by itself, a push begins or ends.
  [[nodiscard]] std::int64_t NextChange(std::int64_t limit_ns) const {
    std::int64_t next = limit_ns;
    const auto consider = [this, &next](std::int64_t at_ns) {
      if (at_ns > time_ns) next = std::min(next, at_ns);
    };
    consider(bus.NextDelivery());
    for (const SimulatedDrive* drive : drives) consider(drive->next_act_ns());
    for (const Push& push : config.pushes) {
      if (push.since_enabled && enabled_ns < 0) continue;
      const double from_s =
          push.start_s + (push.since_enabled ? 1e-9 * static_cast<double>(enabled_ns) : 0);
      consider(std::llround(1e9 * from_s));
      consider(std::llround(1e9 * (from_s + push.duration_s)));
    }
    return next;
  }

  /// Takes one step by the midpoint rule that ends at `end_ns` at the latest, and is as long as the
  /// error bound allows. Times that are left to `end_ns` are divided into equal steps.
  void StepWithinError(std::int64_t end_ns) {
    const std::size_t n = robot.free.size();
    if (!config.pushes.empty()) at_start = AtStart::kUnknown;  // One may begin or end here.
    if (at_start == AtStart::kUnknown) {
      robot.SetFree(y);
      Touch();
      slope_torque = drive_torque;
      Solve(slope_torque, slope.data());
    }
    NoteContacts();
    const std::int64_t left_ns = end_ns - time_ns;
    for (;;) {
      const std::int64_t steps = (left_ns + wanted_step_ns - 1) / wanted_step_ns;
      const std::int64_t step_ns = (left_ns + steps - 1) / steps;
      const double h = 1e-9 * static_cast<double>(step_ns);
      typename Dynamics::State later, middle_slope, end_slope;
      for (std::size_t i = 0; i < 2 * n; ++i) later[i] = y[i] + 0.5 * h * slope[i];
      Evaluate(later, time_ns + step_ns / 2, middle_slope);
      for (std::size_t i = 0; i < 2 * n; ++i) later[i] = y[i] + h * middle_slope[i];
      Evaluate(later, time_ns + step_ns, end_slope);
      double error = 0;  // of Simpson's rule against the midpoint's
      for (std::size_t i = n; i < 2 * n; ++i) {
        error = std::max(error, h / 6 * std::abs(slope[i] - 2 * middle_slope[i] + end_slope[i]) /
                                    (kTwinStepError * (1 + std::abs(y[i]))));
      }
      double factor = std::clamp(0.9 * portable::Power(std::max(error, 1e-3), -1.0 / 3), 0.3, 4.0);
      // A mode that the drives damp at the rate r makes the step unstable from h r = 2 on, before
      // any error shows where the robot rests. How slopes and states differ tells the fastest rate
      // that takes part.
      double changes = 0, moves = 0;
      for (std::size_t i = n; i < 2 * n; ++i) {
        const double change = end_slope[i] - middle_slope[i];
        const double move = h * (middle_slope[i] - 0.5 * slope[i]);
        changes += change * change;
        moves += move * move;
      }
      if (const double rate = std::sqrt(changes / moves); h * factor * rate > kSlowEnough)
        factor = kSlowEnough / (h * rate);
      const auto advised_ns = static_cast<std::int64_t>(factor * static_cast<double>(step_ns));
      const bool shortest = step_ns <= config.step_ns;
      if (error > 1 && !shortest) {
        wanted_step_ns = std::clamp(advised_ns, config.step_ns, kTwinLongestStep_ns);
        continue;
      }
      // A step that had to end early says nothing against a longer one.
      if (factor < 1 || step_ns >= wanted_step_ns || advised_ns > wanted_step_ns)
        wanted_step_ns = std::clamp(advised_ns, config.step_ns, kTwinLongestStep_ns);
      y = later;
      slope = end_slope;
      time_ns += step_ns;
      at_start = AtStart::kSolved;
      if constexpr (RootChart<Space>::kMoves) {
        MoveChart();
        at_start = AtStart::kUnknown;  // The slope is that of the chart before.
      }
      return;
    }
  }

  /// The slope in a state at a time within a step.
  void Evaluate(const typename Dynamics::State& state, std::int64_t at_ns,
                typename Dynamics::State& k) {
    robot.SetFree(state);
    Touch();
    slope_torque = TorquesAt(at_ns);
    Solve(slope_torque, k.data());
  }

  /// Lets the drives take what has come up to now, and act.
  void PassBus() {
    // What a drive answers is what it measures when the frame has come.
    if (bus.NextDelivery() <= time_ns) Drive();
    bus.AdvanceTo(time_ns);
    Drive();
    if (at_start != AtStart::kSolved) return;
    typename Dynamics::Numbers more{}, acceleration{};
    for (std::size_t i = 0; i < robot.n; ++i) more[i] = drive_torque[i] - slope_torque[i];
    robot.dynamics.Respond({more.data(), robot.n}, {acceleration.data(), robot.n});
    for (std::size_t i = 0; i < robot.free.size(); ++i)
      slope[robot.free.size() + i] += acceleration[robot.free[i]];
    slope_torque = drive_torque;
  }

  void AdvanceWithinError(std::int64_t target_ns) {
    while (time_ns < target_ns) {
      PassBus();
      const std::int64_t change_ns = NextChange(target_ns);
      if (held) {
        time_ns = std::min(change_ns, time_ns + kTwinLongestStep_ns);
        continue;
      }
      StepWithinError(change_ns);
    }
    PassBus();
  }

  [[nodiscard]] double q(std::size_t dof) const {
    return place[dof] < 0 ? start_positions[dof] : y[Index(place[dof])];
  }
  [[nodiscard]] double qd(std::size_t dof) const {
    return place[dof] < 0 ? 0 : y[robot.free.size() + Index(place[dof])];
  }

  TwinConfig config;
  SceneOf<Space> scene;
  Dynamics robot;
  mutable SelfDistancesIn<Space> distances;  // with room for its work
  SimulatedBus& bus;
  std::vector<SimulatedDrive*> drives;
  std::vector<double> start_positions;  // of all degrees of freedom
  typename Dynamics::State start_state, y;
  RootChart<Space> start_chart, chart;
  std::vector<int> place;  // of each degree of freedom in the state; -1: stand or bar holds it
  typename Dynamics::Numbers drive_torque{};
  std::vector<std::pair<std::size_t, JointStop<double>>> passive_stops;  // with their places
  std::vector<int> push_bodies, patch_obstacles;
  std::vector<ActiveContact<Space>> touching;
  std::array<double, 3> push_n{};
  std::int64_t time_ns = 0;
  std::int64_t enabled_ns = -1;  // when all drives were first enabled; -1: not yet
  bool stands;
  bool held;
  /// Of steps within an error bound: what is known of the state y.
  enum class AtStart : std::uint8_t {
    kUnknown,
    kSolved,  ///< The slope with these torques of the drives. `robot` is in the state.
  };
  AtStart at_start = AtStart::kUnknown;
  typename Dynamics::State slope{};
  typename Dynamics::Numbers slope_torque{};  // with which the last slope was found
  std::int64_t wanted_step_ns = config.step_ns;
  mutable TwinState told;  // with room for its work
  mutable bool told_is_true = false;
  double peak_penetration = 0;
  double normal_force = 0;
  double impact = 0;
  int impact_body = -1;  // -1: nothing was touched
};

template <class Space>
void TwinIn<Space>::AdvanceTo(std::int64_t target_ns) {
  told_is_true = false;
  if (config.steps == TwinConfig::Steps::kErrorBound) return AdvanceWithinError(target_ns);
  while (time_ns < target_ns) {
    const std::int64_t next = std::min(time_ns + config.step_ns, target_ns);
    bus.AdvanceTo(time_ns);
    Drive();
    if (!held) Integrate(1e-9 * static_cast<double>(next - time_ns));
    time_ns = next;
  }
  bus.AdvanceTo(target_ns);
  Drive();
}

template <class Space>
void TwinIn<Space>::TellRoot() const {
  if constexpr (std::is_same_v<Space, Plane>) {
    if (scene.robot.root_dofs != 3) return;
    told.root_x_m = q(0);
    told.root_z_m = q(1);
    told.root_pitch_rad = q(2);
    told.root_vx_m_s = qd(0);
    told.root_vz_m_s = qd(1);
    told.root_pitch_rate_rad_s = qd(2);
  } else {
    told.root_x_m = q(0);
    told.root_y_m = q(1);
    told.root_z_m = q(2);
    told.root_vx_m_s = qd(0);
    told.root_vy_m_s = qd(1);
    told.root_vz_m_s = qd(2);
    // Between steps the angles are 0, and their rates the angular velocity about -y, x and z.
    told.root_quaternion = ToQuaternion(chart.axes);
    const SpaceVector w = chart.axes * SpaceVector(qd(4), -qd(3), qd(5));
    told.root_angular_velocity_rad_s = {w.x(), w.y(), w.z()};
  }
}

template <class Space>
const TwinState& TwinIn<Space>::state() const {
  if (told_is_true) return told;
  told_is_true = true;
  told.time_ns = time_ns;
  told.held = held || stands;
  told.enabled_ns = enabled_ns;
  told.push_n = push_n;
  TellRoot();
  for (std::size_t j = 0; j < scene.robot.joint_count(); ++j) {
    const std::size_t dof = scene.robot.DofOfJoint(j);
    told.joint_positions_rad[j] = q(dof);
    told.joint_velocities_rad_s[j] = qd(dof);
    told.joint_torques_nm[j] = drive_torque[dof];
  }
  for (std::size_t i = 0; i < scene.robot.passive.size(); ++i) {
    const std::size_t dof = Index(scene.robot.passive[i].dof);
    told.passive_positions_rad[i] = q(dof);
    told.passive_velocities_rad_s[i] = qd(dof);
  }
  told.peak_penetration_m = peak_penetration;
  told.impact_m_s = impact;
  told.impact_link.clear();
  if (impact_body >= 0) told.impact_link = scene.robot.body_names[Index(impact_body)];
  typename Dynamics::Numbers positions{};
  for (std::size_t dof = 0; dof < robot.n; ++dof) positions[dof] = q(dof);
  const SelfClearance own = distances.Nearest({positions.data(), robot.n}, 0);
  const bool overlaps = own.distance_m < 0;
  told.self_overlap_m = overlaps ? -own.distance_m : 0;
  told.overlapping = overlaps ? NameOf(scene.robot, own.pair) : "";
  told.normal_force_n = normal_force;
  return told;
}

template <class Space>
std::vector<TwinContact> TwinIn<Space>::contacts() const {
  std::vector<TwinContact> contacts;
  for (const ActiveContact<Space>& active : touching) {
    contacts.push_back({scene.robot.body_names[Index(BodyOfContact(active))],
                        TouchedName(scene, active), active.normal_force_n});
  }
  return contacts;
}

template <class Space>
void TwinIn<Space>::Displace(std::span<const double> more_q, std::span<const double> more_v) {
  told_is_true = false;
  const std::size_t root = Index(scene.robot.root_dofs);
  const std::size_t count = root + scene.robot.joint_count();
  if (more_q.size() != count || more_v.size() != count)
    throw std::invalid_argument("the root's degrees of freedom and each joint need one number");
  for (std::size_t i = 0; i < count; ++i) {
    const int at = place[i < root ? i : scene.robot.DofOfJoint(i - root)];
    if (at < 0) continue;
    y[Index(at)] += more_q[i];
    y[robot.free.size() + Index(at)] += more_v[i];
  }
  MoveChart();
  at_start = AtStart::kUnknown;
}

template <class Space>
void TwinIn<Space>::ForgetImpacts() {
  told_is_true = false;
  impact = 0;
  impact_body = -1;
}

template <class Space>
void TwinIn<Space>::PutBack() {
  told_is_true = false;
  y = start_state;
  chart = start_chart;
  robot.Use(chart);
  at_start = AtStart::kUnknown;
  touching.clear();
  normal_force = 0;
  held = config.held && !stands;
  Drive();
}

}  // namespace

Twin::Twin(const Scene& scene, const PrimitivePose& start, const TwinConfig& config,
           SimulatedBus& bus, std::vector<SimulatedDrive*> drives)
    : body_(std::make_unique<TwinIn<Plane>>(scene, start, config, bus, std::move(drives))) {}
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
