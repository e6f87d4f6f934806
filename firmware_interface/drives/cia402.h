#pragma once

#include <cstdint>
#include <string_view>

#include "common/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/drives/canopen.h"
#include "firmware_interface/drives/drive.h"
#include "firmware_interface/drives/drive_protocol.h"
#include "firmware_interface/drives/drive_range.h"
#include "firmware_interface/drives/joint_map.h"

namespace tumbler {

/// CiA 402 drives in cyclic synchronous position (CSP) over CANopen: codec and host side.
///
/// The host's SYNC begins every tick. At a SYNC the drive acts on the setpoint that it received
/// since the one before, interpolates towards it for one period, and reports where it is. A
/// setpoint therefore takes effect one tick after it was sent, at a moment that does not depend on
/// the bus's load, and a measurement comes back within the tick of its SYNC.
///
///   RPDO1  controlword 16 | target position 32                         every tick
///   RPDO2  velocity offset 32 | torque offset 16                       every tick, if
///   `feed_forward` TPDO1  statusword 16 | position actual 32                          every SYNC
///   TPDO2  velocity actual 32 | torque actual 16                       every `status_every`-th
///   SYNC
///
/// Units are the drive's: positions in increments, torques in thousandths of the rated torque.
/// Numbers are rounded to nearest and saturate; none wraps.
///
/// Watchdog. The drive consumes the host's heartbeat, which Encode makes, every third of
/// `watchdog_ms`; what happens when it stops is 6007h.

/// RPDO1.
struct Cia402Command {
  std::uint16_t controlword = 0;
  std::int32_t position = 0;
};
/// RPDO2.
struct Cia402FeedForward {
  std::int32_t velocity = 0;
  std::int16_t torque = 0;
};
/// TPDO1.
struct Cia402Status {
  std::uint16_t statusword = 0;
  std::int32_t position = 0;
};
/// TPDO2.
struct Cia402Motion {
  std::int32_t velocity = 0;
  std::int16_t torque = 0;
};

[[nodiscard]] CanFrame EncodeCia402(std::uint8_t node, const Cia402Command& value) noexcept;
[[nodiscard]] CanFrame EncodeCia402(std::uint8_t node, const Cia402FeedForward& value) noexcept;
[[nodiscard]] CanFrame EncodeCia402(std::uint8_t node, const Cia402Status& value) noexcept;
[[nodiscard]] CanFrame EncodeCia402(std::uint8_t node, const Cia402Motion& value) noexcept;
/// @retval kInvalidArgument  not a data frame of this node and kind, or shorter than 6 bytes.
Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402Command& value) noexcept;
Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402FeedForward& value) noexcept;
Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402Status& value) noexcept;
Status DecodeCia402(std::uint8_t node, const CanFrame& frame, Cia402Motion& value) noexcept;

/// States of the drive's power stage (CiA 402-2, finite state automaton).
enum class Cia402State : std::uint8_t {
  kNotReady,
  kSwitchOnDisabled,
  kReady,
  kSwitchedOn,
  kEnabled,
  kQuickStop,
  kFaultReaction,
  kFault,
};
/// kNotReady for a pattern that is no state.
[[nodiscard]] Cia402State StateOf(std::uint16_t statusword) noexcept;
/// The state's bits alone.
[[nodiscard]] std::uint16_t StatuswordOf(Cia402State state) noexcept;

/// Commands of the controlword.
namespace cia402_control {
inline constexpr std::uint16_t kDisableVoltage = 0x0000;
inline constexpr std::uint16_t kQuickStop = 0x0002;
inline constexpr std::uint16_t kShutdown = 0x0006;
inline constexpr std::uint16_t kSwitchOn = 0x0007;
inline constexpr std::uint16_t kEnable = 0x000f;
inline constexpr std::uint16_t kFaultReset = 0x0080;
}  // namespace cia402_control

inline constexpr std::uint16_t kCia402FollowingError = 1U << 13;  ///< statusword, in CSP
inline constexpr std::int8_t kCia402Csp = 8;                      ///< 6060h, 6061h

/// One drive.
struct Cia402Config {
  std::uint8_t node_id = 1;    ///< 1 ... 126
  std::uint8_t host_id = 127;  ///< 1 ... 127, of the host's heartbeat; not a drive's.
  /// Sends SYNC and the host's heartbeat: exactly one drive of a bus does (DriveBank sees to it).
  bool leader = true;
  float position_units_per_turn = 65536;  ///< > 0, increments of a turn of the shaft: 607Ah, 6064h
  float velocity_units_per_turn_s = 65536;  ///< > 0: 606Ch, 60B1h
  float rated_torque_nm = 1;                ///< > 0: 6071h, 6077h, 60B2h count thousandths of it
  ShaftRanges range;  ///< What fits 32 bits of position and velocity, and 16 of torque.
  JointMap joint;
  std::uint32_t period_us = 1000;    ///< Of the control tick: what 60C2h can say, 100 ... 100000.
  std::uint16_t heartbeat_ms = 100;  ///< 1 ... 10000, of the drive: 1017h. Silent for three: lost.
  std::uint16_t watchdog_ms = 25;    ///< 0 ... 10000, of the host's heartbeat: 1016h. 0: none.
  /// 6007h, what the drive does then: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop.
  std::int16_t watchdog_reaction = 1;
  /// 605Ah, for braking (a setpoint with kp = 0): 5 or 6 stand under control after it, 1 or 2 end
  /// with the torque off.
  std::int16_t quick_stop_option = 6;
  bool feed_forward = true;        ///< RPDO2: velocity and torque offsets.
  std::uint8_t status_every = 4;   ///< 1 ... 240 SYNCs to a TPDO2.
  float following_window_rad = 0;  ///< >= 0, at the shaft: 6065h. 0 leaves the drive's own.

  /// @retval kInvalidArgument  a value is outside what its comment allows.
  [[nodiscard]] Status Validate() const noexcept;
};

/// 60C2h: period = value 10^exponent seconds.
struct Cia402Period {
  std::uint8_t value = 0;
  std::int8_t exponent = 0;
};
/// @retval kInvalidArgument  the period is not 1 ... 255 steps of a power of ten.
Status ToInterpolationPeriod(std::uint32_t period_us, Cia402Period& period) noexcept;

/// The objects that set a drive up, in their order; `step` counts from 0. False past the last.
bool Cia402SetUp(const Cia402Config& config, int step, SdoRequest& request) noexcept;

/// Host side of one drive.
///
/// Whatever is asked, the communication comes first: NMT pre-operational, the objects of
/// Cia402SetUp one SDO at a time, NMT start, until the drive reports; mode display is read back. A
/// drive that does not answer within kAnswerTicks is begun with anew; a refused object is a fault
/// (error: the abort code) until kClearErrors. Then, each tick, RPDO1 and RPDO2:
///   kDisable   controlword 0x0000: torque off in one step from any state;
///   kEnable    0x06, 0x07, 0x0F as the statusword follows, with target = measured position, once
///              the drive was seen off; then the setpoints. With kp = 0: quick stop.
///   kClearErrors  0x0000, then 0x0080 until the fault is gone, or kResetTicks.
/// While being set up the drive gets RPDO1 with controlword 0, too, so that every tick writes it.
/// A fault, a node state other than operational, a boot-up, or any other power state after
/// Operation Enabled ends it: 0x0000 until the request has been kDisable.
///
/// kFault on the fault state, an EMCY that was not taken back, the following-error bit while
/// enabled (8611h), and a refused set-up. kLost when the drive's heartbeat has stopped: the
/// frames go out as asked all the same, and kClearErrors begins with the drive anew.
class Cia402Drive final : public Drive {
 public:
  static constexpr int kAnswerTicks = 200;
  static constexpr int kResetTicks = 200;

  /// @pre config.Validate() is kOk; otherwise every Encode returns kInvalidArgument and sends
  /// nothing.
  explicit Cia402Drive(const Cia402Config& config) noexcept;

  Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                FrameBatch& batch) noexcept override;
  bool Decode(const CanFrame& frame) noexcept override;

  [[nodiscard]] DriveSetpoint encoded_setpoint() const noexcept override { return encoded_; }
  [[nodiscard]] DriveFeedback feedback() const noexcept override { return feedback_; }
  [[nodiscard]] DriveState state() const noexcept override { return state_; }
  [[nodiscard]] HeartbeatAge heartbeat() const noexcept override {
    return {heartbeat_age_, heartbeat_ticks_max_};
  }
  [[nodiscard]] const Cia402Config& config() const noexcept { return config_; }

 private:
  enum class Link : std::uint8_t { kReset, kSetUp, kRefused, kStart, kReadMode, kRunning };
  enum class Follow : std::uint8_t { kOff, kWaitOff, kSequence, kFollow, kBrake, kTripped };

  [[nodiscard]] std::uint32_t FindError() const noexcept;
  [[nodiscard]] DriveState FindState() const noexcept;
  // To be called when anything that they depend on has changed.
  void Refresh() noexcept {
    feedback_.error = FindError();
    state_ = FindState();
  }
  [[nodiscard]] bool IsHeartbeatLost() const noexcept {
    return heartbeat_age_ > heartbeat_ticks_max_;
  }
  void AddCommon(FrameBatch& batch) noexcept;
  bool AddService(FrameBatch& batch) noexcept;
  void Restart() noexcept;
  void NextFollow(bool enable, bool brake) noexcept;
  [[nodiscard]] std::uint16_t Controlword() noexcept;
  void AddPdos(std::uint16_t controlword, const DriveSetpoint* setpoint,
               FrameBatch& batch) noexcept;
  void TakeReply(const SdoReply& reply) noexcept;

  Cia402Config config_;
  bool valid_;
  // One multiplication each between joint and wire.
  float position_to_units_ = 1, position_to_rad_ = 1, velocity_to_units_ = 1,
        velocity_to_rad_s_ = 1, torque_to_units_ = 1, torque_to_nm_ = 1;
  DriveRange position_units_, velocity_units_, torque_units_;
  int heartbeat_ticks_max_ = 0;
  int host_heartbeat_ticks_ = 0;

  int host_heartbeat_due_ = 0;
  Link link_ = Link::kReset;
  int step_ = 0;
  bool waiting_ = false;  // for the answer to the service sent last
  int wait_ticks_ = 0;
  std::uint32_t refusal_ = 0;

  Follow follow_ = Follow::kOff;
  int reset_ticks_ = 0;  // left of the attempt to reset a fault
  bool heard_ = false;   // a TPDO1 since the set-up
  int heartbeat_age_ = 0;
  std::int32_t position_ = 0;  // as reported
  std::uint16_t statusword_ = 0;
  Cia402State power_ = Cia402State::kNotReady;  // that of the statusword
  std::uint16_t emergency_ = 0;
  DriveFeedback feedback_;
  DriveState state_ = DriveState::kUnknown;
  DriveSetpoint encoded_;
};

/// The description of the protocol; see drive_protocol.h.
struct Cia402Protocol {
  using Config = Cia402Config;
  using Host = Cia402Drive;
  static constexpr std::string_view kName = "canopen-csp";
  static constexpr std::string_view kId = "cia402";
  static constexpr std::string_view kExample = "tumbler_drives_cia402.toml";
  static constexpr std::string_view kDbc = "cia402_csp.dbc";
  static constexpr int kFirstReply_ms = 5000;  // Some 40 objects are set first.

  static Config Example(int joint) noexcept {
    Config config;
    config.node_id = static_cast<std::uint8_t>(joint + 1);
    config.rated_torque_nm = 6;
    return config;
  }
  static ShaftRanges CommandRanges(const Config& config) noexcept { return config.range; }
  static DriveRange ReportedPositions(const Config& config) noexcept {
    return config.range.position_rad;  // 32 bits reach as far, at least.
  }
  static bool CommandedPosition(const Config& config, const CanFrame& frame,
                                double& shaft_rad) noexcept;
  static bool ReportedPosition(const Config& config, const CanFrame& frame,
                               double& shaft_rad) noexcept;

  static Config Read(DriveTable& table);
  static void CheckBeside(const DriveEntry& drive, const DriveEntry& earlier,
                          const TomlTable& table);
  static DriveTraffic TrafficOf(const DriveEntry& entry, const Config& config, double rate_hz);
  static OwnedDrive Simulate(const DriveEntry& entry, const Config& config,
                             const SimulatedMotorConfig& motor);
};

}  // namespace tumbler
