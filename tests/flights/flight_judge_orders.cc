// The part of FlightJudge that looks at setpoints and at what each drive is sent.

#include <algorithm>
#include <cmath>

#include "tests/flights/flight_judge.h"

namespace tumbler::testing {

void FlightJudge::JudgeJoint(std::size_t joint) {
  const auto frames = tick_.output->frames[joint].frames();
  counts_.frames += static_cast<std::int64_t>(frames.size());
  const WireOrder order = wires_[joint].Read(frames);
  if (order.kind == WireOrder::Kind::kNothing)
    Fail(Invariant::kWritten, "joint {} is not written", joint);
  if (order.kind == WireOrder::Kind::kForbidden)
    Fail(Invariant::kForbidden, "joint {} is sent {:x}", joint, frames.back().id);
  if (!std::isfinite(order.position_rad + order.velocity_rad_s + order.torque_nm))
    Fail(Invariant::kFinite, "joint {} is sent what is no number", joint);
  JudgeLimits(joint);
  if (setting_.has_sensor) JudgeCorrection(joint);
  JudgeOrder(joint, order);
  if (unattended_) JudgePausedOrder(joint, order);
}

namespace {

/// Whether what was outside limits, which the node before did not have, goes back inside as fast as
/// a step allows.
bool Returns(float from, float to, float min, float max, float step) {
  constexpr float kRounding = 0.9998F;
  const float least = step * kRounding - 2e-6F;
  return (from < min && to < min && to - from >= least) ||
         (from > max && to > max && from - to >= least);
}

}  // namespace

void FlightJudge::JudgeLimits(std::size_t joint) {
  const JointRecord& record = now_->joints[joint];
  const JointRecord& before = last_.joints[joint];
  const JointSetpoint& to = record.limited;
  const JointSetpoint& from = before.limited;
  if (!std::isfinite(to.position_rad + to.velocity_rad_s + to.torque_nm))
    Fail(Invariant::kFinite, "joint {} has a setpoint that is no number", joint);
  const Bounds& bounds = BoundsOf(now_->node, joint);
  const JointLimits<float>& limits = bounds.limits;
  const std::uint32_t news = now_->faults & ~last_.faults;
  const bool not_finite = (news & BitOf(Fault::kNonFinite)) != 0;
  const auto ticks = static_cast<float>(advance_);
  const bool within =
      ((to.position_rad >= limits.position_min_rad && to.position_rad <= limits.position_max_rad) ||
       Returns(from.position_rad, to.position_rad, limits.position_min_rad, limits.position_max_rad,
               bounds.position_step_rad * ticks)) &&
      std::abs(to.velocity_rad_s) <= limits.velocity_max_rad_s &&
      (std::abs(to.torque_nm) <= limits.torque_max_nm ||
       Returns(from.torque_nm, to.torque_nm, -limits.torque_max_nm, limits.torque_max_nm,
               bounds.torque_step_nm * ticks));
  const bool kept = has_last_ && to.position_rad == from.position_rad && to.velocity_rad_s == 0;
  if (!within && !((not_finite || (now_->faults & BitOf(Fault::kNonFinite)) != 0) && kept)) {
    // Until the drive was heard, its setpoint is zero wherever the limits are.
    if (!(IsLoose(now_->state) && record.reply_age_ticks < 0)) {
      Fail(Invariant::kLimits, "joint {}: {} rad, {} rad/s, {} N m", joint, to.position_rad,
           to.velocity_rad_s, to.torque_nm);
    }
  }
  if (IsLoose(now_->state) || IsLoose(last_.state) || !has_last_) return;
  constexpr float kRounding = 1.0002F;
  const float step = bounds.position_step_rad * ticks * kRounding + 2e-6F;
  const bool was_outside =
      from.position_rad < limits.position_min_rad || from.position_rad > limits.position_max_rad;
  if (std::abs(to.position_rad - from.position_rad) > step) {
    Fail(Invariant::kSteps, "joint {} goes from {} to {} rad", joint, from.position_rad,
         to.position_rad);
  }
  const float push = bounds.torque_step_nm * ticks * kRounding + 2e-6F;
  if (std::abs(to.torque_nm - from.torque_nm) > push)
    Fail(Invariant::kSteps, "joint {} goes from {} to {} N m", joint, from.torque_nm, to.torque_nm);
  const bool loose =
      record.drive_state != DriveState::kEnabled && record.drive_state != DriveState::kLost;
  if (now_->state == ExecutorState::kFault && loose && now_->reaction != Reaction::kRollOut &&
      last_.state == ExecutorState::kFault && from.velocity_rad_s == 0 && !was_outside &&
      !setting_.has_sensor && to.position_rad != from.position_rad) {
    Fail(Invariant::kSteps, "joint {} is sent on while its drive is not enabled", joint);
  }
  const bool rests = now_->state == ExecutorState::kStopping ||
                     now_->state == ExecutorState::kHolding ||
                     now_->state == ExecutorState::kSettling;
  if (!rests) return;
  if (!setting_.has_sensor && from.velocity_rad_s == 0 && to.velocity_rad_s == 0 && !was_outside &&
      to.position_rad != from.position_rad) {
    Fail(Invariant::kBrake, "joint {} rests, and goes from {} to {} rad", joint, from.position_rad,
         to.position_rad);
  }
  const float brake =
      limits.acceleration_max_rad_s2 * setting_.executor.period_s * ticks * kRounding + 1e-5F;
  const float change = std::abs(to.velocity_rad_s - from.velocity_rad_s);
  const bool slowed = std::abs(from.velocity_rad_s) > limits.velocity_max_rad_s;
  if ((change > brake && !slowed) ||
      std::abs(to.velocity_rad_s) > std::abs(from.velocity_rad_s) + 1e-5F) {
    Fail(Invariant::kBrake, "joint {} goes from {} to {} rad/s", joint, from.velocity_rad_s,
         to.velocity_rad_s);
  }
}

void FlightJudge::JudgeCorrection(std::size_t joint) {
  const float now = now_->joints[joint].correction_rad;
  const float before = last_.joints[joint].correction_rad;
  const float most = correction_rate_max_rad_s_ * static_cast<float>(advance_) *
                         setting_.executor.period_s * 1.0002F +
                     1e-6F;
  // A position that is held keeps its correction, and has none from then on.
  const bool keeps = now == 0;
  if (!(std::abs(now) <= correction_max_rad_ * 1.0002F) ||
      (!(std::abs(now - before) <= most) && !keeps)) {
    Fail(Invariant::kCorrection, "joint {}: from {} to {} rad", joint, before, now);
  }
}

void FlightJudge::JudgeOrder(std::size_t joint, const WireOrder& order) {
  // These are found after the frames of their tick were made.
  constexpr std::uint32_t kLate = BitOf(Fault::kNonFinite) | BitOf(Fault::kArmingTimeout) |
                                  BitOf(Fault::kEntryMissed) | BitOf(Fault::kFallen);
  const bool late = (now_->faults & ~last_.faults & kLate) != 0;
  const bool off = now_->state == ExecutorState::kDisarmed ||
                   (now_->state == ExecutorState::kFault && now_->reaction == Reaction::kDisable &&
                    (!late || last_.reaction == Reaction::kDisable));
  if (off) {
    if (order.kind != WireOrder::Kind::kOff)
      Fail(Invariant::kTorqueOff, "joint {} is not told torque off", joint);
    return;
  }
  const JointRecord& record = now_->joints[joint];
  const WireGrid& grid = wires_[joint].grid();
  const bool carries = wires_[joint].carries_gains();
  if (now_->state == ExecutorState::kArming) {
    const double away = std::abs(order.position_rad - Wide(record.measured.position_rad));
    // The drive has been braking it since it was enabled.
    double& fastest = arming_speed_rad_s_[joint];
    if (tick_.before != ExecutorState::kArming) fastest = 0;
    fastest = std::max(fastest, std::abs(Wide(record.measured.velocity_rad_s)));
    const double moved = fastest * 14 * Wide(setting_.executor.period_s);
    if (order.is_stiff(carries) && tick_.enabled[joint] && !tick_.moved && !tick_.spoilt &&
        record.reply_age_ticks == 0 && away > 0.1 + moved &&
        record.drive_state != DriveState::kEnabled) {
      Fail(Invariant::kArmingPose, "joint {} is enabled {:.3f} rad from where it is", joint, away);
    }
    return;
  }
  if (order.kind == WireOrder::Kind::kBrake) {
    if (std::abs(order.velocity_rad_s) > grid.velocity_rad_s ||
        std::abs(order.torque_nm) > grid.torque_nm) {
      Fail(Invariant::kGains, "joint {} brakes with {} rad/s and {} N m", joint,
           order.velocity_rad_s, order.torque_nm);
    }
    JudgeGains(joint, order);
    return;
  }
  if (order.kind != WireOrder::Kind::kSetpoint) return;
  constexpr double kHalf = 0.502;
  const auto near = [](double sent, double meant, double step) {
    return std::abs(sent - meant) <= kHalf * step + 3e-6 * (1 + std::abs(meant));
  };
  const JointSetpoint& meant = record.limited;
  const bool damped = now_->state == ExecutorState::kFault && now_->reaction == Reaction::kDamp;
  if (!near(order.position_rad, Wide(meant.position_rad), grid.position_rad)) {
    Fail(Invariant::kWire, "joint {}: {} rad is sent as {}", joint, meant.position_rad,
         order.position_rad);
  }
  if (order.has_feed_forward) {
    const double velocity = damped ? 0 : Wide(meant.velocity_rad_s);
    const double torque = damped ? 0 : Wide(meant.torque_nm);
    const bool fits =
        near(order.velocity_rad_s, velocity, grid.velocity_rad_s) &&
        (near(order.torque_nm, torque, grid.torque_nm) ||
         (lowering_ && std::abs(order.torque_nm) <= std::abs(torque) + grid.torque_nm));
    // A fault of this tick may have been found after the frame was made.
    if (!fits && now_->reaction == last_.reaction) {
      Fail(Invariant::kWire, "joint {}: {} rad/s and {} N m are sent as {} and {}", joint, velocity,
           torque, order.velocity_rad_s, order.torque_nm);
    }
  }
  JudgeGains(joint, order);
}

void FlightJudge::JudgeGains(std::size_t joint, const WireOrder& order) {
  const WireGrid& grid = wires_[joint].grid();
  const bool carries = wires_[joint].carries_gains();
  const JointConfig& config = setting_.executor.joints[joint];
  const auto fits = [&](Reaction reaction) {
    double kp = Wide(config.kp_nm_per_rad), kd = Wide(config.kd_nm_s_per_rad);
    if (reaction == Reaction::kCollapse) kp *= Wide(setting_.executor.collapse.stiffness);
    if (reaction == Reaction::kDamp) {
      kp = 0;
      kd = Wide(config.damping_nm_s_per_rad);
    }
    if (!carries) {
      const bool brakes = order.kind == WireOrder::Kind::kBrake;
      return brakes == (kp == 0) || (brakes && lowering_);
    }
    const bool damping = std::abs(order.kd_nm_s_per_rad - kd) <= 0.51 * grid.kd_nm_s_per_rad + 1e-4;
    const bool stiffness = std::abs(order.kp_nm_per_rad - kp) <= 0.51 * grid.kp_nm_per_rad + 1e-3;
    const bool fades = lowering_ && order.kp_nm_per_rad <= kp + grid.kp_nm_per_rad &&
                       order.kp_nm_per_rad <= kp_left_[joint] + 0.01 * grid.kp_nm_per_rad;
    return damping && (stiffness || fades);
  };
  const bool in_fault = now_->state == ExecutorState::kFault;
  const Reaction reaction = in_fault ? now_->reaction : Reaction::kIgnore;
  // A fault of this tick may have been found after the frame was made.
  const bool changed = now_->reaction != last_.reaction;
  const bool before =
      changed && fits(last_.state == ExecutorState::kFault ? last_.reaction : Reaction::kIgnore);
  if (!fits(reaction) && !before) {
    Fail(Invariant::kGains, "joint {} has kp {} and kd {} of {} and {}, kind {}, drive {}", joint,
         order.kp_nm_per_rad, order.kd_nm_s_per_rad, config.kp_nm_per_rad, config.kd_nm_s_per_rad,
         static_cast<int>(order.kind), static_cast<int>(now_->joints[joint].drive_state));
  }
  if (lowering_) kp_left_[joint] = std::min(kp_left_[joint], order.kp_nm_per_rad);
}

}  // namespace tumbler::testing
