#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/configured_drive.h"
#include "firmware_interface/devices/drive_protocol.h"
#include "firmware_interface/devices/drive_range.h"
#include "firmware_interface/devices/joint_map.h"

namespace tumbler {

/// ODrive's `CANSimple` protocol, host side and codec: firmware 0.6 and later (Pro, S1, Micro).
///
/// Classic CAN, 11-bit identifiers of 6 bits node and 5 bits command, little-endian payloads;
/// positions in turns of the shaft, velocities in turns a second. The drive sends heartbeats,
/// estimates and other messages, as it is set up, by itself.
///
/// Watchdog. ODrive firmware feeds it with any frame that carries the node's number, even with
/// requests for telemetry and unknown commands. So a host that goes on polling would keep a drive
/// alive whose setpoints are dead. Therefore nothing is ever requested here: the drive sends
/// everything cyclically, and the only frames to a running drive are its setpoints. When the
/// watchdog expires, the drive disarms (the joint is limp) and latches an error. The watchdog is
/// off by default: turn it on.
///
/// Feed-forwards are 16-bit integers of 0.001 turns/s and 0.001 N m. They are rounded to nearest
/// and saturate at +-32.767; a plain cast would wrap to the other sign.

enum class CanSimpleCommand : std::uint8_t {
  kHeartbeat = 0x01,
  kEstop = 0x02,
  kGetError = 0x03,
  kAddress = 0x06,
  kSetAxisState = 0x07,
  kGetEncoderEstimates = 0x09,
  kSetControllerMode = 0x0b,
  kSetInputPos = 0x0c,
  kSetInputVel = 0x0d,
  kGetTemperature = 0x15,
  kClearErrors = 0x18,
  kGetTorques = 0x1c,
};

/// The axis states that are used. The others are calibrations and the like.
inline constexpr std::uint8_t kCanSimpleIdle = 1;
inline constexpr std::uint8_t kCanSimpleClosedLoop = 8;

/// Control and input modes.
inline constexpr std::uint32_t kCanSimpleVelocityControl = 2;
inline constexpr std::uint32_t kCanSimplePositionControl = 3;
inline constexpr std::uint32_t kCanSimplePassthrough = 1;

/// Procedure results up to this one (success, busy) are no failures.
inline constexpr std::uint8_t kCanSimpleBusy = 1;

/// Errors (a bit each).
inline constexpr std::uint32_t kCanSimpleWatchdogExpired = 0x0100'0000;
inline constexpr std::uint32_t kCanSimpleEstopRequested = 0x0200'0000;

struct CanSimpleHeartbeat {
  std::uint32_t error = 0;            ///< Active errors, and the reason of the last disarm.
  std::uint8_t state = 0;             ///< Of the axis.
  std::uint8_t procedure_result = 0;  ///< Of the last requested state: 0 success, 1 busy, ...
  bool trajectory_done = false;
};
struct CanSimpleErrors {
  std::uint32_t active = 0;
  std::uint32_t disarm_reason = 0;
};
struct CanSimpleAxisState {
  std::uint32_t state = kCanSimpleIdle;
};
struct CanSimpleEstimates {
  float position_rev = 0;
  float velocity_rev_s = 0;
};
struct CanSimpleControllerMode {
  std::uint32_t control = kCanSimplePositionControl;
  std::uint32_t input = kCanSimplePassthrough;
};
struct CanSimpleInputPos {
  float position_rev = 0;
  float velocity_rev_s = 0;  ///< Feed-forward, within +-32.767.
  float torque_nm = 0;       ///< Feed-forward, within +-32.767.
};
struct CanSimpleInputVel {
  float velocity_rev_s = 0;
  float torque_nm = 0;
};
struct CanSimpleTemperature {
  float fet_c = 0;
  float motor_c = 0;
};
struct CanSimpleTorques {
  float target_nm = 0;
  float estimate_nm = 0;
};

/// The largest number of a node. 0x3f stands for a drive without number.
inline constexpr std::uint8_t kCanSimpleNodeMax = 0x3e;

/// The identifier of a command to or message from a node. @pre node <= kCanSimpleNodeMax.
[[nodiscard]] constexpr std::uint32_t CanSimpleId(std::uint8_t node,
                                                  CanSimpleCommand command) noexcept {
  return std::uint32_t{node} << 5 | static_cast<std::uint32_t>(command);
}

[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleHeartbeat& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleErrors& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleAxisState& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleEstimates& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node,
                                       const CanSimpleControllerMode& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleInputPos& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleInputVel& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node,
                                       const CanSimpleTemperature& value) noexcept;
[[nodiscard]] CanFrame EncodeCanSimple(std::uint8_t node, const CanSimpleTorques& value) noexcept;
/// The two commands without content: one latches an emergency stop, the other clears all latched
/// errors.
[[nodiscard]] CanFrame EncodeCanSimpleEstop(std::uint8_t node) noexcept;
[[nodiscard]] CanFrame EncodeCanSimpleClearErrors(std::uint8_t node) noexcept;

/// Frames that are longer than needed are taken.
/// @retval kInvalidArgument  no data frame of this node and kind, or too short; `value` is
/// unchanged.
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleHeartbeat& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame, CanSimpleErrors& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleAxisState& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleEstimates& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleControllerMode& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame, CanSimpleInputPos& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame, CanSimpleInputVel& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame,
                       CanSimpleTemperature& value) noexcept;
Status DecodeCanSimple(std::uint8_t node, const CanFrame& frame, CanSimpleTorques& value) noexcept;

/// Periods [s] of the messages that a drive is set to send by itself; 0: never.
struct CanSimpleMessages {
  double heartbeat_s = 0.01;
  double estimates_s = 0.001;
  double torques_s = 0;
  double temperature_s = 0.1;
};

/// One drive.
struct CanSimpleConfig {
  std::uint8_t node_id = 0;  ///< 0 ... kCanSimpleNodeMax
  ShaftRanges range;         ///< Velocity at most 32.767 turns/s = 205.88 rad/s, torque 32.767 N m.
  JointMap joint;
  /// After this many ticks without a heartbeat the drive's state counts as unknown. More than 2
  /// periods of the heartbeat (100 ms by default, `heartbeat_msg_rate_ms`).
  int heartbeat_ticks_max = 250;
  /// The most estimates that may come in one tick, >= 1: those of `encoder_msg_rate_ms`, and one
  /// for the drift of the drive's clock.
  int estimates_per_tick_max = 2;
  CanSimpleMessages messages;  ///< The drive's settings, for the host to know. It sets nothing.

  /// @retval kInvalidArgument  a value is outside what its comment allows.
  [[nodiscard, gnu::cold]] Status Validate() const noexcept;
};

/// Host side of one drive.
///
/// kDisable sends Set_Axis_State(IDLE) in each tick. kEnable
///   1. waits, sending IDLE, until the drive has reported state and position and is idle;
///   2. sends Set_Controller_Mode(position, passthrough) and Set_Input_Pos(measured) in two ticks,
///      because the drive would act on the last input that it heard;
///   3. sends Set_Axis_State(CLOSED_LOOP) in the next tick, and Set_Input_Pos of that same position
///      in each tick, until a heartbeat says closed loop. Many CAN controllers send the frames of
///      a tick by their identifiers, and this request has the lowest: so it is never sent with what
///      has to come before it.
///      It repeats the request for closed loop only when heartbeats go on saying idle, because a
///      running drive that is asked again starts anew;
///   4. sends Set_Input_Pos with both feed-forwards, one frame a tick. For kp = 0 it sends
///      Set_Controller_Mode(velocity, passthrough) and Set_Input_Vel in each tick instead, so that
///      the drive's own velocity loop brakes.
/// After an error, or when the drive leaves closed loop, the host sends IDLE until the request has
/// been kDisable. kClearErrors sends Clear_Errors and IDLE. The host never sends Estop, since IDLE
/// takes the torque away as fast.
///
/// Changes of state are known from heartbeats, so set their period to 10 ms or so. The state is
/// kFault while the last heartbeat or error message carries an error, and kLost when heartbeats
/// have stopped.
class CanSimpleDrive final : public ConfiguredDrive<CanSimpleConfig> {
 public:
  /// @pre config.Validate() is kOk; otherwise every Encode returns kInvalidArgument and sends
  /// nothing.
  explicit CanSimpleDrive(const CanSimpleConfig& config) noexcept;

  Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                FrameBatch& batch) noexcept override;
  bool Decode(const CanFrame& frame) noexcept override;
  [[nodiscard]] bool IsCommand(const CanFrame& frame) const noexcept override;

  [[nodiscard]] DriveReport report() const noexcept override {
    return {failed_result_, disarm_reason_};
  }
  [[nodiscard]] DriveState state() const noexcept override;
  [[nodiscard]] ReplyRhythm reply_rhythm() const noexcept override {
    return {false, config_.estimates_per_tick_max};
  }
  [[nodiscard]] HeartbeatAge heartbeat() const noexcept override {
    return {heartbeat_age_, config_.heartbeat_ticks_max};
  }

 private:
  static constexpr int kNeverHeard = 1 << 30;
  enum class Stage : std::uint8_t { kOff, kRequest, kPrepare, kWait, kFollow, kTripped };

  [[nodiscard]] bool HasError() const noexcept {
    return heartbeat_.error != 0 || active_error_ != 0;
  }
  [[nodiscard]] bool IsStateKnown() const noexcept {
    return heartbeat_age_ <= config_.heartbeat_ticks_max;
  }
  /// Takes the error into the feedback, where anything that it depends on may have changed.
  void NoteError() noexcept;
  /// Whether it may be enabled.
  [[nodiscard]] bool IsReady() const noexcept;
  void NextStage(bool enable) noexcept;
  void AddSetpoint(const DriveSetpoint& setpoint, FrameBatch& batch) noexcept;
  CanFrame EncodePosition(float joint_rad, float joint_rad_s, float joint_nm) noexcept;

  // One multiplication each between joint and wire.
  float position_to_rev_ = 1, position_to_rad_ = 1, torque_to_nm_ = 1, torque_from_nm_ = 1;
  DriveRange position_rev_, velocity_rev_s_;
  DriveRange velocity_codes_, torque_codes_;  // codes of the feed-forwards
  Stage stage_ = Stage::kOff;
  bool velocity_mode_ = false;  // what the drive was last told
  int prepare_ticks_ = 0;
  int wait_ticks_ = 0;
  int heartbeat_age_ = kNeverHeard;  // ticks since the last heartbeat
  bool idle_since_request_ = false;
  bool has_estimates_ = false;
  CanSimpleHeartbeat heartbeat_;
  // The last procedure result that was a failure, since the drive was asked to be enabled, or since
  // it was. It is kept because the orders that follow a failure succeed.
  std::uint8_t failed_result_ = 0;
  std::uint32_t active_error_ = 0;
  std::uint32_t disarm_reason_ = 0;
  float hold_rad_ = 0;
};

/// The description of the protocol; see drive_protocol.h.
struct CanSimpleProtocol {
  using Config = CanSimpleConfig;
  using Host = CanSimpleDrive;
  static constexpr std::string_view kName = "cansimple";
  static constexpr std::string_view kId = "cansimple";
  static constexpr std::string_view kExample = "tumbler_drives_cansimple.toml";
  static constexpr std::string_view kDbc = "odrive_cansimple.dbc";
  static constexpr int kFirstReply_ms = 500;
  static constexpr bool kCarriesGains = false;

  static Config Example(int joint) noexcept { return OfNode<Config>(joint + 1); }
  static ShaftRanges CommandRanges(const Config& config) noexcept { return config.range; }
  static DriveRange ReportedPositions(const Config& config) noexcept {
    return config.range.position_rad;  // Floats reach as far, at least.
  }
  static bool CommandedPosition(const Config& config, const CanFrame& frame,
                                double& shaft_rad) noexcept;
  static bool ReportedPosition(const Config& config, const CanFrame& frame,
                               double& shaft_rad) noexcept;
  static bool SamplesAt(const Config& /*config*/, const CanFrame& /*frame*/) noexcept {
    return false;  // Estimates are cyclic.
  }
  static std::span<const HostFrame> HostFrames(const Config& config) noexcept;

  static Config Read(DriveTable& table);
  static KeyTable Keys();
  static std::uint32_t DbcId(std::uint32_t of_example, const Config& config);
  static DriveTraffic TrafficOf(const DriveEntry& entry, const Config& config, double rate_hz);
  static OwnedDrive Simulate(const DriveEntry& entry, const Config& config,
                             const SimulatedMotorConfig& motor);
};

}  // namespace tumbler
