// The setpoints that the executor plans in each of its states.

#include <algorithm>
#include <cmath>

#include "runtime/executor/executor.h"
#include "runtime/executor/numbers.h"

namespace tumbler {
namespace {

/// Before this a float's time is at most 2 us off.
constexpr float kLongTime_s = 32;

}  // namespace

// How long the move to the start takes from here.
std::int64_t Executor::MoveTicks() noexcept {
  // The quintic s(x) = 10 x^3 - 15 x^4 + 6 x^5 has peak s' = 15/8 and peak s'' = 10 / sqrt(3).
  constexpr float kPeakVelocity = 1.875F;
  constexpr float kPeakAcceleration = 5.7735027F;
  float duration_s = 0;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    joint.move_from_rad = joint.commanded.position_rad;
    const float way =
        Magnitude(joints_[index].motion->position.control_points()[0] - joint.move_from_rad);
    const float velocity = config_.move_fraction * joint.limits.velocity_max_rad_s;
    const float acceleration = config_.move_fraction * joint.acceleration_max_rad_s2;
    duration_s = std::max({duration_s, kPeakVelocity * way / velocity,
                           std::sqrt(kPeakAcceleration * way / acceleration)});
  }
  const float ticks = std::min(duration_s / time_per_tick_s_, 1e9F);
  return std::max<std::int64_t>(1, CeilTicks(ticks));
}

void Executor::Plan(int elapsed, TickRecord& record) noexcept {
  switch (phase_) {
    case Phase::kDisarmed:
    case Phase::kArming:
      return PlanArming(record);
    case Phase::kMovingToStart:
    case Phase::kGettingUp:
      return PlanMove(record);
    case Phase::kHolding:
    case Phase::kSettling:
    case Phase::kSettlingHome:
    case Phase::kStopping:
    case Phase::kLowering:
      return PlanBrake(elapsed, record);
    case Phase::kLoweringInFault:
    case Phase::kFault:
      if (answer_.reaction != Reaction::kRollOut) {
        PlanBrake(elapsed, record);
        if (answer_.reaction == Reaction::kCollapse) {
          PlanFold(elapsed, config_.collapse.position_rad, config_.move_fraction, record);
        } else if (answer_.reaction == Reaction::kFold) {
          PlanFold(elapsed, answer_.abort->position_rad, answer_.abort->limits_share, record);
        }
        return;
      }
      [[fallthrough]];
    case Phase::kRunning:
    case Phase::kRunningHome:
      return PlanRun(record);
  }
}

void Executor::PlanArming(TickRecord& record) noexcept {
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    const bool follow = phase_ == Phase::kDisarmed || joint.drive_state != DriveState::kEnabled;
    if (follow && joint.replies.age_ticks() >= 0 && joint.IsMeasuredFinite()) {
      // This is no order yet. The joint may still be moved by hand, and the step of the limits must
      // not hold the setpoint back.
      const float position = std::clamp(joint.measured.position_rad, joint.limits.position_min_rad,
                                        joint.limits.position_max_rad);
      joint.commanded = {position, 0, 0};
    }
    record.joints[index].planned = joint.commanded;
    record.joints[index].planned_acceleration_rad_s2 = 0;
  }
}

void Executor::PlanMove(TickRecord& record) noexcept {
  const bool at_end = ticks_in_phase_ >= move_.ticks;
  const float duration_s = static_cast<float>(move_.ticks) * config_.period_s;
  const float x = static_cast<float>(ticks_in_phase_) / static_cast<float>(move_.ticks);
  const float share = x * x * x * (10.0F + x * (6.0F * x - 15.0F));
  const float rate = 30.0F * x * x * (1.0F + x * (x - 2.0F)) / duration_s;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const float from = joints_[index].move_from_rad;
    const float to = joints_[index].motion->position.control_points()[0];
    JointSetpoint& planned = record.joints[index].planned;
    record.joints[index].planned_acceleration_rad_s2 = 0;
    planned = at_end ? JointSetpoint{to, 0, 0}
                     : JointSetpoint{from + (to - from) * share, (to - from) * rate, 0};
  }
}

void Executor::PlanRun(TickRecord& record) noexcept {
  // Every time is one product with an integer, so that rounding does not add up. The last one is
  // the end itself.
  primitive_time_s_ = ticks_in_phase_ >= run_ticks_
                          ? primitive_->duration_s
                          : static_cast<float>(ticks_in_phase_) * time_per_tick_s_;
  const float time_s = primitive_time_s_;
  const float speed = config_.speed;
  const float speed_2 = speed * speed;
  Joint& first = joints_[0];
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    const JointMotion<float>& motion = *joint.motion;
    Joint::Basis& position_basis =
        joint.shares_position_knots ? first.position_basis : joint.position_basis;
    Joint::Basis& torque_basis =
        joint.shares_torque_knots ? first.torque_basis : joint.torque_basis;
    if (i == 0 || !joint.shares_position_knots)
      motion.position.EvaluateBasis(time_s, position_basis);
    if (i == 0 || !joint.shares_torque_knots) motion.torque.EvaluateBasis(time_s, torque_basis);
    const auto sample = motion.position.Evaluate(position_basis);
    const float torque = motion.torque.Value(torque_basis);
    JointRecord& out = record.joints[index];
    out.planned = {sample.value, speed * sample.first, speed_2 * torque};
    out.planned_acceleration_rad_s2 = speed_2 * sample.second;
  }
  if (time_s >= kLongTime_s && time_s < primitive_->duration_s) PlanBetween(record);
}

// A float has so few digits left for late times that the path would be sampled unevenly: at 8192 s
// a time is up to 0.5 ms off. What is missing is made up for along the path.
void Executor::PlanBetween(TickRecord& record) const noexcept {
  const float missing_s = LostInProduct(ticks_in_phase_, time_per_tick_s_) / config_.speed;
  for (int i = 0; i < joint_count_; ++i) {
    JointRecord& out = record.joints[static_cast<std::size_t>(i)];
    out.planned.position_rad += out.planned.velocity_rad_s * missing_s;
    out.planned.velocity_rad_s += out.planned_acceleration_rad_s2 * missing_s;
  }
}

void Executor::PlanBrake(int elapsed, TickRecord& record) noexcept {
  const float time_s = static_cast<float>(elapsed) * config_.period_s;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Joint& joint = joints_[index];
    const JointSetpoint& last = joint.commanded;
    const float most = joint.acceleration_max_rad_s2 * time_s;
    float velocity = 0;
    if (last.velocity_rad_s > most) velocity = last.velocity_rad_s - most;
    if (last.velocity_rad_s < -most) velocity = last.velocity_rad_s + most;
    record.joints[index].planned = {
        last.position_rad + 0.5F * (last.velocity_rad_s + velocity) * time_s, velocity,
        hold_.keeps_torque ? last.torque_nm : 0.0F};
    record.joints[index].planned_acceleration_rad_s2 = 0;
  }
}

// Plans the way to a pose of roles from any position and velocity, with a share of the limits. The
// joint goes no faster than the velocity from which gentle braking still ends at the pose. Where it
// is faster, it brakes as hard as it has to.
void Executor::PlanFold(int elapsed, std::span<const float> pose, float share,
                        TickRecord& record) noexcept {
  constexpr float kArrived_rad = 1e-5F;
  const float time_s = static_cast<float>(elapsed) * config_.period_s;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const Joint& joint = joints_[index];
    JointSetpoint& planned = record.joints[index].planned;
    planned.torque_nm = 0;
    // For a drive without torque nothing is planned: once enabled, it would jump to where the plan
    // has got to. A drive whose heartbeat is missing may well have torque.
    if (joint.drive_state != DriveState::kEnabled && joint.drive_state != DriveState::kLost)
      continue;
    const auto role = static_cast<std::size_t>(graph().RoleOf(sequencer_.node(), i));
    const float target = pose[role];
    const JointSetpoint& last = joint.commanded;
    const float way = target - last.position_rad;
    const float gentle = share * joint.acceleration_max_rad_s2;
    const float fastest =
        std::min({share * joint.limits.velocity_max_rad_s, std::sqrt(2 * gentle * Magnitude(way)),
                  Magnitude(way) / time_s});
    const float wanted = way < 0 ? -fastest : fastest;
    const float change = wanted - last.velocity_rad_s;
    const bool brakes = change * last.velocity_rad_s < 0;
    const float most = (brakes ? joint.acceleration_max_rad_s2 : gentle) * time_s;
    const float velocity = last.velocity_rad_s + std::clamp(change, -most, most);
    planned.position_rad = last.position_rad + 0.5F * (last.velocity_rad_s + velocity) * time_s;
    planned.velocity_rad_s = velocity;
    if (Magnitude(way) <= kArrived_rad && Magnitude(last.velocity_rad_s) * time_s <= kArrived_rad) {
      planned.position_rad = target;
      planned.velocity_rad_s = 0;
    }
  }
}

}  // namespace tumbler
