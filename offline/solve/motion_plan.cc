#include "offline/solve/motion_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <type_traits>

#include "common/core/index.h"
#include "offline/solve/tick_spline.h"

namespace tumbler {
namespace {

constexpr int kPlanSteps = 4;  // in a tick
constexpr double kPlanStep_s = RobustTask::kTick_s / kPlanSteps;
/// Parts of the contact's layer and of the torque limit that a plan may use. The certificate and
/// the second look take finer steps than lanes do, and refuse a motion above the whole.
constexpr double kLargestDepth = 0.85, kLargestTorque = 0.95;
/// Parts of the tolerances within which the model rests: where other motions are complemented, and
/// on the ground of a posterior, which may damp little. There a robot rocks less in the steps of
/// lanes than in those of the second look.
constexpr double kRestsOtherwise = 0.7, kRestsOnKnownGround = 0.4;

}  // namespace

MotionPlanner::MotionPlanner(const RobustTask& task, const RobustMotion& motion)
    : task_(task), motion_(motion) {
  LaneRobot<double> model = task.lanes.robot;
  // The plan knows the URDF's damping alone.
  for (std::size_t j = 0; j < task.joints; ++j) {
    model.joints[j].viscous_friction -= task.settings.drive.viscous_friction_nm_s_per_rad;
    model.joints[j].dry_friction = 0;
  }
  std::array<LaneRobot<double>, Packet::kLanes> robots;
  robots.fill(model);
  model_ = PackLanes<LaneRobot>(robots);
}

std::vector<MotionPlan> MotionPlanner::Plans(
    const std::vector<std::vector<double>>& motions) const {
  const Problem& problem = task_.problem;
  const std::size_t joints = task_.joints;
  int ticks = 0;
  for (const std::vector<double>& x : motions) ticks = std::max(ticks, motion_.Ticks(x));
  const auto count = Index((ticks + RobustTask::Ticks(problem.settle_s)) * kPlanSteps);
  PacketSetpoints setpoints(count * joints);
  for (std::size_t lane = 0; lane < Packet::kLanes; ++lane) {
    motion_.Sample(motions[std::min(lane, motions.size() - 1)], count, kPlanStep_s,
                   [&](std::size_t i, const auto& at) {
                     setpoints[i].position.set_lane(lane, at.value);
                     setpoints[i].velocity.set_lane(lane, at.first);
                     setpoints[i].third.set_lane(lane, at.second);
                   });
  }
  std::array<LaneState<double>, Packet::kLanes> states;
  states.fill(StartState(problem));
  LaneState<Packet> state = PackLanes<LaneState>(states);
  LaneWatch<Packet> watch;
  std::vector<Packet> torques(setpoints.size());
  task_.kernel.prescribe(task_.lanes.model, model_, kPlanStep_s, setpoints, state, watch, torques);
  std::vector<MotionPlan> plans(motions.size());
  if (task_.beside_model()) NoteUnrest(setpoints, state, plans);
  for (std::size_t m = 0; m < motions.size(); ++m) {
    plans[m].excess += std::max(0.0, watch.depth.lane(m) - kLargestDepth);
    for (std::size_t j = 0; j < joints; ++j) {
      const double limit = kLargestTorque * problem.joints[j].limits.torque_max_nm;
      plans[m].excess += std::max(0.0, watch.torque[j].lane(m) / limit - 1);
    }
    plans[m].feed_forward = FeedForwardOf(torques, m, motion_.Duration_s(motions[m]));
  }
  return plans;
}

void MotionPlanner::NoteUnrest(const PacketSetpoints& setpoints, LaneState<Packet>& state,
                               std::vector<MotionPlan>& plans) const {
  const double part = task_.complement.empty() ? kRestsOnKnownGround : kRestsOtherwise;
  const std::array<double, Packet::kLanes> off = task_.loss.Off(state);
  PacketSetpoints last;
  const auto steps = static_cast<int>(std::lround(RobustTask::kWatched_s / kPlanStep_s));
  for (int k = 0; k < steps; ++k) {
    last.insert(last.end(), setpoints.end() - static_cast<std::ptrdiff_t>(task_.joints),
                setpoints.end());
  }
  LaneWatch<Packet> watch;
  std::vector<Packet> torques(last.size());
  task_.kernel.prescribe(task_.lanes.model, model_, kPlanStep_s, last, state, watch, torques);
  for (std::size_t m = 0; m < plans.size(); ++m) {
    const double speed = watch.root_speed.lane(m);
    plans[m].excess += std::max(0.0, off[m] / (part * task_.loss.tolerance_rad()) - 1);
    plans[m].excess += std::max(0.0, speed / (part * CostTerm::kRateTolerance) - 1);
    if (!std::isfinite(plans[m].excess)) plans[m].excess = RobustMotion::kUnplayable;
  }
}

std::vector<double> MotionPlanner::FeedForwardOf(const std::vector<Packet>& torques,
                                                 std::size_t lane, double duration_s) const {
  const int ticks = RobustTask::Ticks(duration_s);
  const TickSpline spline(duration_s, ticks);
  const std::size_t joints = task_.joints;
  // Motions of a packet end one after the other, and so do their settle phases.
  const std::size_t rests =
      Index(ticks + RobustTask::Ticks(task_.problem.settle_s)) * kPlanSteps - 1;
  std::vector<double> feed_forward((Index(ticks) + 1) * joints);
  std::vector<double> samples(Index(ticks) + 1);
  for (std::size_t j = 0; j < joints; ++j) {
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const std::size_t step = std::min(k * kPlanSteps, torques.size() / joints - 1);
      samples[k] = torques[step * joints + j].lane(lane);
    }
    std::vector<double> points = spline.Fit(samples);
    const double limit = task_.problem.joints[j].limits.torque_max_nm;
    if (task_.problem.held_torque == HeldTorque::kRest)
      points.back() = torques[rests * joints + j].lane(lane);
    for (double& point : points) point = std::clamp(point, -limit, limit);
    for (std::size_t k = 0; k < samples.size(); ++k)
      feed_forward[k * joints + j] = spline.At(k, points);
  }
  return feed_forward;
}

template <class N>
std::vector<LaneSetpoint<N>> MotionPlanner::SetpointsOf(const std::vector<double>& x,
                                                        const MotionPlan& plan) const {
  const auto in_all = [](double number) {
    if constexpr (std::is_same_v<N, Packet>) {
      return Packet::Of(number);
    } else {
      return static_cast<N>(number);
    }
  };
  const auto ticks = Index(task_.LastTick(motion_.Ticks(x)));
  std::vector<LaneSetpoint<N>> setpoints(ticks * task_.joints);
  motion_.Sample(x, ticks, RobustTask::kTick_s, [&](std::size_t i, const auto& at) {
    setpoints[i] = {in_all(at.value), in_all(at.first), in_all(plan.FeedForward(i, task_.joints))};
  });
  return setpoints;
}
template PacketSetpoints MotionPlanner::SetpointsOf<Packet>(const std::vector<double>&,
                                                            const MotionPlan&) const;
template RankingSetpoints MotionPlanner::SetpointsOf<float>(const std::vector<double>&,
                                                            const MotionPlan&) const;

}  // namespace tumbler
