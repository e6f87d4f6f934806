#pragma once

#include <bit>
#include <cstddef>
#include <span>

#include "common/core/drive_law.h"
#include "offline/scene/joint_stop.h"
#include "offline/scene/lane_dynamics.h"
#include "offline/scene/lane_kernel.h"
#include "offline/scene/motor.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// Adapts LaneKernel::drive, whose numbers are P, to vectors S of the same size.
template <class P, class S>
void DriveLanes(const LaneModel& model, const LaneRobot<P>& given, const LaneSteps& steps,
                std::span<const LaneSetpoint<P>> setpoints, HeldSetpoints<P>& held_before,
                LaneState<P>& state_before, LaneWatch<P>& watched) {
  const auto robot = std::bit_cast<LaneRobot<S>>(given);
  auto held = std::bit_cast<HeldSetpoints<S>>(held_before);
  auto state = std::bit_cast<LaneState<S>>(state_before);
  auto watch = std::bit_cast<LaneWatch<S>>(watched);
  LaneDynamics<S> dynamics(model, robot);
  typename LaneDynamics<S>::Numbers tau{}, qdd{};
  const std::size_t joints = model.joints;
  const double h_s = steps.tick_s / steps.per_tick;
  const S h(h_s);
  // Of the backward Euler method between two evaluations of the law: the filter lags by its
  // constant.
  std::array<S, LaneModel::kMaxJoints> share, exerted{};
  for (std::size_t j = 0; j < joints; ++j) {
    const S between(h_s * steps.law_every);
    share[j] = between / (robot.joints[j].velocity_filter + between);
  }
  for (std::size_t k = 0; k + joints <= setpoints.size(); k += joints) {
    HeldSetpoints<S> tick;
    for (std::size_t j = 0; j < joints; ++j)
      tick[j] = std::bit_cast<LaneSetpoint<S>>(setpoints[k + j]);
    for (int i = 0; i < steps.per_tick; ++i) {
      const S since(h_s * (i + 0.5));
      for (std::size_t j = 0; j < joints; ++j) {
        const auto& drive = robot.joints[j];
        const auto& before = held[j];
        const auto& now = tick[j];
        const auto late = since < drive.delay;
        const S q = state.q[j + 3], v = state.v[j + 3];
        if (i % steps.law_every == 0) {
          S& seen = state.seen[j];
          seen = Select(S(0) < drive.velocity_filter, seen + share[j] * (v - seen), v);
          const S wanted = ImpedanceTorque<S>(
              drive.kp, Select(late, before.position, now.position) - (q + drive.zero_error),
              drive.kd, Select(late, before.velocity, now.velocity) - seen,
              drive.feed_forward * Select(late, before.third, now.third));
          exerted[j] = Clamp(wanted, -drive.torque_max, drive.torque_max);
        }
        const S torque = exerted[j];
        watch.torque[j] = Max(watch.torque[j], Max(torque, -torque));
        const JointStop<S> stop{robot.stop_stiffness, robot.stop_damping, drive.lower, drive.upper};
        tau[j + 3] = torque - drive.dry_friction * DryFrictionShare(v) + stop.Torque(q, v);
      }
      dynamics.Accelerate(state, tau, qdd);
      watch.depth = Max(watch.depth, dynamics.depth());
      for (std::size_t d = 0; d < joints + 3; ++d) {
        state.v[d] += h * qdd[d];
        state.q[d] += h * state.v[d];
      }
      for (std::size_t d = 0; d < 3; ++d)
        watch.root_speed = Max(watch.root_speed, Max(state.v[d], -state.v[d]));
    }
    held = tick;
  }
  held_before = std::bit_cast<HeldSetpoints<P>>(held);
  state_before = std::bit_cast<LaneState<P>>(state);
  watched = std::bit_cast<LaneWatch<P>>(watch);
}

/// Adapts LaneKernel::prescribe likewise.
template <class P, class S>
void PrescribeLanes(const LaneModel& model, const LaneRobot<P>& given, double step_s,
                    std::span<const LaneSetpoint<P>> setpoints, LaneState<P>& state_before,
                    LaneWatch<P>& watched, std::span<P> torques) {
  const auto robot = std::bit_cast<LaneRobot<S>>(given);
  auto state = std::bit_cast<LaneState<S>>(state_before);
  auto watch = std::bit_cast<LaneWatch<S>>(watched);
  LaneDynamics<S> dynamics(model, robot);
  typename LaneDynamics<S>::Numbers tau{}, qdd{};
  const std::size_t joints = model.joints;
  const S h(step_s);
  for (std::size_t k = 0; k + joints <= setpoints.size(); k += joints) {
    for (std::size_t j = 0; j < joints; ++j) {
      const auto now = std::bit_cast<LaneSetpoint<S>>(setpoints[k + j]);
      state.q[j + 3] = now.position;
      state.v[j + 3] = now.velocity;
      qdd[j + 3] = now.third;
    }
    dynamics.AcceleratePrescribed(state, tau, qdd);
    watch.depth = Max(watch.depth, dynamics.depth());
    for (std::size_t j = 0; j < joints; ++j) {
      watch.torque[j] = Max(watch.torque[j], Max(tau[j + 3], -tau[j + 3]));
      torques[k + j] = std::bit_cast<P>(tau[j + 3]);
    }
    for (std::size_t d = 0; d < 3; ++d) {
      state.v[d] += h * qdd[d];
      state.q[d] += h * state.v[d];
    }
  }
  state_before = std::bit_cast<LaneState<P>>(state);
  watched = std::bit_cast<LaneWatch<P>>(watch);
}

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
