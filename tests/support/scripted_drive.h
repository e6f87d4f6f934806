#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "firmware_interface/devices/drive.h"

namespace tumbler::testing {

/// A drive that does as the test says. Its frames carry no numbers: `setpoint` and `request` hold
/// exactly what was asked of it, and it answers with what `reply` holds when the answer is decoded.
class ScriptedDrive final : public Drive {
 public:
  explicit ScriptedDrive(std::uint32_t id) : id_(id) {}

  Status Encode(DriveRequest request_in, const DriveSetpoint& setpoint_in,
                FrameBatch& batch) noexcept override {
    request = request_in;
    setpoint = setpoint_in;
    enable_ticks_ = request == DriveRequest::kEnable ? enable_ticks_ + 1 : 0;
    ++encodes;
    CanFrame frame;
    frame.id = id_;
    if (batch.Add(frame) != Status::kOk) return Status::kCapacityExceeded;
    return encode_status;
  }
  bool Decode(const CanFrame& frame) noexcept override {
    if (frame.id != id_) return false;
    feedback_ = reply;
    heard_ = true;
    return true;
  }
  /// Commands have the identifier of replies plus 0x100.
  [[nodiscard]] bool IsCommand(const CanFrame& frame) const noexcept override {
    return frame.id == id_ + 0x100;
  }
  [[nodiscard]] DriveSetpoint encoded_setpoint() const noexcept override {
    return on_wire.value_or(setpoint);
  }
  [[nodiscard]] DriveFeedback feedback() const noexcept override { return feedback_; }
  [[nodiscard]] DriveState state() const noexcept override {
    if (!heard_) return DriveState::kUnknown;
    if (says) return *says;
    if (feedback_.error != 0) return DriveState::kFault;
    if (heartbeat_age.ticks > heartbeat_age.limit_ticks) return DriveState::kLost;
    if (stuck || enable_ticks_ == 0) return DriveState::kDisabled;
    return enable_ticks_ < start_up_ticks ? DriveState::kEnabling : DriveState::kEnabled;
  }

  [[nodiscard]] ReplyRhythm reply_rhythm() const noexcept override { return rhythm; }
  [[nodiscard]] HeartbeatAge heartbeat() const noexcept override { return heartbeat_age; }

  /// A frame that `Decode` takes.
  [[nodiscard]] CanFrame Answer() const {
    CanFrame frame;
    frame.id = id_;
    return frame;
  }

  DriveFeedback reply;
  int start_up_ticks = 3;
  bool stuck = false;  ///< Whether the drive refuses to be enabled, or drops out if it was.
  Status encode_status = Status::kOk;
  std::optional<DriveState> says;  ///< Its state once it was heard, whatever else is the case.
  std::optional<DriveSetpoint> on_wire;  ///< What its frames carry, where that is something else.
  ReplyRhythm rhythm;
  HeartbeatAge heartbeat_age;

  DriveRequest request = DriveRequest::kDisable;
  DriveSetpoint setpoint;
  int encodes = 0;

 private:
  std::uint32_t id_;
  DriveFeedback feedback_;
  bool heard_ = false;
  int enable_ticks_ = 0;
};

}  // namespace tumbler::testing
