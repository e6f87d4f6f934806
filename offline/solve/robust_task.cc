#include "offline/solve/robust_task.h"

#include <algorithm>

namespace tumbler {

LaneScene LanesOf(const Problem& problem, const RobotVariation& variation) {
  const bool model = variation.links.empty();
  LaneScene lanes = MakeLaneScene(model ? problem.scene : Varied(problem.scene, variation),
                                  problem.robust->drive);
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    auto& joint = lanes.robot.joints[j];
    joint.torque_max = problem.joints[j].limits.torque_max_nm;
    if (model) continue;
    const double torque = variation.joints[j].torque;
    joint.torque_max *= variation.joints[j].torque_limit * torque;
    joint.kp *= variation.joints[j].gain * torque;
    joint.kd *= variation.joints[j].gain * torque;
    joint.feed_forward = torque;
    joint.velocity_filter = variation.joints[j].velocity_filter_s;
    joint.torque_lag = variation.joints[j].torque_lag_s;
    joint.delay = std::min(joint.delay + variation.delay_s, RobustTask::kTick_s);
    joint.zero_error = variation.joints[j].zero_rad;
  }
  return lanes;
}

LaneState<double> StartState(const Problem& problem) {
  LaneState<double> state{};
  std::copy(problem.start_q.begin(), problem.start_q.end(), state.q.begin());
  return state;
}

RobustTask::RobustTask(const Problem& of, const SolveOptions& with,
                       std::span<const Primitive<double>> tried_before)
    : problem(of),
      settings(*of.robust),
      options(with),
      complement(tried_before),
      kernel(*PacketKernels().front()),
      ranking_kernel(*RankingKernels().front()),
      lanes(LanesOf(of)),
      joints(of.joints.size()),
      loss(of) {}

}  // namespace tumbler
