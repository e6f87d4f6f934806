#include "offline/certify/driven_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "common/core/index.h"
#include "offline/certify/driven_robot.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/stepper.h"
#include "offline/solve/rollout.h"
#include "offline/solve/start_state.h"

namespace tumbler {
namespace {

constexpr int kRootPitch = 2;  // of the degrees of freedom, where the root has any
/// The executor's usual period [s].
constexpr double kPeriod_s = kUsualPeriod_s;

using DrivenRobot = DrivenRobotIn<Plane>;

/// How many steps the period is divided into, so that setpoints change between them.
/// @param parts  of the solver's step.
int StepsInPeriod(const Problem& problem, double longest_s, double parts) {
  const double step_s = std::min(longest_s, problem.solver.step_s / parts);
  return static_cast<int>(std::ceil(kPeriod_s / step_s - 1e-6));
}

/// Steps a robot until a time, visiting every step. @returns false when its state left every
/// plausible range.
template <class Robot, class Visit>
bool Play(const Problem& problem, Robot& robot, double until_s, double finer, Visit&& visit) {
  const double longest_s = robot.LongestStep();
  const double calm_s = problem.duration_s + ExitAfter(problem);
  const double fine_s = kPeriod_s / StepsInPeriod(problem, longest_s, finer);
  const double coarse_s = kPeriod_s / StepsInPeriod(problem, longest_s, 1);
  double time_s = 0;
  while (time_s < until_s) {
    const double step_s = time_s < calm_s ? fine_s : coarse_s;
    if (!visit(time_s)) return true;
    if (!robot.Step(time_s, step_s)) return false;
    time_s += step_s;
  }
  return true;
}

/// Robots in the lanes of one packet, each with its disturbance.
class DrivenLanes {
 public:
  /// @throws std::invalid_argument  where lanes do not have the scene.
  DrivenLanes(const Problem& problem, const std::vector<double>& x,
              std::span<const JointMotion<double>::Spline> feed_forward,
              std::span<const Disturbance> disturbances)
      : problem_(problem), feed_forward_(feed_forward), count_(disturbances.size()) {
    const DriveGains gains = problem.drive_gains();
    const LaneDrive drive{.kp = gains.kp_nm_per_rad, .kd = gains.kd_nm_s_per_rad};
    for (std::size_t j = 0; j < problem.joints.size(); ++j)
      paths_.push_back(PositionSpline(problem, x, j));
    std::array<LaneRobot<double>, Packet::kLanes> robots{};
    std::array<LaneState<double>, Packet::kLanes> states{};
    for (std::size_t i = 0; i < Packet::kLanes; ++i) {
      const Disturbance& disturbance = disturbances[std::min(i, count_ - 1)];
      Scene scene = problem.scene;
      Tilt(scene.robot, disturbance.slope_rad);
      const LaneScene lanes = MakeLaneScene(scene, drive);
      model_ = lanes.model;
      robots[i] = lanes.robot;
      robots[i].stop_stiffness = robots[i].stop_damping = 0;  // A path keeps its limits.
      states[i] = StartOf(disturbance);
      for (const ActuatedJoint& joint : problem.joints)
        robots[i].joints[LaneOf(joint)].torque_max = joint.limits.torque_max_nm;
    }
    if (model_.joints != problem.joints.size())
      throw std::invalid_argument("a joint of the robot has no path");
    robots_ = PackLanes<LaneRobot>(robots);
    state_ = PackLanes<LaneState>(states);
    TakeSetpoints(0);
    std::copy(setpoints_.begin(), setpoints_.end(), held_.begin());
  }

  /// One period.
  void Play(int tick, int steps) {
    TakeSetpoints(tick);
    kernel_.drive_classically(model_, robots_, {.tick_s = kPeriod_s, .per_tick = steps}, setpoints_,
                              held_, state_, count_);
  }

  [[nodiscard]] bool plausible(std::size_t which) const {
    const auto is = [&](const Packet& number) {
      return std::abs(number.lane(which)) < kImplausibleState;
    };
    const auto end = static_cast<std::ptrdiff_t>(model_.joints + 3);
    return std::all_of(state_.q.begin(), state_.q.begin() + end, is) &&
           std::all_of(state_.v.begin(), state_.v.begin() + end, is);
  }
  /// Valid until the next call.
  std::span<const double> Positions(std::size_t which) {
    for (std::size_t i = 0; i < model_.joints + 3; ++i) q_[i] = state_.q[i].lane(which);
    return {q_.data(), model_.joints + 3};
  }

 private:
  static std::size_t LaneOf(const ActuatedJoint& joint) { return Index(joint.dof) - 3; }

  [[nodiscard]] LaneState<double> StartOf(const Disturbance& disturbance) const {
    LaneState<double> state{};
    std::copy(problem_.start_q.begin(), problem_.start_q.end(), state.q.begin());
    std::copy_n(problem_.start_root_rates.begin(), 3, state.v.begin());
    state.q[kRootPitch] += disturbance.lean_rad;
    for (const ActuatedJoint& joint : problem_.joints)
      state.v[Index(joint.dof)] = joint.start_rad_s;
    return state;
  }

  void TakeSetpoints(int tick) {
    setpoints_.resize(model_.joints);
    const double time_s = tick * kPeriod_s, t = std::min(time_s, problem_.duration_s);
    for (std::size_t j = 0; j < paths_.size(); ++j) {
      const auto path = paths_[j].Evaluate(t);
      setpoints_[LaneOf(problem_.joints[j])] = {
          Packet::Of(path.value), Packet::Of(time_s < problem_.duration_s ? path.first : 0),
          Packet::Of(feed_forward_[j].Evaluate(t).value)};
    }
  }

  const Problem& problem_;
  std::span<const JointMotion<double>::Spline> feed_forward_;
  std::size_t count_;
  const LaneKernel<Packet>& kernel_ = *PacketKernels().front();
  std::vector<JointMotion<double>::Spline> paths_;
  LaneModel model_;
  LaneRobot<Packet> robots_{};
  LaneState<Packet> state_{};
  HeldSetpoints<Packet> held_{};
  std::vector<LaneSetpoint<Packet>> setpoints_;
  std::array<double, LaneModel::kMaxDofs> q_{};
};

/// None where lanes do not have the scene.
std::unique_ptr<DrivenLanes> TryLanes(const Problem& problem, const std::vector<double>& x,
                                      std::span<const JointMotion<double>::Spline> feed_forward,
                                      std::span<const Disturbance> disturbances) {
  if (disturbances.empty() || disturbances.size() > Packet::kLanes) return nullptr;
  try {
    return std::make_unique<DrivenLanes>(problem, x, feed_forward, disturbances);
  } catch (const std::invalid_argument&) {
    return nullptr;
  }
}

}  // namespace

std::vector<bool> PlayThroughDrives(
    const Problem& problem, const std::vector<double>& x,
    std::span<const JointMotion<double>::Spline> feed_forward,
    std::span<const Disturbance> disturbances, double until_s,
    const std::function<bool(std::size_t, double, std::span<const double>)>& visitor) {
  std::vector<bool> plausible(disturbances.size(), true);
  const auto lanes = TryLanes(problem, x, feed_forward, disturbances);
  if (lanes == nullptr) {
    for (std::size_t i = 0; i < disturbances.size(); ++i) {
      plausible[i] = PlayThroughDrives(
          problem, x, feed_forward, disturbances[i], until_s,
          [&](double time_s, std::span<const double> q) { return visitor(i, time_s, q); });
    }
    return plausible;
  }
  const double longest_s =
      DrivenRobot(problem, x, feed_forward, Nominal(problem.scene, problem, {})).LongestStep();
  const int fine = StepsInPeriod(problem, longest_s, kPlayedFiner);
  const int coarse = StepsInPeriod(problem, longest_s, 1);
  const double calm_s = problem.duration_s + ExitAfter(problem);
  std::vector<bool> goes_on(disturbances.size(), true);
  for (int tick = 0; tick * kPeriod_s < until_s; ++tick) {
    const double time_s = tick * kPeriod_s;
    for (std::size_t i = 0; i < disturbances.size(); ++i) {
      if (!goes_on[i]) continue;
      plausible[i] = lanes->plausible(i);
      goes_on[i] = plausible[i] && visitor(i, time_s, lanes->Positions(i));
    }
    if (std::ranges::find(goes_on, true) == goes_on.end()) break;
    lanes->Play(tick, time_s < calm_s ? fine : coarse);
  }
  return plausible;
}

bool PlayThroughDrives(const Problem& problem, const std::vector<double>& x,
                       std::span<const JointMotion<double>::Spline> feed_forward,
                       const Disturbance& disturbance, double until_s,
                       const std::function<bool(double, std::span<const double>)>& visitor) {
  DrivenRobot robot(problem, x, feed_forward, Nominal(problem.scene, problem, disturbance));
  return Play(problem, robot, until_s, kPlayedFiner,
              [&](double time_s) { return visitor(time_s, robot.Positions()); });
}

bool PlayThroughDrivesInSpace(
    std::span<const DrivenMotion> motions, const PlayedRobot<Spatial>& played,
    const std::function<bool(std::size_t, const DrivenSample&)>& visitor) {
  const DrivenMotion& first = motions.front();
  DrivenRobotIn<Spatial> robot(*first.problem, *first.x, first.feed_forward, played);
  bool goes_on = true;
  double began_s = 0;
  for (std::size_t i = 0; i < motions.size() && goes_on; ++i) {
    const DrivenMotion& motion = motions[i];
    if (i > 0) robot.Begin(*motion.problem, *motion.x, motion.feed_forward, began_s);
    began_s += motion.until_s;
    const bool plausible =
        Play(*motion.problem, robot, motion.until_s, played.finer, [&](double time_s) {
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

PlayedRobot<Spatial> NominalInSpace(const Problem& problem, const Disturbance& disturbance) {
  return Nominal(problem.space->scene, problem, disturbance);
}

}  // namespace tumbler
