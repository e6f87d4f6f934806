#include "offline/studies/excitation_player.h"

#include <algorithm>
#include <cmath>

#include "offline/scene/lane_kernel.h"
#include "offline/studies/excitation_shape.h"

namespace tumbler {

ExcitationSetpoints ExcitationSetpointsOf(double duration_s,
                                          std::span<const JointMotion<double>::Spline> positions,
                                          std::span<const JointMotion<double>::Spline> torques) {
  ExcitationSetpoints setpoints;
  const auto ticks =
      static_cast<int>(std::ceil((duration_s + kExcitationAfter_s) / kExcitationTick_s - 1e-9));
  for (int k = 0; k < ticks; ++k) {
    const double t = k * kExcitationTick_s;
    auto& tick = setpoints.emplace_back();
    const double at_s = std::min(t, duration_s);
    for (std::size_t j = 0; j < positions.size(); ++j) {
      const auto at = positions[j].Evaluate(at_s);
      const bool moves = t < duration_s;
      const double torque = torques.empty() ? 0 : torques[j].Evaluate(at_s).value;
      tick.push_back({at.value, moves ? at.first : 0, torque});
    }
  }
  return setpoints;
}

LaneState<Packet> ExcitationPlayer::Start() const {
  LaneState<double> start{};
  std::copy(problem_.start_q.begin(), problem_.start_q.end(), start.q.begin());
  std::array<LaneState<double>, kLanes> states;
  states.fill(start);
  return PackLanes<LaneState>(states);
}

std::array<PlayedExcitation, Packet::kLanes> ExcitationPlayer::Play(
    const std::array<LaneRobot<double>, kLanes>& robots,
    const std::array<const ExcitationSetpoints*, kLanes>& setpoints, int finer) const {
  const std::size_t joints = problem_.joints.size();
  LaneState<Packet> state = Start();
  const LaneRobot<Packet> packed = PackLanes<LaneRobot>(robots);
  HeldSetpoints<Packet> held{};
  LaneWatch<Packet> watch;
  std::vector<LaneSetpoint<Packet>> told(joints);
  const LaneSteps steps{kExcitationTick_s, 4 * finer};
  std::array<PlayedExcitation, kLanes> played{};
  for (std::size_t k = 0; k < setpoints[0]->size(); ++k) {
    for (std::size_t j = 0; j < joints; ++j) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const LaneSetpoint<double>& s = (*setpoints[lane])[k][j];
        told[j].position.set_lane(lane, s.position);
        told[j].velocity.set_lane(lane, s.velocity);
        told[j].third.set_lane(lane, s.third);
      }
      if (k == 0) held[j] = told[j];
    }
    // Until then a robot drops onto its own ground.
    if (k == static_cast<std::size_t>(std::lround(kExcitationStands_s / kExcitationTick_s)))
      watch = {};
    (*PacketKernels().front()).drive(lanes_.model, packed, steps, told, held, state, watch);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const double turn = std::abs(state.q[2].lane(lane) - problem_.start_q[2]);
      PlayedExcitation& of = played[lane];
      of.pitch_rad = turn < of.pitch_rad ? of.pitch_rad : turn;  // keeps what is not a number
      of.end_rad = turn;
      of.speed = 0;
      for (std::size_t d = 0; d < joints + 3; ++d)
        of.speed = std::max(of.speed, std::abs(state.v[d].lane(lane)));
    }
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    PlayedExcitation& of = played[lane];
    of.depth = watch.depth.lane(lane);
    for (std::size_t j = 0; j < joints; ++j) {
      const double torque = watch.torque[j].lane(lane);
      of.torque_nm = std::max(of.torque_nm, torque);
      of.torque_share = std::max(of.torque_share, torque / problem_.joints[j].limits.torque_max_nm);
    }
  }
  return played;
}

void ExcitationPlayer::AddFeedForward(std::array<ExcitationSetpoints, kLanes>& setpoints) const {
  constexpr int kSteps = 4;
  const std::size_t joints = problem_.joints.size(), ticks = setpoints[0].size();
  std::vector<LaneSetpoint<Packet>> plan(ticks * kSteps * joints);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    for (std::size_t k = 0; k < ticks; ++k) {
      for (std::size_t j = 0; j < joints; ++j) {
        const LaneSetpoint<double>& now = setpoints[lane][k][j];
        const LaneSetpoint<double>& next = setpoints[lane][std::min(k + 1, ticks - 1)][j];
        for (int i = 0; i < kSteps; ++i) {
          const double part = (i + 0.5) / kSteps;
          LaneSetpoint<Packet>& of = plan[(k * kSteps + static_cast<std::size_t>(i)) * joints + j];
          const double a = (next.velocity - now.velocity) / kExcitationTick_s;
          const double v = now.velocity + a * part * kExcitationTick_s;
          of.position.set_lane(lane,
                               now.position + part * kExcitationTick_s * 0.5 * (now.velocity + v));
          of.velocity.set_lane(lane, v);
          of.third.set_lane(lane, a);
        }
      }
    }
  }
  std::array<LaneRobot<double>, kLanes> robots;
  robots.fill(lanes_.robot);
  LaneState<Packet> state = Start();
  LaneWatch<Packet> watch;
  std::vector<Packet> torques(plan.size());
  (*PacketKernels().front())
      .prescribe(lanes_.model, PackLanes<LaneRobot>(robots), kExcitationTick_s / kSteps, plan,
                 state, watch, torques);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    for (std::size_t k = 0; k < ticks; ++k) {
      for (std::size_t j = 0; j < joints; ++j) {
        double sum = 0;
        for (std::size_t i = 0; i < kSteps; ++i)
          sum += torques[(k * kSteps + i) * joints + j].lane(lane);
        setpoints[lane][k][j].third = std::isfinite(sum) ? sum / kSteps : 0;
      }
    }
  }
}

}  // namespace tumbler
