#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/status.h"
#include "firmware_interface/can/frame.h"

namespace tumbler {

/// What the executor asks of one drive in one tick, at the joint (after gear, direction and zero).
/// The drive's law is torque = kp (position - q) + kd (velocity - qdot) + torque. Where gains
/// belong to the drive itself and its protocol does not carry them, kp > 0 asks for the position to
/// be followed, and kp = 0 for `velocity_rad_s` alone (at zero: to brake the joint).
struct DriveSetpoint {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;  ///< feed-forward
  float kp_nm_per_rad = 0;
  float kd_nm_s_per_rad = 0;

  /// Neither NaN nor infinite anywhere.
  [[nodiscard]] constexpr bool IsFinite() const noexcept {
    const auto zero = [](float x) { return x - x; };  // or NaN
    return zero(position_rad) + zero(velocity_rad_s) + zero(torque_nm) + zero(kp_nm_per_rad) +
               zero(kd_nm_s_per_rad) ==
           0;
  }
};

/// What a drive last said of itself, at the joint.
struct DriveFeedback {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;
  float temperature_c = 0;  ///< Zero where `has_temperature` is false.
  bool has_temperature = false;
  std::uint32_t error = 0;  ///< The drive's own code; zero is none.
};

/// Whether the motor is to be driven.
enum class DriveRequest : std::uint8_t {
  kDisable,  ///< Torque off, whatever the drive was doing.
  kEnable,   ///< Follow the setpoint; the drive's start-up sequence runs by itself over as many
             ///< ticks as it needs. A drive that was enabled and no longer is stays off until it
             ///< has been asked to disable.
  kClearErrors,  ///< kDisable, and forget the drive's latched errors. One tick of it is enough; it
                 ///< is the operator's alone to ask, nothing else clears an error.
};

/// What the drive is known to be doing, from its replies.
enum class DriveState : std::uint8_t {
  kUnknown,  ///< No reply yet.
  kDisabled,
  kEnabling,  ///< The start-up sequence is under way.
  kEnabled,   ///< The next setpoint will be followed.
  kFault,     ///< The drive reports an error.
  kLost,      ///< Its own heartbeat has stopped: what it does now is not known.
};

/// How a drive's measured positions come.
struct ReplyRhythm {
  /// One to each tick in which the drive was written, so that repeated and belated ones can be told
  /// by counting. Otherwise the drive sends by its own clock.
  bool answers = true;
  int per_tick_max = 1;  ///< Where it sends by its own clock: the most in one period.
};

/// Age of a drive's heartbeat.
struct HeartbeatAge {
  int ticks = 0;
  int limit_ticks = 0;  ///< Beyond it the state is kLost; 0: the protocol has no heartbeat.
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
/// before. Encode writes the drive every time; what a drive or its bus needs besides the setpoint
/// (set-up, synchronisation, heartbeats) comes from the same call, so that a host whose setpoints
/// have stopped keeps no watchdog quiet. Real time: no heap, no locks, no exceptions. Freestanding.
class Drive {
 public:
  Drive() = default;
  Drive(const Drive&) = delete;  // One object speaks for one drive.
  Drive& operator=(const Drive&) = delete;
  virtual ~Drive() = default;

  /// Adds this tick's frames to `batch`. The setpoint is clamped to the drive's ranges; with a
  /// value in it that is not finite the motor is disabled instead, and kInvalidArgument returned.
  virtual Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                        FrameBatch& batch) noexcept = 0;

  /// Takes a frame if it is this drive's, and updates `feedback()` and `state()`. Returns true if
  /// it brought a measured position, which is what the age of a reply counts from; false after the
  /// drive's other messages (heartbeats, errors, temperatures). A frame that is another drive's,
  /// malformed or out of the protocol is left alone.
  virtual bool Decode(const CanFrame& frame) noexcept = 0;

  /// What Encode put on the wire last, decoded again: setpoint as the drive will see it, after
  /// rounding. What the protocol does not carry is zero; before the setpoint is followed, the
  /// position is the measured one.
  [[nodiscard]] virtual DriveSetpoint encoded_setpoint() const noexcept = 0;
  [[nodiscard]] virtual DriveFeedback feedback() const noexcept = 0;
  [[nodiscard]] virtual DriveState state() const noexcept = 0;

  [[nodiscard]] virtual ReplyRhythm reply_rhythm() const noexcept { return {}; }
  [[nodiscard]] virtual HeartbeatAge heartbeat() const noexcept { return {}; }
};

}  // namespace tumbler
