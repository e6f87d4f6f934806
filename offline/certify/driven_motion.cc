#include "offline/certify/driven_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "common/core/index.h"
#include "offline/certify/driven_robot.h"
#include "offline/model/contact_intent.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/space_lanes.h"
#include "offline/scene/stepper.h"
#include "offline/solve/rollout.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

constexpr int kRootPitch = 2;  // of the degrees of freedom, where the root has any
/// The executor's usual period [s].
constexpr double kPeriod_s = kUsualPeriod_s;

using DrivenRobot = DrivenRobotIn<Plane>;

/// Into how many parts, no longer than the usual period, a period is divided.
int TicksIn(double period_s) { return static_cast<int>(std::ceil(period_s / kPeriod_s - 1e-6)); }

/// How many steps a span of time is divided into, so that setpoints change between them.
/// @param parts  of the solver's step.
int StepsIn(double span_s, const Problem& problem, double longest_s, double parts) {
  const double step_s = std::min(longest_s, problem.solver.step_s / parts);
  return static_cast<int>(std::ceil(span_s / step_s - 1e-6));
}

/// Steps a robot until a time, visiting every step. @returns false when its state left every
/// plausible range.
/// @param longest_s  of the steps.
/// @param period_s   in which setpoints change.
template <class Robot, class Visit>
bool Play(const Problem& problem, Robot& robot, double longest_s, double period_s, double until_s,
          double finer, Visit&& visit) {
  const double calm_s = problem.duration_s + ExitAfter(problem);
  const double tick_s = period_s / TicksIn(period_s);
  const double fine_s = tick_s / StepsIn(tick_s, problem, longest_s, finer);
  const double coarse_s = tick_s / StepsIn(tick_s, problem, longest_s, 1);
  double time_s = 0;
  while (time_s < until_s) {
    const double step_s = time_s < calm_s ? fine_s : coarse_s;
    if (!visit(time_s)) return true;
    if (!robot.Step(time_s, step_s)) return false;
    time_s += step_s;
  }
  return true;
}

/// Robots in the lanes of one packet.
template <class Space>
class DrivenLanes {
  using Types = LaneTypes<Space>;
  template <class S>
  using Robot = typename Types::template Robot<S>;
  template <class S>
  using State = typename Types::template State<S>;
  static constexpr std::size_t kRoot = Types::kRootDofs;

 public:
  /// @param played  with the same period.
  /// @throws std::invalid_argument  where lanes do not have the scene.
  DrivenLanes(const Problem& problem, const std::vector<double>& x,
              std::span<const JointMotion<double>::Spline> feed_forward,
              std::span<const PlayedRobot<Space>> played)
      : problem_(&problem),
        feed_forward_(feed_forward),
        played_(played),
        ticks_(TicksIn(played[0].period_s)),
        tick_s_(played[0].period_s / ticks_) {
    std::array<Robot<double>, Packet::kLanes> robots{};
    std::array<State<double>, Packet::kLanes> states{};
    for (std::size_t i = 0; i < Packet::kLanes; ++i) {
      const PlayedRobot<Space>& robot = played[std::min(i, played.size() - 1)];
      const LaneDrive drive{.kp = robot.gains.kp_nm_per_rad, .kd = robot.gains.kd_nm_s_per_rad};
      const auto lanes = MakeLaneScene(robot.scene, drive);
      model_ = lanes.model;
      robots[i] = lanes.robot;
      robots[i].stop_stiffness = robots[i].stop_damping = 0;  // A path keeps its limits.
      states[i] = StartOf(robot.lean_rad);
      for (const ActuatedJoint& joint : problem.joints)
        robots[i].joints[LaneOf(joint)].torque_max = joint.limits.torque_max_nm;
    }
    if (model_.joints != problem.joints.size())
      throw std::invalid_argument("a joint of the robot has no path");
    robots_ = PackLanes<Robot>(robots);
    state_ = PackLanes<State>(states);
    TakePaths(x);
  }

  /// Goes on with another motion, of which the time begins at 0.
  /// @param problem  of the same robot.
  /// @param began_s  since the start of the first motion.
  void Begin(const Problem& problem, const std::vector<double>& x,
             std::span<const JointMotion<double>::Spline> feed_forward, double began_s) {
    problem_ = &problem;
    feed_forward_ = feed_forward;
    began_s_ = began_s;
    TakePaths(x);
  }

  /// From one look at the robots to the next one: a part of the period in which setpoints change.
  [[nodiscard]] double tick_s() const { return tick_s_; }

  void Play(int tick, int steps) {
    TakeSetpoints(tick / ticks_);
    const LaneSteps lane_steps{.tick_s = tick_s_, .per_tick = steps};
    if constexpr (std::is_same_v<Space, Plane>) {
      kernel_.drive_classically(model_, robots_, lane_steps, setpoints_, held_, state_,
                                played_.size());
    } else {
      Push(began_s_ + tick * tick_s_);
      kernel_.drive_classically_in_space(model_, robots_, lane_steps, setpoints_, held_, state_,
                                         played_.size());
    }
  }

  [[nodiscard]] bool plausible(std::size_t which) const {
    const auto is = [&](const Packet& number) {
      return std::abs(number.lane(which)) < kImplausibleState;
    };
    const auto end = static_cast<std::ptrdiff_t>(model_.joints + kRoot);
    return std::all_of(state_.q.begin(), state_.q.begin() + end, is) &&
           std::all_of(state_.v.begin(), state_.v.begin() + end, is);
  }
  /// Valid until the next call, as all that are shown of a robot.
  std::span<const double> Positions(std::size_t which) {
    for (std::size_t i = 0; i < model_.joints + kRoot; ++i) q_[i] = state_.q[i].lane(which);
    return {q_.data(), model_.joints + kRoot};
  }
  std::span<const double> Velocities(std::size_t which) {
    for (std::size_t i = 0; i < model_.joints + kRoot; ++i) qd_[i] = state_.v[i].lane(which);
    return {qd_.data(), model_.joints + kRoot};
  }
  const SpaceMatrix& Axes(std::size_t which) {
    axes_ = AxesOf(state_, which);
    return axes_;
  }

 private:
  static std::size_t LaneOf(const ActuatedJoint& joint) { return Index(joint.dof) - kRoot; }

  [[nodiscard]] State<double> StartOf(double lean_rad) const {
    State<double> state{};
    std::copy(problem_->start_q.begin(), problem_->start_q.end(), state.q.begin());
    if constexpr (std::is_same_v<Space, Plane>) {
      std::copy_n(problem_->start_root_rates.begin(), kRoot, state.v.begin());
      state.q[kRootPitch] += lean_rad;
    } else {
      SetAxes(problem_->space->start_orientation, state);
      state.q[RootChart<Spatial>::kFirst] += lean_rad;
    }
    for (const ActuatedJoint& joint : problem_->joints)
      state.v[Index(joint.dof)] = joint.start_rad_s;
    return state;
  }

  void TakePaths(const std::vector<double>& x) {
    paths_.clear();
    for (std::size_t j = 0; j < problem_->joints.size(); ++j)
      paths_.push_back(PositionSpline(*problem_, x, j));
    holds_ = false;
    TakeSetpoints(0);
    std::copy(setpoints_.begin(), setpoints_.end(), held_.begin());
  }

  void TakeSetpoints(int period) {
    if (holds_) return;
    setpoints_.resize(model_.joints);
    const double time_s = period * played_[0].period_s, t = std::min(time_s, problem_->duration_s);
    holds_ = time_s >= problem_->duration_s;
    for (std::size_t j = 0; j < paths_.size(); ++j) {
      const auto path = paths_[j].Evaluate(t);
      setpoints_[LaneOf(problem_->joints[j])] = {
          Packet::Of(path.value), Packet::Of(time_s < problem_->duration_s ? path.first : 0),
          Packet::Of(feed_forward_[j].Evaluate(t).value)};
    }
  }

  void Push(double time_s) {
    for (std::size_t i = 0; i < played_.size(); ++i) {
      const auto& push = played_[i].push;
      const bool acts =
          push && time_s >= push->start_s && time_s < push->start_s + push->duration_s;
      for (std::size_t k = 0; k < robots_.push.size(); ++k)
        robots_.push[k].set_lane(i, acts ? push->force_n[static_cast<int>(k)] : 0);
    }
  }

  const Problem* problem_;
  double began_s_ = 0;
  std::span<const JointMotion<double>::Spline> feed_forward_;
  std::span<const PlayedRobot<Space>> played_;
  int ticks_;  // in a period
  double tick_s_;
  const LaneKernel<Packet>& kernel_ = *PacketKernels().front();
  std::vector<JointMotion<double>::Spline> paths_;
  typename Types::Model model_;
  Robot<Packet> robots_{};
  State<Packet> state_{};
  HeldSetpoints<Packet> held_{};
  std::vector<LaneSetpoint<Packet>> setpoints_;
  bool holds_ = false;  // whether they are those of the end
  std::array<double, Types::Model::kMaxDofs> q_{}, qd_{};
  SpaceMatrix axes_;
};

/// None where lanes do not have the scene.
template <class Space>
std::unique_ptr<DrivenLanes<Space>> TryLanes(
    const Problem& problem, const std::vector<double>& x,
    std::span<const JointMotion<double>::Spline> feed_forward,
    std::span<const PlayedRobot<Space>> played) {
  if (played.empty() || played.size() > Packet::kLanes) return nullptr;
  try {
    return std::make_unique<DrivenLanes<Space>>(problem, x, feed_forward, played);
  } catch (const std::invalid_argument&) {
    return nullptr;
  }
}

/// What became of robots in lanes.
struct LaneFates {
  std::vector<bool> plausible;  ///< Whether a robot's state stayed so while it went on.
  std::vector<bool> goes_on;
  explicit LaneFates(std::size_t robots) : plausible(robots, true), goes_on(robots, true) {}
  [[nodiscard]] bool any() const { return std::ranges::find(goes_on, true) != goes_on.end(); }
};

/// Plays a motion on robots in lanes.
/// @param visit  is called with a robot's number and the time, and returns whether it goes on.
template <class Space, class Visit>
void PlayLanes(const Problem& problem, DrivenLanes<Space>& lanes, double longest_s, double finer,
               double until_s, LaneFates& fates, Visit&& visit) {
  const int fine = StepsIn(lanes.tick_s(), problem, longest_s, finer);
  const int coarse = StepsIn(lanes.tick_s(), problem, longest_s, 1);
  const double calm_s = problem.duration_s + ExitAfter(problem);
  for (int tick = 0; tick * lanes.tick_s() < until_s; ++tick) {
    const double time_s = tick * lanes.tick_s();
    for (std::size_t i = 0; i < fates.goes_on.size(); ++i) {
      if (!fates.goes_on[i]) continue;
      fates.plausible[i] = lanes.plausible(i);
      fates.goes_on[i] = fates.plausible[i] && visit(i, time_s);
    }
    if (!fates.any()) return;
    lanes.Play(tick, time_s < calm_s ? fine : coarse);
  }
}

}  // namespace

std::vector<bool> PlayThroughDrives(
    const Problem& problem, const std::vector<double>& x,
    std::span<const JointMotion<double>::Spline> feed_forward,
    std::span<const Disturbance> disturbances, double until_s,
    const std::function<bool(std::size_t, double, std::span<const double>)>& visitor) {
  std::vector<PlayedRobot<Plane>> played;
  for (const Disturbance& disturbance : disturbances)
    played.push_back(Nominal(problem.scene, problem, disturbance));
  const auto lanes = TryLanes<Plane>(problem, x, feed_forward, played);
  if (lanes == nullptr) {
    std::vector<bool> plausible;
    for (std::size_t i = 0; i < disturbances.size(); ++i) {
      plausible.push_back(PlayThroughDrives(
          problem, x, feed_forward, disturbances[i], until_s,
          [&](double time_s, std::span<const double> q) { return visitor(i, time_s, q); }));
    }
    return plausible;
  }
  const double longest_s =
      DrivenRobot(problem, x, feed_forward, Nominal(problem.scene, problem, {})).LongestStep();
  LaneFates fates(disturbances.size());
  PlayLanes(problem, *lanes, longest_s, kPlayedFiner, until_s, fates,
            [&](std::size_t i, double time_s) { return visitor(i, time_s, lanes->Positions(i)); });
  return fates.plausible;
}

bool PlayThroughDrives(const Problem& problem, const std::vector<double>& x,
                       std::span<const JointMotion<double>::Spline> feed_forward,
                       const Disturbance& disturbance, double until_s,
                       const std::function<bool(double, std::span<const double>)>& visitor) {
  DrivenRobot robot(problem, x, feed_forward, Nominal(problem.scene, problem, disturbance));
  return Play(problem, robot, robot.LongestStep(), kPeriod_s, until_s, kPlayedFiner,
              [&](double time_s) { return visitor(time_s, robot.Positions()); });
}

double LightestContact(const Problem& problem, const std::vector<double>& x) {
  constexpr double kPoses_s = 0.1;
  const SpaceScene& scene = problem.space->scene;
  Tree<Spatial> tree = scene.robot.tree;
  std::vector<JointMotion<double>::Spline> paths;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    tree.dofs[Index(problem.joints[j].dof)].prescribed = false;
    paths.push_back(PositionSpline(problem, x, j));
  }
  std::vector<double> q = problem.start_q;
  const int samples = static_cast<int>(std::ceil(problem.duration_s / kPoses_s));
  double lightest_kg = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= samples; ++i) {
    for (std::size_t j = 0; j < paths.size(); ++j)
      q[Index(problem.joints[j].dof)] = paths[j].Evaluate(problem.duration_s * i / samples).value;
    lightest_kg = std::min(lightest_kg, SmallestEffectiveMass(tree, scene.robot.shapes, q));
  }
  return lightest_kg;
}

namespace {

/// By which part of the model's a robot's masses and inertias are smaller at most: no mass that a
/// force meets is smaller by more.
double LeastShare(const SpaceRobot& robot, const SpaceRobot& model) {
  double least = 1;
  for (std::size_t i = 0; i < model.tree.dofs.size(); ++i) {
    const Dof<Spatial>&of = robot.tree.dofs[i], &like = model.tree.dofs[i];
    if (like.massless || like.mass_kg == 0) continue;
    least = std::min(least, of.mass_kg / like.mass_kg);
    if (like.inertia_kg_m2.trace() > 0)
      least = std::min(least, of.inertia_kg_m2.trace() / like.inertia_kg_m2.trace());
  }
  return least;
}

}  // namespace

double ContactStepInSpace(std::span<const DrivenMotion> motions,
                          std::span<const PlayedRobot<Spatial>> played) {
  constexpr double kOfAdvised = 2, kOfSpring = 0.35;
  double step_s = std::numeric_limits<double>::infinity();
  for (const DrivenMotion& motion : motions) {
    const SpaceRobot& model = motion.problem->space->scene.robot;
    const double lightest_kg =
        motion.lightest_kg > 0 ? motion.lightest_kg : LightestContact(*motion.problem, *motion.x);
    if (!std::isfinite(lightest_kg)) continue;
    for (const PlayedRobot<Spatial>& robot : played) {
      const double weight_n = robot.scene.robot.mass_kg() * model.tree.gravity.norm();
      const double mass_kg = LeastShare(robot.scene.robot, model) * lightest_kg;
      ContactLaw spring = robot.scene.contact;
      spring.damping_n_s_per_m = spring.mu = 0;
      step_s = std::min({step_s, kOfAdvised * AdvisableStep(robot.scene.contact, mass_kg, weight_n),
                         kOfSpring * AdvisableStep(spring, mass_kg, weight_n)});
    }
  }
  return step_s;
}

namespace {

double LongestContactStep(std::span<const DrivenMotion> motions,
                          std::span<const PlayedRobot<Spatial>> played) {
  return std::max(ContactStepInSpace(motions, played), kShortestContactStep_s);
}

}  // namespace

bool PlayThroughDrivesInSpace(
    std::span<const DrivenMotion> motions, const PlayedRobot<Spatial>& played,
    const std::function<bool(std::size_t, const DrivenSample&)>& visitor) {
  const DrivenMotion& first = motions.front();
  DrivenRobotIn<Spatial> robot(*first.problem, *first.x, first.feed_forward, played);
  const double longest_s = std::min(robot.LongestStep(), LongestContactStep(motions, {&played, 1}));
  bool goes_on = true;
  double began_s = 0;
  for (std::size_t i = 0; i < motions.size() && goes_on; ++i) {
    const DrivenMotion& motion = motions[i];
    if (i > 0) robot.Begin(*motion.problem, *motion.x, motion.feed_forward, began_s);
    began_s += motion.until_s;
    const bool plausible =
        Play(*motion.problem, robot, longest_s, played.period_s, motion.until_s, played.finer,
             [&](double time_s) {
               goes_on =
                   visitor(i, {time_s, robot.Positions(), robot.Velocities(), &robot.chart().axes});
               return goes_on;
             });
    if (!plausible) return false;
  }
  return true;
}

bool PlayThroughDrivesInSpace(const Problem& problem, const std::vector<double>& x,
                              std::span<const JointMotion<double>::Spline> feed_forward,
                              const PlayedRobot<Spatial>& played, double until_s,
                              const std::function<bool(const DrivenSample&)>& visitor) {
  const DrivenMotion motion{&problem, &x, feed_forward, until_s};
  return PlayThroughDrivesInSpace(
      {&motion, 1}, played,
      [&visitor](std::size_t, const DrivenSample& sample) { return visitor(sample); });
}

std::vector<bool> PlayThroughDrivesInSpace(
    std::span<const DrivenMotion> motions, std::span<const PlayedRobot<Spatial>> played,
    const std::function<bool(std::size_t, std::size_t, const DrivenSample&)>& visitor) {
  const DrivenMotion& first = motions.front();
  const auto lanes = TryLanes(*first.problem, *first.x, first.feed_forward, played);
  if (lanes == nullptr) {
    std::vector<bool> plausible;
    for (std::size_t i = 0; i < played.size(); ++i) {
      plausible.push_back(PlayThroughDrivesInSpace(
          motions, played[i],
          [&](std::size_t motion, const DrivenSample& at) { return visitor(i, motion, at); }));
    }
    return plausible;
  }
  double longest_s = LongestContactStep(motions, played), finer = 1;
  for (const PlayedRobot<Spatial>& robot : played) {
    DrivenRobotIn<Spatial> alone(*first.problem, *first.x, first.feed_forward, robot);
    longest_s = std::min(longest_s, alone.LongestStep());
    finer = std::max(finer, robot.finer);
  }
  LaneFates fates(played.size());
  double began_s = 0;
  for (std::size_t k = 0; k < motions.size() && fates.any(); ++k) {
    const DrivenMotion& motion = motions[k];
    if (k > 0) lanes->Begin(*motion.problem, *motion.x, motion.feed_forward, began_s);
    PlayLanes(*motion.problem, *lanes, longest_s, finer, motion.until_s, fates,
              [&](std::size_t i, double time_s) {
                return visitor(
                    i, k, {time_s, lanes->Positions(i), lanes->Velocities(i), &lanes->Axes(i)});
              });
    began_s += motion.until_s;
  }
  return fates.plausible;
}

PlayedRobot<Spatial> NominalInSpace(const Problem& problem, const Disturbance& disturbance) {
  return Nominal(problem.space->scene, problem, disturbance);
}

}  // namespace tumbler
