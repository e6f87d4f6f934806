#include "offline/certify/chain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/planned_passages.h"
#include "common/files/toml_reader.h"
#include "offline/certify/chain_world.h"
#include "offline/problem/purpose_gauge.h"
#include "offline/problem/task_frame.h"
#include "offline/scene/even_steps.h"
#include "offline/scene/passive_limits.h"
#include "offline/scene/quaternion.h"
#include "offline/scene/rest_pose.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/stepper.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

constexpr double kPi = std::numbers::pi;
/// A state beyond this (m, rad, and their rates) is a failed simulation.
constexpr double kImplausible = 1e4;
/// A root that is turned further than this [rad] from the plan has fallen: a robot that has tipped
/// over an edge of its feet does not come back.
constexpr double kFallenPitch = 0.5;
constexpr double kPostureTolerance = 0.1;

template <class Space>
class Simulation {
 public:
  using Visitor = std::function<void(int, const MotionSampleIn<Space>&)>;
  using Dynamics = SceneDynamicsIn<Space>;

  Simulation(const SimulatedMotion& motion, const ChainOptions& options, const Visitor& visitor)
      : file_(motion.file()), options_(options), visitor_(visitor) {
    const SceneOf<Space>& scene = SceneIn<Space>(motion.problem());
    root_ = scene.robot.root_dofs > 0;
    if constexpr (kPlanar) {
      hinged_ = scene.robot.hinged();
      bar_ = scene.bar;
    }
    for (std::size_t i = 0; i < file_.primitives.size(); ++i) {
      worlds_.push_back(
          std::make_unique<ChainWorld<Space>>(file_.primitives[i], motion.ProblemOf(i)));
    }
    CheckPassiveJoints();
    for (int node = 0; node < file_.graph.node_count; ++node) {
      if (WorldOf(node).plan.empty()) Plan(node);
    }
  }

  ChainOutcome Run() {
    const std::vector<PlannedPassage> planned =
        PlannedPassages(file_, options_.cycles, options_.branch);
    SetStart(file_.graph.start);
    for (const PlannedPassage& next : planned) {
      PlayedNode& passage = outcome_.passages.emplace_back();
      passage.node = next.node;
      followed_ = false;
      passage.start_s = start_s_ = time_;
      passage.torque_margin_nm = std::numeric_limits<double>::infinity();
      if (!Enter(passage)) break;
      const RootPlace before = Place();
      bool going = Move(passage);
      if (going) {
        outcome_.cycles = next.cycles;
        followed_ = next.edge >= 0;
        going =
            Hold(passage, followed_ ? file_.graph.edge(next.edge).settle_s : LastHold(next.node));
      }
      passage.travelled_m = TravelledFrom(before);
      passage.turned_rad = Place().turned_rad - before.turned_rad;
      if (!going || !Leave(passage)) break;
    }
    outcome_.duration_s = time_;
    outcome_.travelled_m = TravelledFrom(start_);
    return std::move(outcome_);
  }

 private:
  static constexpr bool kPlanar = std::is_same_v<Space, Plane>;

  [[nodiscard]] ChainWorld<Space>& WorldOf(int node) const {
    return *worlds_[Index(file_.graph.node(node).primitive)];
  }

  /// The state of passive joints goes on from one primitive to the next.
  /// @throws std::invalid_argument  when joints change places.
  void CheckPassiveJoints() const {
    if (worlds_.front()->scene.robot.passive.empty()) return;
    for (int node = 0; node < file_.graph.node_count; ++node) {
      for (int j = 0; j < WorldOf(node).file.primitive.joint_count; ++j) {
        if (file_.graph.RoleOf(node, j) == j) continue;
        throw std::invalid_argument(fmt::format(
            "the sequence '{}' exchanges the roles of joints, which robots with joints without a "
            "motor cannot",
            file_.graph.name.view()));
      }
    }
  }

  // On a bar the pitch is all that is free of the root.
  [[nodiscard]] double RootX() const { return hinged_ ? bar_.x() : root_ ? root_state_[0] : 0.0; }
  [[nodiscard]] double RootY() const { return kPlanar ? 0.0 : root_state_[1]; }
  [[nodiscard]] double RootZ() const {
    return hinged_ ? bar_.y() : root_ ? root_state_[kPlanar ? 1 : 2] : 0.0;
  }
  /// In the plane.
  [[nodiscard]] double RootPitch() const {
    return hinged_ ? root_state_[0] : root_ ? root_state_[2] : 0.0;
  }
  [[nodiscard]] double RootSpeed() const {
    const std::size_t first = worlds_.front()->robot.free.size();  // of the velocities
    double speed = 0;
    for (std::size_t i = 0; i < FreeOfRoot(); ++i)
      speed = std::max(speed, std::abs(root_state_[first + i]));
    return speed;
  }
  /// How many of the root's degrees of freedom are free.
  [[nodiscard]] std::size_t FreeOfRoot() const {
    return hinged_ ? 1 : Index(worlds_.front()->scene.robot.root_dofs);
  }

  struct RootPlace {
    double x_m = 0, y_m = 0;
    double turned_rad = 0;  // its pitch; in space, about the vertical since the start
  };
  [[nodiscard]] RootPlace Place() const {
    if constexpr (kPlanar) {
      return {RootX(), RootY(), RootPitch()};
    } else {
      return {RootX(), RootY(), Turned()};
    }
  }
  /// About the vertical since the start, in space. The sum of small turns about it is not by how
  /// much the heading has changed where the robot tilts meanwhile: within a motion it tells the
  /// whole turns alone, and all where the robot turns over, so that it has no heading to compare.
  [[nodiscard]] double Turned() const {
    const SpaceMatrix R = chart_.axes * began_axes_.transpose();
    constexpr double kTurnedOver = 0.5;  // of 2, while it turns about the vertical alone
    if (portable::Length(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1)) < kTurnedOver)
      return began_turned_rad_ + turned_rad_;
    const double heading = TurnedAboutVertical(began_axes_, chart_.axes);
    return began_turned_rad_ + turned_rad_ - NearestTurn(turned_rad_ - heading);
  }
  /// A motion begins.
  void RestartTurn() {
    began_turned_rad_ = Turned();
    began_axes_ = chart_.axes;
    turned_rad_ = 0;
  }
  [[nodiscard]] double TravelledFrom(const RootPlace& before) const {
    const double x_m = RootX() - before.x_m;
    return kPlanar ? x_m : portable::Length(x_m, RootY() - before.y_m);
  }

  /// On a bar nothing comes to rest by itself, and the exit is where the settle phase ends. A robot
  /// that is to move at the end is not held.
  [[nodiscard]] double LastHold(int node) {
    if (WorldOf(node).problem.ends_moving()) return 0;
    if (!hinged_) return options_.last_hold_s;
    const PrimitiveFile& file = WorldOf(node).file;
    double until_s = file.primitive.duration_s + file.primitive.settle_s;
    for (const PurposeFigure& figure : file.purpose)
      until_s = std::max(until_s, DueTimeOf(figure, file));
    return std::min(options_.last_hold_s, until_s - file.primitive.duration_s);
  }

  /// Plays the node's primitive alone, as it was planned.
  void Plan(int node) {
    planning_ = true;
    SetStart(node);
    PlayedNode passage;
    passage.node = node;
    if (Move(passage) && !WorldOf(node).problem.ends_moving()) Hold(passage, kExitAfter_s);
    planning_ = false;
    outcome_ = {};
    time_ = 0;
  }

  void SetStart(int node) {
    root_state_.fill(0);
    time_ = start_s_ = 0;
    const PrimitivePose& entry = WorldOf(node).file.entry;
    const double pitch = file_.RobotPitch(node, entry.root_pitch_rad);
    // Positions of the root and of joints without a motor, then their velocities.
    const std::size_t root = FreeOfRoot();
    const std::size_t rates = root + entry.passive_positions_rad.size();
    if constexpr (!kPlanar) {
      root_state_[0] = entry.root_x_m;
      root_state_[1] = entry.root_y_m;
      root_state_[2] = entry.root_z_m;
      chart_.axes = ToRotation(entry.root_quaternion);
      began_axes_ = chart_.axes;
      began_turned_rad_ = turned_rad_ = 0;
    } else if (hinged_) {
      root_state_[0] = pitch;
      root_state_[rates] = entry.root_pitch_rad_s;
    } else if (root_) {
      root_state_[0] = entry.root_x_m;
      root_state_[1] = entry.root_z_m;
      root_state_[2] = pitch;
      root_state_[rates] = entry.root_x_m_s;
      root_state_[rates + 1] = entry.root_z_m_s;
      root_state_[rates + 2] = entry.root_pitch_rad_s;
    }
    std::copy(entry.passive_positions_rad.begin(), entry.passive_positions_rad.end(),
              root_state_.begin() + static_cast<std::ptrdiff_t>(root));
    start_ = Place();
  }

  bool Fail(ChainFailure::Cause cause, int node, std::string text) {
    outcome_.failure = {cause, node, time_, std::move(text)};
    return false;
  }

  /// The root's pitch less a planned one of the node's primitive, without whole turns [rad]; in
  /// space the angle from what is vertical in the plan.
  [[nodiscard]] double AngleFrom(int node, const Attitude<Space>& planned) const {
    if constexpr (kPlanar) {
      return root_ ? NearestTurn(RootPitch() - file_.RobotPitch(node, planned)) : 0.0;
    } else {
      const double sine = std::min(1.0, (VerticalIn(chart_.axes) - planned).norm() / 2);
      return 2 * portable::Atan2(sine, std::sqrt(1 - sine * sine));
    }
  }
  /// The same from a pose of the primitive.
  [[nodiscard]] double AngleFrom(int node, const PrimitivePose& pose) const {
    return AngleFrom(node, AttitudeOf<Space>(pose));
  }

  bool Enter(PlayedNode& passage) {
    if constexpr (!kPlanar) RestartTurn();
    const PrimitivePose& entry = WorldOf(passage.node).file.entry;
    passage.entry_z_error_m = root_ ? RootZ() - entry.root_z_m : 0.0;
    passage.entry_pitch_error_rad = AngleFrom(passage.node, entry);
    passage.entry_speed = RootSpeed();
    BeginPurpose(passage);
    const JoinTolerances& t = file_.tolerances;
    if (!(std::abs(passage.entry_z_error_m) <= t.root_z_m)) {
      return Fail(ChainFailure::Cause::kEntry, passage.node,
                  fmt::format("root, height: {} m from the entry; allowed: {} m",
                              MessageText(passage.entry_z_error_m), MessageText(t.root_z_m)));
    }
    if (!(std::abs(passage.entry_pitch_error_rad) <= t.root_pitch_rad)) {
      return Fail(
          ChainFailure::Cause::kEntry, passage.node,
          fmt::format("root, {}: {} rad from the entry; allowed: {} rad", kAttitudeName<Space>,
                      MessageText(passage.entry_pitch_error_rad), MessageText(t.root_pitch_rad)));
    }
    return true;
  }

  bool Leave(PlayedNode& passage) {
    const PrimitivePose& exit = WorldOf(passage.node).file.exit;
    passage.exit_z_error_m = root_ ? RootZ() - exit.root_z_m : 0.0;
    passage.exit_pitch_error_rad = AngleFrom(passage.node, exit);
    passage.exit_speed = RootSpeed();
    passage.posture = PostureAt(passage.node);
    const double tolerance = file_.exit_pitch_tolerance_rad[Index(passage.node)];
    if (!(std::abs(passage.exit_pitch_error_rad) <= tolerance)) {
      return Fail(ChainFailure::Cause::kExit, passage.node,
                  fmt::format("root, {}: {} rad from the recorded exit; allowed: {} rad",
                              kAttitudeName<Space>, MessageText(passage.exit_pitch_error_rad),
                              MessageText(tolerance)));
    }
    for (const JudgedTarget& judged : passage.purpose) {
      if (judged.met() != false) continue;
      return Fail(ChainFailure::Cause::kPurpose, passage.node,
                  fmt::format("{}: {}", judged.name(), judged.Verdict()));
    }
    return true;
  }

  static double DueTimeOf(const PurposeTarget& target, const PrimitiveFile& file) {
    return DueTime(target, file.primitive.duration_s, file.primitive.settle_s);
  }

  /// Notes where the motion begins: its task has it at the primitive's entry.
  void BeginPurpose(PlayedNode& passage) {
    const ChainWorld<Space>& world = WorldOf(passage.node);
    for (std::size_t i = 0; i < world.gauges.size(); ++i)
      passage.purpose.push_back({world.file.purpose[i], {}, {}, world.gauges[i].obstacle()});
    const PrimitivePose& entry = world.file.entry;
    if constexpr (kPlanar) {
      const double entry_rad = entry.root_pitch_rad;
      task_x_m_ = entry.root_x_m - RootX();
      task_pitch_rad_ = AngleFrom(passage.node, entry_rad) + entry_rad - RootPitch();
    } else {
      task_ = TaskFrame(entry, RootX(), RootY(), chart_.axes);
    }
  }

  /// Judges the targets that are due at a time since the start of the node.
  /// @param all  judges all, since the next motion begins.
  /// @pre the world's robot is in the state at that time.
  void JudgePurpose(PlayedNode& passage, const ChainWorld<Space>& world, double time_s, bool all) {
    const double duration_s = world.file.primitive.duration_s;
    const bool swings_on = hinged_ && !world.file.primitive.feedback.present();
    for (std::size_t i = 0; i < passage.purpose.size(); ++i) {
      JudgedTarget& judged = passage.purpose[i];
      if (judged.result || !judged.obstacle.empty()) continue;
      const bool rests = judged.target.when == PurposeTarget::When::kSettled ||
                         judged.target.when == PurposeTarget::When::kLater;
      const bool waits = rests && followed_ && !swings_on;
      if (!all && (waits || time_s < DueTimeOf(judged.target, world.file) - 1e-9)) continue;
      judged.Judge(ValueOf(passage.node, world, i));
      judged.after_s = time_s - duration_s;
    }
  }

  /// The value of a target in the coordinates of the task.
  [[nodiscard]] double ValueOf(int node, const ChainWorld<Space>& world, std::size_t target) {
    if (world.file.purpose[target].of == PurposeTarget::Of::kSpeed)
      return std::ranges::max(speeds_, {}, &SpeedAt::speed).speed;
    typename Dynamics::Numbers q = world.robot.q, qd = world.robot.qd;
    SpaceMatrix axes = SpaceMatrix::Identity();
    if constexpr (!kPlanar) {
      axes = chart_.axes;
      task_.Enter({q.data(), world.robot.n}, {qd.data(), world.robot.n}, axes);
    } else if (root_) {
      q[0] = RootX() + task_x_m_;
      q[1] = RootZ();
      q[2] = RootPitch() + task_pitch_rad_;
    }
    for (std::size_t j = 0; j < world.dof_of_joint.size(); ++j) {
      const std::size_t role =
          world.dof_of_joint[Index(file_.graph.RoleOf(node, static_cast<int>(j)))];
      q[role] = world.robot.q[world.dof_of_joint[j]];
      qd[role] = world.robot.qd[world.dof_of_joint[j]];
    }
    return world.gauges[target].At({q.data(), world.robot.n}, {qd.data(), world.robot.n}, axes);
  }

  /// Judges at the end of a motion or a hold, where no step begins.
  /// @param t  of the primitive; kHeld: after it.
  void JudgeAtEnd(PlayedNode& passage, ChainWorld<Space>& world, double t, bool all) {
    if (planning_ || passage.purpose.empty()) return;
    NoteSpeed();
    world.robot.Use(chart_);
    world.robot.SetFree(root_state_);
    Prescribe(passage.node, world, t);
    JudgePurpose(passage, world, time_ - start_s_, all);
  }

  void NoteSpeed() {
    speeds_.push_back({time_, RootSpeed()});
    while (speeds_.front().time_s < time_ - kRestWatched_s) speeds_.pop_front();
  }

  [[nodiscard]] Posture PostureAt(int node) {
    double turned_rad = 0;  // from level
    if constexpr (kPlanar) {
      if (hinged_) return PostureOnBar(node);
      if (!root_) return Posture::kFixed;
      turned_rad = RootPitch();
    } else {
      turned_rad = AngleFrom(node, SpaceVector::UnitZ());
    }
    const double half_turn = std::abs(std::remainder(turned_rad, kPi));
    return half_turn <= kPostureTolerance             ? Posture::kLevel
           : kPi / 2 - half_turn <= kPostureTolerance ? Posture::kUpright
                                                      : Posture::kInclined;
  }
  /// Where the robot's centre of mass is, seen from its bar.
  [[nodiscard]] Posture PostureOnBar(int node) requires kPlanar {
    const Dynamics& robot = WorldOf(node).robot;
    const double turned = std::abs(TurnFromHanging(WorldOf(node).scene, {robot.q.data(), robot.n}));
    return turned <= kPostureTolerance         ? Posture::kHanging
           : kPi - turned <= kPostureTolerance ? Posture::kAbove
                                               : Posture::kInclined;
  }

  static std::string MessageText(double value) { return fmt::format("{:.4g}", value); }

  bool Move(PlayedNode& passage) {
    ChainWorld<Space>& world = WorldOf(passage.node);
    const double duration = world.file.primitive.duration_s;
    const EvenSteps steps = StepsOf(world, duration);
    const double start = time_;
    for (int i = 0; i < steps.count; ++i) {
      const auto time_at = [&](double c) { return (i + c) / steps.count * duration; };
      if (!Step(passage, world, steps.step_s, time_at)) return false;
      time_ = start + time_at(1);
    }
    JudgeAtEnd(passage, world, duration, false);
    return true;
  }

  bool Hold(PlayedNode& passage, double hold_s) {
    ChainWorld<Space>& world = WorldOf(passage.node);
    passage.hold_s = hold_s;
    const EvenSteps steps = StepsOf(world, hold_s);
    const double start = time_;
    for (int i = 0; i < steps.count; ++i) {
      if (!Step(passage, world, steps.step_s, [](double) { return kHeld; })) return false;
      time_ = start + (i + 1.0) / steps.count * hold_s;
    }
    JudgeAtEnd(passage, world, kHeld, followed_);
    return true;
  }

  [[nodiscard]] EvenSteps StepsOf(const ChainWorld<Space>& world, double duration_s) const {
    return {duration_s, options_.step_s > 0 ? options_.step_s : world.problem.solver.step_s};
  }

  /// Puts the robot's joints where the node's primitive has them at its time t.
  void Prescribe(int node, ChainWorld<Space>& world, double t) {
    Dynamics& robot = world.robot;
    for (int j = 0; j < world.file.primitive.joint_count; ++j) {
      const std::size_t dof = world.dof_of_joint[Index(j)];
      const auto& path = world.file.primitive.joints[Index(file_.graph.RoleOf(node, j))].position;
      if (t == kHeld) {
        robot.q[dof] = path.control_points().back();
        robot.qd[dof] = robot.qdd[dof] = 0;
        continue;
      }
      const auto sample = path.Evaluate(t);
      robot.q[dof] = sample.value;
      robot.qd[dof] = sample.first;
      robot.qdd[dof] = sample.second;
    }
  }

  /// One step of the root. `time_at` gives the time of the node for a part of the step, 0 to 1.
  template <class TimeAt>
  bool Step(PlayedNode& passage, ChainWorld<Space>& world, double h, const TimeAt& time_at) {
    Dynamics& robot = world.robot;
    const std::size_t size = 2 * robot.free.size();
    robot.Use(chart_);
    const bool going = StepRungeKutta<kClassical>(
        root_state_, size, h, [&](int s, const typename Dynamics::State& y_s, double* k) {
          robot.SetFree(y_s);
          Prescribe(passage.node, world, time_at(kClassical.c[Index(s)]));
          robot.TouchAndSolve();
          robot.TakeSlope(k);
          return s > 0 || Look(passage, world);
        });
    if (!going) return false;
    const bool plausible =
        std::all_of(root_state_.begin(), root_state_.begin() + static_cast<std::ptrdiff_t>(size),
                    [](double value) { return std::abs(value) < kImplausible; });
    if (!plausible) {
      return Fail(ChainFailure::Cause::kImplausible, passage.node,
                  "the state leaves every plausible range");
    }
    if constexpr (RootChart<Space>::kMoves) {
      constexpr std::size_t kFirst = RootChart<Space>::kFirst;
      const SpaceMatrix before = chart_.axes;
      chart_.MoveOn(&root_state_[kFirst], &root_state_[robot.free.size() + kFirst]);
      turned_rad_ += TurnedAboutVertical(before, chart_.axes);
    }
    return true;
  }

  /// Takes the state at the start of a step into the figures of the passage.
  bool Look(PlayedNode& passage, ChainWorld<Space>& world) {
    const int node = passage.node;
    if (planning_) {
      if constexpr (kPlanar) {
        world.plan.push_back({time_ - start_s_, RootPitch() - file_.RobotPitch(node, 0)});
      } else {
        world.plan.push_back({time_ - start_s_, VerticalIn(chart_.axes)});
      }
      return true;
    }
    NoteSpeed();
    JudgePurpose(passage, world, time_ - start_s_, false);
    const double off = AngleFrom(node, world.PlannedAt(time_ - start_s_));
    const double allowed = std::max(kFallenPitch, file_.exit_pitch_tolerance_rad[Index(node)]);
    if (std::abs(off) > allowed) {
      return Fail(ChainFailure::Cause::kFallen, node,
                  fmt::format("root, {}: {} rad from the plan; more than {} rad is a fall",
                              kAttitudeName<Space>, MessageText(off), MessageText(allowed)));
    }
    for (std::size_t j = 0; j < world.dof_of_joint.size(); ++j) {
      const double torque = std::abs(world.robot.tau[world.dof_of_joint[j]]);
      passage.peak_torque_nm = std::max(passage.peak_torque_nm, torque);
      const std::size_t dof = world.dof_of_joint[j];
      const double lack =
          world.problem.joints[j].motor.LackAt(world.robot.tau[dof], world.robot.qd[dof]);
      const double limit = world.file.primitive.joints[j].limits.torque_max_nm;
      passage.torque_margin_nm = std::min(passage.torque_margin_nm, limit * (1 - lack) - torque);
    }
    const SelfClearance own = world.distances.Nearest({world.robot.q.data(), world.robot.n});
    if (own.distance_m < 0) {
      return Fail(
          ChainFailure::Cause::kOverlap, node,
          fmt::format("the robot's own shapes {} overlap by {} mm",
                      NameOf(world.scene.robot, own.pair), MessageText(-1e3 * own.distance_m)));
    }
    if constexpr (kPlanar) {
      const PassiveExcess passive =
          FarthestPassive(world.scene.robot, {world.robot.q.data(), world.robot.n});
      if (passive.by > 0)
        return Fail(ChainFailure::Cause::kStop, node, Describe(passive, world.scene.robot));
    }
    const std::span<const ActiveContact<Space>> contacts = world.robot.contact->active();
    if (visitor_) {
      const Dynamics& robot = world.robot;
      const auto n = static_cast<std::ptrdiff_t>(robot.n);
      sample_.time_s = time_;
      sample_.q.assign(robot.q.begin(), robot.q.begin() + n);
      sample_.qd.assign(robot.qd.begin(), robot.qd.begin() + n);
      sample_.torque.clear();
      for (const std::size_t dof : world.dof_of_joint) sample_.torque.push_back(robot.tau[dof]);
      sample_.contacts = contacts;
      sample_.dynamics = &robot.dynamics;
      if constexpr (!kPlanar) sample_.orientation = chart_.axes;
      visitor_(node, sample_);
    }
    for (const ActiveContact<Space>& active : contacts) {
      passage.peak_penetration_m = std::max(passage.peak_penetration_m, active.depth_m);
      const ContactShape<Space>& shape = world.scene.robot.shapes[Index(active.shape)];
      const std::string& obstacle = TouchedName(world.scene, active);
      if (active.depth_m >= world.scene.contact.d_on_m) {
        return Fail(ChainFailure::Cause::kCore, node,
                    fmt::format("{} is {} mm deep in {}, through the layer of {} mm", shape.name,
                                MessageText(1e3 * active.depth_m), obstacle,
                                MessageText(1e3 * world.scene.contact.d_on_m)));
      }
      if (world.touching_bodies.count(RoleOfBody(node, world, shape.body)) == 0) {
        return Fail(
            ChainFailure::Cause::kTouch, node,
            fmt::format("{} touches {}, which it never does in the plan", shape.name, obstacle));
      }
    }
    return true;
  }

  /// The body of the plan whose role a body of the robot has in this node.
  [[nodiscard]] int RoleOfBody(int node, const ChainWorld<Space>& world, int body) const {
    const auto& dofs = world.dof_of_joint;
    const auto joint = std::find(dofs.begin(), dofs.end(), Index(body));
    if (joint == dofs.end()) return body;
    const int role = file_.graph.RoleOf(node, static_cast<int>(joint - dofs.begin()));
    return static_cast<int>(dofs[Index(role)]);
  }

  static constexpr double kHeld = -1;  // stands for the time after the motion

  const SequenceFile& file_;
  const ChainOptions& options_;
  const Visitor& visitor_;
  bool root_ = false;    // whether the root is not fixed
  bool hinged_ = false;  // on a bar
  Plane::Vector bar_ = Plane::Vector::Zero();
  std::vector<std::unique_ptr<ChainWorld<Space>>> worlds_;  // by primitive
  typename Dynamics::State root_state_{};
  RootChart<Space> chart_;
  double turned_rad_ = 0;        // in space, the sum of small turns in this motion
  double began_turned_rad_ = 0;  // and what it was turned by where that began
  SpaceMatrix began_axes_ = SpaceMatrix::Identity();
  double time_ = 0;
  double start_s_ = 0;     // of the node
  bool planning_ = false;  // playing a primitive alone
  RootPlace start_;
  bool followed_ = false;  // whether another motion follows the one that is held
  // What makes the root's x and pitch those of the node's task; in space, all of the root.
  double task_x_m_ = 0, task_pitch_rad_ = 0;
  TaskFrame task_;
  struct SpeedAt {
    double time_s, speed;
  };
  std::deque<SpeedAt> speeds_;  // of the root, in the last kRestWatched_s
  MotionSampleIn<Space> sample_;
  ChainOutcome outcome_;
};

/// @throws as SimulateChain.
void CheckChain(const SimulatedMotion& motion) {
  RequireSameGround(motion);
  RequireOneRobot(motion);
}

}  // namespace

ChainOutcome SimulateChain(const SimulatedMotion& motion, const ChainOptions& options,
                           const std::function<void(int, const MotionSample&)>& visitor) {
  if (motion.problem().space) return SimulateChainInSpace(motion, options);
  CheckChain(motion);
  return Simulation<Plane>(motion, options, visitor).Run();
}

ChainOutcome SimulateChainInSpace(const SimulatedMotion& motion, const ChainOptions& options,
                                  const std::function<void(int, const SpaceSample&)>& visitor) {
  CheckChain(motion);
  return Simulation<Spatial>(motion, options, visitor).Run();
}

}  // namespace tumbler
