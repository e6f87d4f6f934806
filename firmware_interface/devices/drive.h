#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"

namespace tumbler {

/// The executor's order to one drive in one tick. All values are those of the joint, not of the
/// drive's shaft. The drive's law is torque = kp (position - q) + kd (velocity - qdot) + torque.
///
/// Some protocols carry no gains, because the drive has its own. There kp > 0 means that the
/// position is to be followed, and kp = 0 that `velocity_rad_s` alone is (0 brakes the joint).
struct DriveSetpoint {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;  ///< Feed-forward.
  float kp_nm_per_rad = 0;
  float kd_nm_s_per_rad = 0;

  /// Whether no value is NaN or infinite.
  [[nodiscard]] constexpr bool IsFinite() const noexcept {
    const auto zero = [](float x) { return 0.0F * x; };  // NaN unless x is finite
    return zero(position_rad) + zero(velocity_rad_s) + zero(torque_nm) + zero(kp_nm_per_rad) +
               zero(kd_nm_s_per_rad) ==
           0;
  }
};

/// The last report of a drive. Position, velocity and torque are those of the joint.
struct DriveFeedback {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;      ///< Zero where `has_torque` is false.
  float temperature_c = 0;  ///< Zero where `has_temperature` is false.
  bool has_torque = false;  ///< Whether the drive has reported its torque.
  bool has_temperature = false;
  std::uint32_t error = 0;  ///< The drive's own code; zero is none.
};

/// Whether the motor is to be driven.
enum class DriveRequest : std::uint8_t {
  /// Torque off, whatever the drive was doing.
  kDisable,
  /// Follow the setpoint. The drive's start-up sequence runs by itself, over as many ticks as it
  /// needs. A drive that drops out after it was enabled stays off until it has been asked to
  /// disable.
  kEnable,
  /// As kDisable, and the drive forgets its latched errors. One tick is enough. Only the operator
  /// may ask for this; nothing else clears an error.
  kClearErrors,
};

/// The state of a drive, as far as its replies show it.
enum class DriveState : std::uint8_t {
  kUnknown,  ///< No reply yet.
  kDisabled,
  kEnabling,  ///< The start-up sequence is under way.
  kEnabled,   ///< The next setpoint will be followed.
  kFault,     ///< The drive reports an error.
  kLost,      ///< The drive's heartbeat has stopped, and its state is not known.
};

/// When a drive sends its measured positions.
struct ReplyRhythm {
  /// Whether the drive answers each tick in which it was written, so that counting tells repeated
  /// and belated replies. Otherwise the drive sends by its own clock.
  bool answers = true;
  /// Of a drive that sends by its own clock: the most positions in one period of the loop.
  int per_tick_max = 1;
};

/// Age of a drive's heartbeat.
struct HeartbeatAge {
  int ticks = 0;
  int limit_ticks = 0;  ///< At a greater age the state is kLost; 0: the protocol has no heartbeat.
};

/// What a drive has refused while it was set up: an object of its dictionary. A code of 0: nothing.
struct SetUpRefusal {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint32_t code = 0;
};

/// What a drive has said of itself besides its error code. Zero where its protocol has no such
/// word, or nothing was said.
struct DriveReport {
  std::uint8_t procedure_result = 0;  ///< How its last change of state ended.
  std::uint32_t disarm_reason = 0;    ///< The errors for which it took its torque off last.
};

/// The frames of one tick for one drive.
class FrameBatch {
 public:
  static constexpr int kCapacity = 4;
  /// @retval kCapacityExceeded  four frames are in it; the frame was not taken.
  Status Add(const CanFrame& frame) noexcept {
    if (count_ == kCapacity) return Status::kCapacityExceeded;
    frames_[static_cast<std::size_t>(count_++)] = frame;
    return Status::kOk;
  }
  /// Adds a frame that is written where it stays. The caller sets all of it.
  /// @returns null  where four frames are in it.
  [[nodiscard]] CanFrame* AddPlace() noexcept {
    if (count_ == kCapacity) return nullptr;
    return &frames_[static_cast<std::size_t>(count_++)];
  }
  void Clear() noexcept { count_ = 0; }
  [[nodiscard]] std::span<const CanFrame> frames() const noexcept {
    return {frames_.data(), static_cast<std::size_t>(count_)};
  }

 private:
  std::array<CanFrame, kCapacity> frames_{};
  int count_ = 0;
};

/// Host side of one motor drive: a state machine between setpoints and frames, with no clock and no
/// bus of its own.
///
/// Every tick calls Encode exactly once, and Decode once for every frame received since the tick
/// before. Encode writes the drive every time. Frames that a drive or its bus needs besides
/// setpoints (set-up, synchronisation, heartbeats) come from the same call: so when the host's
/// setpoints stop, the drive's watchdog notices.
///
/// Real time: no heap, no locks, no exceptions. Freestanding.
class Drive {
 public:
  Drive() = default;
  Drive(const Drive&) = delete;  // One object speaks for one drive.
  Drive& operator=(const Drive&) = delete;
  virtual ~Drive() = default;

  /// Adds this tick's frames to `batch`. The setpoint is clamped to the drive's ranges. If a value
  /// of it is not finite, the motor is disabled instead, and kInvalidArgument returned.
  virtual Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                        FrameBatch& batch) noexcept = 0;

  /// Takes a frame, and updates `feedback()` and `state()` from it. Frames of other drives, and
  /// frames that are malformed or unknown to the protocol, change nothing.
  /// @returns whether the frame brought a measured position, from which the age of a reply is
  /// counted. Heartbeats, errors and temperatures do not.
  virtual bool Decode(const CanFrame& frame) noexcept = 0;

  /// Whether a frame is one that only the host may send to this drive, or to it and others. A bus
  /// never gives a host its own frames back. So when such a frame is received, somebody else
  /// commands the drive.
  [[nodiscard]] virtual bool IsCommand(const CanFrame& frame) const noexcept = 0;

  /// The setpoint of the last Encode as the drive will see it, after rounding on the wire. Values
  /// that the protocol does not carry are zero. Until the setpoint is followed, the position is the
  /// measured one.
  [[nodiscard]] virtual DriveSetpoint encoded_setpoint() const noexcept = 0;
  [[nodiscard]] virtual DriveFeedback feedback() const noexcept = 0;
  [[nodiscard]] virtual DriveState state() const noexcept = 0;

  [[nodiscard]] virtual ReplyRhythm reply_rhythm() const noexcept { return {}; }
  [[nodiscard]] virtual HeartbeatAge heartbeat() const noexcept { return {}; }
  [[nodiscard]] virtual SetUpRefusal set_up_refusal() const noexcept { return {}; }
  [[nodiscard]] virtual DriveReport report() const noexcept { return {}; }
};

}  // namespace tumbler
