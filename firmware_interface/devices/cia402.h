#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/canopen.h"
#include "firmware_interface/devices/configured_drive.h"
#include "firmware_interface/devices/drive_protocol.h"
#include "firmware_interface/devices/drive_range.h"
#include "firmware_interface/devices/joint_map.h"

namespace tumbler {

/// CiA 402 drives in cyclic synchronous position (CSP) over CANopen: codec and host side.
///
/// The host's SYNC begins every tick. At a SYNC the drive acts on the setpoint that it received
/// since the SYNC before, interpolates towards it for one period, and reports its position. So a
/// setpoint takes effect one tick after it was sent, at a moment that does not depend on the load
/// of the bus, and a measurement comes back within the tick of its SYNC.
///
///   RPDO1  controlword 16 | target position 32      every tick
///   RPDO2  velocity offset 32 | torque offset 16    every tick, with `feed_forward`
///   TPDO1  statusword 16 | position actual 32       every SYNC
///   TPDO2  velocity actual 32 | torque actual 16    every `status_every`-th SYNC
///
/// Units are the drive's: positions in increments, torques in thousandths of the rated torque.
/// Numbers are rounded to nearest and saturate; none wraps.
///
/// Watchdog. Encode sends the host's heartbeat, every third of `watchdog_ms`, and the drive watches
/// it. Object 6007h decides what the drive does when it stops.

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
/// The state in a statusword; kNotReady for a pattern that is no state.
[[nodiscard]] Cia402State StateOf(std::uint16_t statusword) noexcept;
/// A statusword with the bits of this state, and no other.
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

/// Bit of the statusword in CSP.
inline constexpr std::uint16_t kCia402FollowingError = 1U << 13;
/// Mode of operation (6060h, 6061h).
inline constexpr std::int8_t kCia402Csp = 8;

/// Objects of the set-up without which a drive can be driven. Bit i of `Cia402Config::may_lack` is
/// object i. Without 1006h and 60C2h the drive has to know the loop's period by other means,
/// without 605Ah it brakes as it was built, without 6065h it has its own following window, and
/// without 6007h it does not react to the host's silence.
inline constexpr std::array<std::uint16_t, 5> kCia402MayLack = {0x1006, 0x60c2, 0x605a, 0x6065,
                                                                0x6007};

/// One drive.
struct Cia402Config {
  /// 1 ... 126.
  std::uint8_t node_id = 1;
  /// Number of the host's heartbeat, 1 ... 127; no drive's number.
  std::uint8_t host_id = 127;
  /// Whether this object sends SYNC and the host's heartbeat. Exactly one drive of a bus does;
  /// DriveBank sees to it.
  bool leader = true;
  /// Increments in a turn of the shaft, > 0 (607Ah, 6064h).
  float position_units_per_turn = 65536;
  /// Units of velocity in a turn of the shaft per second, > 0 (606Ch, 60B1h).
  float velocity_units_per_turn_s = 65536;
  /// > 0. Torques on the wire are thousandths of it (6071h, 6077h, 60B2h).
  float rated_torque_nm = 1;
  /// Has to fit 32 bits of position and velocity, and 16 bits of torque.
  ShaftRanges range;
  JointMap joint;
  /// Period of the control tick, 100 ... 100000: one that 60C2h can express.
  std::uint32_t period_us = 1000;
  /// Period of the drive's heartbeat (1017h), 1 ... 10000. After three silent ones the drive is
  /// lost.
  std::uint16_t heartbeat_ms = 100;
  /// Time-out for the host's heartbeat (1016h), 0 ... 10000. 0: the drive does not watch it.
  std::uint16_t watchdog_ms = 25;
  /// The drive's reaction to the time-out (6007h): 0 nothing, 1 fault, 2 disable voltage, 3 quick
  /// stop.
  std::int16_t watchdog_reaction = 1;
  /// How the drive brakes for a setpoint with kp = 0 (605Ah): after 5 or 6 it stands under control,
  /// after 1 or 2 the torque is off.
  std::int16_t quick_stop_option = 6;
  /// Whether RPDO2 carries velocity and torque offsets.
  bool feed_forward = true;
  /// SYNCs from one TPDO2 to the next, 1 ... 240.
  std::uint8_t status_every = 4;
  /// Objects of kCia402MayLack that the drive may not have: its answer that there is no such object
  /// is taken for an answer. 6007h only where `watchdog_ms` is 0.
  std::uint8_t may_lack = 0;
  /// The drive's following window at the shaft (6065h), >= 0. 0 leaves the drive's own.
  float following_window_rad = 0;

  /// @retval kInvalidArgument  a value is outside what its comment allows.
  [[nodiscard, gnu::cold]] Status Validate() const noexcept;
};

/// The content of 60C2h: period = value 10^exponent seconds.
struct Cia402Period {
  std::uint8_t value = 0;
  std::int8_t exponent = 0;
};
/// @retval kInvalidArgument  the period is not 1 ... 255 steps of a power of ten.
Status ToInterpolationPeriod(std::uint32_t period_us, Cia402Period& period) noexcept;

/// The objects that set a drive up, in their order.
/// @param step  number of the object, from 0 on.
/// @returns false past the last object.
bool Cia402SetUp(const Cia402Config& config, int step, SdoRequest& request) noexcept;

/// Host side of one drive.
///
/// First the drive is set up, whatever the request: NMT pre-operational, the objects of Cia402SetUp
/// one SDO at a time, NMT start, reading back the mode, until the drive reports. If it does not
/// answer within kAnswerTicks, the set-up begins anew. A refused object is a fault (error: the
/// abort code) until kClearErrors, unless the drive may lack it and says that it does. During the
/// set-up the drive gets RPDO1 with controlword 0, so that every tick writes it.
///
/// Then each tick sends RPDO1 and RPDO2:
///   - kDisable: controlword 0x0000, which takes the torque off in one step from any state;
///   - kEnable: once the drive was seen off, 0x06, 0x07, 0x0F as the statusword follows, with
///     target = measured position; then the setpoints. For kp = 0: quick stop;
///   - kClearErrors: 0x0000, then 0x0080 until the fault is gone or kResetTicks are over.
/// After a fault, a node state other than operational, a boot-up, or when the drive leaves
/// Operation Enabled, the host sends 0x0000 until the request has been kDisable.
///
/// The state is kFault in the fault state, after an EMCY that was not taken back, while the
/// following-error bit is set and the drive enabled (8611h), and after a refused set-up. It is
/// kLost when the drive's heartbeat has stopped: frames still go out as requested, and kClearErrors
/// begins the set-up anew.
class Cia402Drive final : public ConfiguredDrive<Cia402Config> {
 public:
  static constexpr int kAnswerTicks = 200;
  static constexpr int kResetTicks = 200;

  /// @pre config.Validate() is kOk; otherwise every Encode returns kInvalidArgument and sends
  /// nothing.
  explicit Cia402Drive(const Cia402Config& config) noexcept;

  Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                FrameBatch& batch) noexcept override;
  bool Decode(const CanFrame& frame) noexcept override;
  [[nodiscard]] bool IsCommand(const CanFrame& frame) const noexcept override;

  [[nodiscard]] DriveState state() const noexcept override { return state_; }
  [[nodiscard]] HeartbeatAge heartbeat() const noexcept override {
    return {heartbeat_age_, heartbeat_ticks_max_};
  }
  [[nodiscard]] SetUpRefusal set_up_refusal() const noexcept override {
    return link_ == Link::kRefused ? SetUpRefusal{refused_index_, refused_sub_, refusal_}
                                   : SetUpRefusal{};
  }

 private:
  enum class Link : std::uint8_t { kReset, kSetUp, kRefused, kStart, kReadMode, kRunning };
  enum class Follow : std::uint8_t { kOff, kWaitOff, kSequence, kFollow, kBrake, kTripped };

  [[nodiscard]] std::uint32_t FindError() const noexcept;
  [[nodiscard]] DriveState FindState() const noexcept;
  // To be called when anything has changed on which error and state depend.
  void Refresh() noexcept;
  [[nodiscard]] bool IsHeartbeatLost() const noexcept {
    return heartbeat_age_ > heartbeat_ticks_max_;
  }
  [[nodiscard]] bool IsSteady(const DriveSetpoint& setpoint) const noexcept;
  Status EncodeChange(DriveRequest request, const DriveSetpoint& setpoint,
                      FrameBatch& batch) noexcept;
  void AddCommon(FrameBatch& batch) noexcept;
  bool AddService(FrameBatch& batch) noexcept;
  void Restart() noexcept;
  void NextFollow(bool enable, bool brake) noexcept;
  [[nodiscard]] std::uint16_t Controlword() noexcept;
  void AddPdos(std::uint16_t controlword, const DriveSetpoint* setpoint,
               FrameBatch& batch) noexcept;
  void TakeReply(const SdoReply& reply) noexcept;

  // One multiplication each between joint and wire.
  float position_to_units_ = 1, position_to_rad_ = 1, velocity_to_units_ = 1,
        velocity_to_rad_s_ = 1, torque_to_units_ = 1, torque_to_nm_ = 1;
  DriveRange position_units_, velocity_units_, torque_units_;
  int heartbeat_ticks_max_ = 0;
  int host_heartbeat_ticks_ = 0;

  int host_heartbeat_due_ = 0;
  Link link_ = Link::kReset;
  int step_ = 0;
  bool waiting_ = false;  // whether the answer to the last service is still to come
  int wait_ticks_ = 0;
  std::uint32_t refusal_ = 0;
  std::uint16_t refused_index_ = 0;
  std::uint8_t refused_sub_ = 0;

  Follow follow_ = Follow::kOff;
  int reset_ticks_ = 0;  // ticks left of the attempt to reset a fault
  bool heard_ = false;   // whether a TPDO1 has come since the set-up
  int heartbeat_age_ = 0;
  std::int32_t position_ = 0;  // as the drive reported it
  std::uint16_t statusword_ = 0;
  Cia402State power_ = Cia402State::kNotReady;  // that of the statusword
  std::uint16_t emergency_ = 0;
  DriveState state_ = DriveState::kUnknown;
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
  static constexpr bool kCarriesGains = false;

  static Config Example(int joint) noexcept {
    Config config = OfNode<Config>(joint + 1);
    config.rated_torque_nm = 6;
    return config;
  }
  static ShaftRanges CommandRanges(const Config& config) noexcept { return config.range; }
  static DriveRange ReportedPositions(const Config& config) noexcept {
    return config.range.position_rad;  // 32 bits reach at least as far.
  }
  static bool CommandedPosition(const Config& config, const CanFrame& frame,
                                double& shaft_rad) noexcept;
  static bool ReportedPosition(const Config& config, const CanFrame& frame,
                               double& shaft_rad) noexcept;
  static bool SamplesAt(const Config& /*config*/, const CanFrame& frame) noexcept {
    return IsSync(frame);
  }
  static std::span<const HostFrame> HostFrames(const Config& config) noexcept;

  static Config Read(DriveTable& table);
  static KeyTable Keys();
  static void CheckBeside(const DriveEntry& drive, const DriveEntry& earlier,
                          const TomlTable& table);
  static std::uint32_t DbcId(std::uint32_t of_example, const Config& config);
  static DriveTraffic TrafficOf(const DriveEntry& entry, const Config& config, double rate_hz);
  static OwnedDrive Simulate(const DriveEntry& entry, const Config& config,
                             const SimulatedMotorConfig& motor);
};

}  // namespace tumbler
