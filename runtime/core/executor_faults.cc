// How the executor finds faults, and answers them.

#include <algorithm>

#include "runtime/core/executor.h"
#include "runtime/core/numbers.h"

namespace tumbler {
namespace {

bool IsLinkUp(Status status) noexcept {
  return status == Status::kOk || status == Status::kWouldBlock;
}

}  // namespace

void Executor::DetectFaults(const TickInput& input, std::int64_t elapsed) noexcept {
  if (elapsed < 1 || elapsed > 1 + static_cast<std::int64_t>(config_.late_ticks_max)) {
    Latch(Fault::kLateTick, -1, DetailNumber::Integer(elapsed - 1),
          DetailNumber::Integer(config_.late_ticks_max));
  }
  if (input.send_status != Status::kOk || !IsLinkUp(input.receive_status) ||
      input.controller >= CanControllerState::kErrorPassive) {
    DetectLinkFaults(input);
  }
  if (foreign_joint_ >= 0) {
    Latch(Fault::kForeignCommand, foreign_joint_, DetailNumber::Code(foreign_id_), {});
  }
  if (sensor_ != nullptr && sensor_watch_.status() != SensorStatus::kOk) {
    Latch(Fault::kSensorLost, -1,
          DetailNumber::Integer(static_cast<std::int64_t>(sensor_watch_.status())), {});
  }
  // All checks of a tick see the same reaction. A fault found now changes it for the next tick.
  const bool follows =
      state_ != ExecutorState::kArming && reaction_ <= Reaction::kHold && !lowering_;
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
      if (joint.replies.age_ticks() > config_.stale_ticks_max) {
        Latch(Fault::kStaleReply, i, DetailNumber::Integer(joint.replies.age_ticks()),
              DetailNumber::Integer(config_.stale_ticks_max));
      }
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
  const bool driven = reaction_ != Reaction::kDisable;
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

void Executor::Latch(Fault fault, int joint, DetailNumber value, DetailNumber limit) noexcept {
  const std::uint32_t bit = 1U << static_cast<unsigned>(fault);
  // A latched fault has been answered. Only another fault can make the reaction stronger.
  if ((faults_ & bit) != 0) return;
  const Reaction reaction = config_.reactions(fault, state_);
  if (reaction == Reaction::kIgnore) return;
  faults_ |= bit;
  if (first_fault_.fault == Fault::kNone) {
    first_fault_ = {tick_, value, limit, fault, static_cast<std::int8_t>(joint), state_, reaction};
  }
  reaction_ = std::max(reaction_, reaction);
  if (state_ != ExecutorState::kFault) Enter(ExecutorState::kFault);
}

}  // namespace tumbler
