// How the executor finds faults, and answers them.

#include <algorithm>

#include "runtime/executor/executor.h"
#include "runtime/executor/numbers.h"

namespace tumbler {
namespace {

/// A drive that has been silent for so many times the age of a stale reply is none that obeys.
constexpr int kSilence = 5;

bool IsLinkUp(Status status) noexcept {
  return status == Status::kOk || status == Status::kWouldBlock;
}

}  // namespace

void Executor::DetectFaults(const TickInput& input, std::int64_t elapsed) noexcept {
  if (elapsed != 1) DetectLateness(elapsed);
  if (input.send_status != Status::kOk || !IsLinkUp(input.receive_status) ||
      input.controller >= CanControllerState::kErrorPassive) {
    DetectLinkFaults(input);
  }
  if (foreign_joint_ >= 0) {
    Latch(Fault::kForeignCommand, foreign_joint_, DetailNumber::Code(foreign_id_), {});
  }
  if (pitch_ != nullptr && pitch_->status() != SensorStatus::kOk) {
    Latch(Fault::kSensorLost, -1,
          DetailNumber::Integer(static_cast<std::int64_t>(pitch_->status())), {});
  }
  // All checks of a tick see the same reaction. A fault found now changes it for the next tick.
  const bool follows = phase_ == Phase::kFault ? KeepsGains(answer_.reaction)
                                               : phase_ != Phase::kArming && !IsLowering(phase_);
  const float following_tolerance_rad = primitive_->following_tolerance_rad;
  for (int i = 0; i < joint_count_; ++i) {
    const auto index = static_cast<std::size_t>(i);
    Joint& joint = joints_[index];
    if (joint.measured.error != 0 || joint.drive_state != DriveState::kEnabled) {
      DetectDriveFaults(i);
    } else {
      joint.was_enabled = true;
    }
    if (joint.replies.sequence_errors() > config_.sequence_errors_max) {
      Latch(Fault::kWrongSequence, i, DetailNumber::Integer(joint.replies.sequence_errors()),
            DetailNumber::Integer(config_.sequence_errors_max));
    }
    if (joint.replies.age_ticks() != 0) {
      if (joint.replies.silent_ticks() > config_.stale_ticks_max) DetectStaleReply(i);
      continue;
    }
    if (!joint.IsMeasuredFinite()) {
      Latch(Fault::kNonFinite, i, DetailNumber::Real(joint.measured.position_rad), {});
      continue;
    }
    const float temperature_max_c = config_.joints[index].temperature_max_c;
    if (joint.measured.has_temperature && joint.measured.temperature_c > temperature_max_c) {
      Latch(Fault::kOverTemperature, i, DetailNumber::Real(joint.measured.temperature_c),
            DetailNumber::Real(temperature_max_c));
    }
    // `commanded` is still the setpoint of the tick before, which this reply answers.
    const float error = Magnitude(joint.measured.position_rad - joint.commanded.position_rad);
    if (follows && error > following_tolerance_rad) {
      Latch(Fault::kFollowingError, i, DetailNumber::Real(error),
            DetailNumber::Real(following_tolerance_rad));
    }
  }
}

void Executor::DetectLateness(std::int64_t elapsed) noexcept {
  // Known before anything is sent: no setpoint of before the pause is, once a drive may have let
  // go.
  if (elapsed > config_.pause_ticks_max) {
    return Latch(Fault::kPaused, -1, DetailNumber::Integer(elapsed),
                 DetailNumber::Integer(config_.pause_ticks_max));
  }
  const std::int64_t missed = elapsed - 1;
  if (missed >= 0 && missed <= config_.late_ticks_max) return;
  // A motion that is already rolled out becomes later still.
  if (answer_.reaction == Reaction::kRollOut) {
    answer_.late_ticks += missed;
    if (IsTooLate(*answer_.abort, answer_.late_ticks)) answer_.reaction = Reaction::kDamp;
  }
  Latch(Fault::kLateTick, -1, DetailNumber::Integer(missed),
        DetailNumber::Integer(config_.late_ticks_max));
}

void Executor::DetectStaleReply(int index) noexcept {
  const int silent_ticks = joints_[static_cast<std::size_t>(index)].replies.silent_ticks();
  Latch(Fault::kStaleReply, index, DetailNumber::Integer(silent_ticks),
        DetailNumber::Integer(config_.stale_ticks_max));
  // What an abort counts on is that the drives obey.
  const bool aborts = answer_.reaction == Reaction::kRollOut || answer_.reaction == Reaction::kFold;
  if (aborts && silent_ticks > kSilence * config_.stale_ticks_max)
    answer_.reaction = Reaction::kDamp;
}

void Executor::DetectLinkFaults(const TickInput& input) noexcept {
  const auto latch = [this](Status status) {
    Fault fault = Fault::kLinkFailed;
    if (status == Status::kBusOff) fault = Fault::kBusOff;
    if (status == Status::kLinkDown) fault = Fault::kInterfaceDown;
    if (status == Status::kLinkGone) fault = Fault::kInterfaceGone;
    if (status == Status::kWouldBlock) fault = Fault::kTransmitQueueFull;
    Latch(fault, -1, DetailNumber::Integer(static_cast<std::int64_t>(status)), {});
  };
  // The failure to send comes first, because it happened in the tick before. A link that was lost
  // since may be its consequence.
  if (input.send_status != Status::kOk) latch(input.send_status);
  if (!IsLinkUp(input.receive_status)) latch(input.receive_status);
  if (input.controller == CanControllerState::kBusOff) latch(Status::kBusOff);
  if (input.controller == CanControllerState::kErrorPassive) {
    Latch(Fault::kErrorPassive, -1,
          DetailNumber::Integer(static_cast<std::int64_t>(input.controller)),
          DetailNumber::Integer(static_cast<std::int64_t>(CanControllerState::kErrorWarning)));
  }
}

void Executor::DetectDriveFaults(int index) noexcept {
  const Joint& joint = joints_[static_cast<std::size_t>(index)];
  if (joint.drive_state == DriveState::kLost) {
    const HeartbeatAge age = joint.drive->heartbeat();
    Latch(Fault::kHeartbeatLost, index, DetailNumber::Integer(age.ticks),
          DetailNumber::Integer(age.limit_ticks));
  }
  const bool stays =
      joint.drive_state == DriveState::kEnabled || joint.drive_state == DriveState::kLost;
  const bool driven = answer_.reaction != Reaction::kDisable;
  if (joint.measured.error != 0 || joint.drive_state == DriveState::kFault ||
      (driven && joint.was_enabled && !stays)) {
    Latch(Fault::kDriveError, index, DetailNumber::Code(joint.drive->feedback().error), {});
  }
}

void Executor::NoteForeignCommand(const CanFrame& frame) noexcept {
  for (int i = 0; i < joint_count_; ++i) {
    if (!joints_[static_cast<std::size_t>(i)].drive->IsCommand(frame)) continue;
    foreign_joint_ = i;
    foreign_id_ = frame.id;
    return;
  }
}

// Not in its many callers: a healthy tick does not come here.
[[gnu::noinline]] void Executor::Latch(Fault fault, int joint, DetailNumber value,
                                       DetailNumber limit) noexcept {
  const std::uint32_t bit = 1U << static_cast<unsigned>(fault);
  // A latched fault has been answered. Only another fault can make the reaction stronger.
  if ((faults_ & bit) != 0) return;
  const std::int64_t late_ticks = fault == Fault::kLateTick ? value.integer() : 0;
  const Reaction reaction = ReactionTo(fault, late_ticks);
  if (reaction == Reaction::kIgnore) return;
  faults_ |= bit;
  if (first_fault_.fault == Fault::kNone) {
    first_fault_ = {tick_, value, limit, fault, static_cast<std::int8_t>(joint), state(), reaction};
  }
  if (IsFault(phase_)) {
    answer_.reaction = Stronger(answer_.reaction, reaction);
    return;
  }
  answer_ = {reaction, &primitive_->aborts.At(primitive_time_s_), late_ticks};
  BreakOff();
  phase_ = IsLowering(phase_) ? Phase::kLoweringInFault : Phase::kFault;
  if (reaction != Reaction::kRollOut) ticks_in_phase_ = 0;  // Else the motion's time goes on.
}

/// What a fault that is found now is answered with.
/// @param late_ticks  by how much this tick is late.
Reaction Executor::ReactionTo(Fault fault, std::int64_t late_ticks) const noexcept {
  const Reaction reaction = config_.reactions(fault, state());
  // There is nothing to go on with from where a robot lies that could not get up.
  if (fault == Fault::kFallen && phase_ == Phase::kGettingUp && reaction == Reaction::kIgnore)
    return Reaction::kHold;
  if (reaction != Reaction::kAbort) return reaction;
  // Tables are found for the motion's own speed.
  if (!primitive_->aborts.present() || config_.speed != 1)
    return fault == Fault::kOperatorStop ? Reaction::kHold : Reaction::kDamp;
  const AbortSpan<float>& span = primitive_->aborts.At(primitive_time_s_);
  switch (span.way) {
    case AbortWay::kCatch:
      return Reaction::kHold;
    case AbortWay::kFold:
      return Reaction::kFold;
    case AbortWay::kRollOut:
      return IsTooLate(span, late_ticks) ? Reaction::kDamp : Reaction::kRollOut;
    case AbortWay::kDamp:
      break;
  }
  return Reaction::kDamp;
}

/// Whether a motion is too late to be rolled out.
bool Executor::IsTooLate(const AbortSpan<float>& span, std::int64_t late_ticks) const noexcept {
  return late_ticks > CeilTicks(span.late_max_s / config_.period_s);
}

}  // namespace tumbler
