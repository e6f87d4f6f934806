#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "common/core/default_drives.h"
#include "firmware_interface/devices/configured_drive.h"
#include "firmware_interface/devices/drive_protocol.h"
#include "firmware_interface/devices/impedance.h"
#include "firmware_interface/devices/joint_map.h"

namespace tumbler {

/// The `MIT mini-cheetah` protocol, host side and codec: bgkatz/motorcontrol, T-Motor AK in MIT
/// mode, and clones.
///
/// Classic CAN at 1 Mbit/s, 11-bit identifiers. The host sends 8 bytes, most significant bit first,
///
///   position 16 | velocity 12 | kp 12 | kd 12 | torque 12 (1)
///
/// and the drive applies torque = kp (position - q) + kd (velocity - qdot) + torque. It answers
/// each frame with
///
///   sender's id 8 | position 16 | velocity 12 | torque 12 [| temperature 8 | error 8] (2)
///
/// of 6 bytes (older bgkatz), 7 (newer: the seventh is bus voltage) or 8 (AK). The reply tells the
/// state before the command was applied. Drives also reply outside motor mode. A field of n bits
/// covers [min, max] in 2^n - 1 steps.
///
/// Rounding. The well-known host code truncates, which biases every field by half a step towards
/// minus infinity: with the ranges below by 1.9e-4 rad, 0.0122 rad/s (0.049 N m at kd = 4) and
/// 0.0044 N m. Here commands are rounded to nearest, with no bias on average and at most half a
/// step of error. A symmetric range has an even number of codes and none for zero: a zero goes out
/// as half a step up (+1.9e-4 rad, +0.0122 rad/s, +0.0044 N m). kp = kd = 0 is exact. Drives
/// truncate their replies, so decoded values are half a step low on average.
///
/// Wrap. Drives do not clamp their replies: beyond the range, the position reappears at the other
/// end. While the setpoints are followed, MitDrive follows the position across the end: of two
/// positions that one reply can mean, it takes the one nearer to the last. Before that it takes the
/// position within the range. So keep the joint's travel inside the range by the choice of
/// `JointMap::zero_offset_rad`.
///
/// Watchdog. A drive that hears no setpoint for its time-out (25 ms by default, may be off) sets
/// gains and feed-forward to zero, and resumes by itself with the next setpoint. Clones differ: try
/// it on the bench.

/// Ranges of bgkatz firmware and of an AK80-9.
inline constexpr ImpedanceRanges kMitRanges = {
    {-kDefaultDrives.position_rad, kDefaultDrives.position_rad},
    {-kDefaultDrives.velocity_rad_s, kDefaultDrives.velocity_rad_s},
    {0.0F, kDefaultDrives.kp_nm_per_rad},
    {0.0F, kDefaultDrives.kd_nm_s_per_rad},
    {-kDefaultDrives.torque_nm, kDefaultDrives.torque_nm}};

/// The rate at which bgkatz firmware computes its torque: in every interrupt of its PWM timer, of
/// 25 us (DT in Core/Inc/hw_config.h, run_fsm in Core/Src/fsm.c of github.com/bgkatz/motorcontrol).
/// Neither T-Motor nor Damiao state theirs.
inline constexpr double kMitFirmwareLoop_hz = 40'000;

/// Whose firmware it is, where firmwares differ in what they reply.
enum class MitDialect : std::uint8_t {
  kMiniCheetah,  ///< bgkatz, T-Motor AK and clones: replies as in (2).
  /// Damiao: byte 0 of replies is `status 4 | low bits of the id 4`, bytes 6 and 7 are the
  /// temperatures of transistors and rotor. Status 0 is disabled, 1 enabled, and from 8 on an error
  /// (8 over-voltage, 9 under-voltage, 10 over-current, 11 transistors too hot, 12 rotor too hot,
  /// 13 lost communication, 14 overload). The last byte 0xfb clears errors.
  kDamiao,
};

/// How a reply of 8 bytes carries temperature.
enum class MitTemperature : std::uint8_t {
  kSigned,    ///< Degrees Celsius in two's complement.
  kOffset40,  ///< Degrees Celsius + 40.
};

/// One drive.
struct MitConfig {
  /// 1 ... 255: the drive's CAN_ID. Replies name their sender in one byte.
  std::uint16_t command_id = 1;
  /// 0 ... 0x7ff: the drive's CAN_MASTER. Firmware has 0 for every drive by default. Drives send
  /// without retransmission, so replies that share an identifier are lost when they meet: give each
  /// drive its own. Some AK firmware answers on the drive's own `command_id` instead: replies are
  /// told from commands of somebody else by their first byte.
  std::uint16_t reply_id = 17;
  MitDialect dialect = MitDialect::kMiniCheetah;
  ImpedanceRanges command = kMitRanges;
  /// Ranges of replies; kp and kd are not used. Newer bgkatz firmware has a wider torque range
  /// here.
  ImpedanceRanges reply = kMitRanges;
  MitTemperature temperature_encoding = MitTemperature::kSigned;
  JointMap joint;

  /// @retval kInvalidArgument  an id is out of range, a range is not as ImpedanceRanges::AreValid
  /// says, or the
  ///                           joint map is not valid.
  [[nodiscard, gnu::cold]] Status Validate() const noexcept;
};

/// A reply at the drive's shaft.
struct MitReply {
  std::uint8_t sender = 0;  ///< Low byte of the drive's command id.
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;
  bool enabled = true;  ///< Whether the drive says that it is; only Damiao's replies can deny it.
  /// Bytes of the frame, 6, 7 or 8. Only a frame of 8 has the two values that follow.
  std::uint8_t size = 8;
  float temperature_c = 0;
  /// 0: none. Of AK drives: 1 over-temperature, 2 over-current, 3 over-voltage, 4 under-voltage, 5
  /// encoder, 6 phase. Of Damiao: the status from 2 on.
  std::uint8_t error = 0;
};

/// The last byte of frames that are commands by their value; seven bytes 0xff come before it.
enum class MitMagic : std::uint8_t {
  kEnter = 0xfc,  ///< Enter motor mode.
  kExit = 0xfd,   ///< Leave motor mode. bgkatz firmware obeys once the current is below 1 A.
  kClear = 0xfb,  ///< Forget errors; Damiao only.
  kZero = 0xfe,   ///< Zero the encoder here. bgkatz firmware obeys outside motor mode only.
};

/// The code of `value` in `range`, clamped and rounded to nearest; NaN gives the code of min.
/// @param bits  12 or 16.
[[nodiscard]] std::uint16_t MitQuantise(float value, const DriveRange& range, int bits) noexcept;
/// The value of a code.
[[nodiscard]] float MitDequantise(std::uint16_t code, const DriveRange& range, int bits) noexcept;

/// Packs (1), with each field clamped to its range. One pattern of a setpoint would read as a magic
/// frame (all fields at their maximum, torque one to three steps below it): it goes out with the
/// position one step lower.
[[nodiscard]] CanFrame EncodeMitCommand(const MitConfig& config,
                                        const ImpedanceCommand& command) noexcept;
/// Unpacks (1) as the drive does.
/// @retval kInvalidArgument  no data frame of 8 bytes with the drive's command id, or a magic
/// frame.
Status DecodeMitCommand(const MitConfig& config, const CanFrame& frame,
                        ImpedanceCommand& command) noexcept;

/// Packs (2) with `reply.size` bytes as firmware does, for simulated drives: truncated and not
/// clamped, so that values wrap (see above).
[[nodiscard]] CanFrame EncodeMitReply(const MitConfig& config, const MitReply& reply) noexcept;
/// Unpacks (2). @retval kInvalidArgument  not a data frame of 6 ... 8 bytes with the drive's reply
/// id and sender.
Status DecodeMitReply(const MitConfig& config, const CanFrame& frame, MitReply& reply) noexcept;

[[nodiscard]] CanFrame MitMagicFrame(const MitConfig& config, MitMagic magic) noexcept;
/// Whether the frame is a magic one of this drive, and which.
[[nodiscard]] bool DecodeMitMagic(const MitConfig& config, const CanFrame& frame,
                                  MitMagic& magic) noexcept;

/// Host side of one MIT drive. It sends one frame in every tick.
///
/// kDisable and kClearErrors send kExit each tick, since the protocol has no order to clear an
/// error; kClearErrors sends kClear to Damiao's drives. kEnable runs the start-up sequence, one
/// frame a tick:
///   1. one neutral setpoint (no gains, no feed-forward, measured position), because firmware keeps
///      the last setpoint that it heard and would act on it as it enters motor mode;
///   2. kEnter, until replies were decoded in two ticks since the first of them;
///   3. a neutral setpoint, until a reply was decoded;
///   4. the setpoints.
///
/// Replies do not say in which mode a drive is, so the state is inferred: kEnabled from steps 2 and
/// 3, kDisabled from replies in two ticks since the first kExit. It takes two, because the first
/// may be the late answer to the frame before. A drive that restarts by itself while enabled looks
/// like an enabled one; its following error shows the difference. Damiao's drives say whether they
/// are enabled: then step 2 ends when they do, and one that says no later has dropped out. kFault
/// is reported while the latest reply carries an error code. Frames still go out as requested then,
/// since only the executor knows whether cutting the torque is the safe reaction. A setpoint that
/// is not finite disables the motor; with kDisable the setpoint does not matter.
class MitDrive final : public ConfiguredDrive<MitConfig> {
 public:
  /// @pre config.Validate() is kOk; otherwise every Encode returns kInvalidArgument and sends
  /// nothing.
  explicit MitDrive(const MitConfig& config) noexcept;

  Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                FrameBatch& batch) noexcept override;
  bool Decode(const CanFrame& frame) noexcept override;
  [[nodiscard]] bool IsCommand(const CanFrame& frame) const noexcept override;

  [[nodiscard]] DriveState state() const noexcept override;

 private:
  enum class Stage : std::uint8_t { kStart, kExit, kClear, kEnter, kNeutral, kFollow };
  static constexpr int kCertainTicks = 2;  // answered ticks after which a magic frame was obeyed

  void NextStage(bool enable) noexcept;
  void GoTo(Stage stage) noexcept;
  [[nodiscard]] int answered_ticks() const noexcept;
  [[nodiscard]] DriveState Inferred() const noexcept;
  [[nodiscard]] ImpedanceCommand ToCommand(const DriveSetpoint& setpoint) const noexcept;
  CanFrame EncodeSetpoint(const DriveSetpoint& setpoint) noexcept;

  // Position, velocity, torque and one more lane side by side, so that the compiler can work on all
  // of them at once. The fourth is idle in commands and the temperature in replies.
  using Lanes = std::array<float, 4>;

  // JointMap by lanes, with the same roundings:
  //   drive = (joint - zero) * to_drive / over_drive, joint = drive * to_joint / over_joint + zero,
  // where a divisor that JointMap does not have is one and a zero is negative: x + -0 is x.
  struct LaneMap {
    Lanes zero, to_drive, over_drive, to_joint, over_joint;
  };
  struct LaneRange {
    Lanes min, max, width, top;
  };
  static LaneMap MakeMap(const JointMap& joint) noexcept;
  static LaneRange MakeRange(const ImpedanceRanges& ranges) noexcept;
  [[nodiscard]] Lanes ToJoint(const LaneRange& range,
                              const std::array<std::int32_t, 4>& codes) const noexcept;

  LaneMap map_;
  LaneRange command_range_;
  LaneRange reply_range_;
  Stage stage_ = Stage::kStart;
  DriveState before_exit_ = DriveState::kUnknown;
  // Ticks with a reply since the stage's first frame, up to the last Encode.
  int answered_ticks_ = 0;
  bool answered_ = false;           // whether a reply has come since the last Encode
  bool heard_ = false;              // whether a reply ever came
  bool says_enabled_ = true;        // the last reply; without Damiao's always
  std::int32_t position_code_ = 0;  // of the last reply, beyond 16 bits where it has wrapped
  // The gains of the last setpoint: as asked, as codes and as the drive sees them. They are kept,
  // because gains hardly ever change.
  struct Gains {
    float kp_nm_per_rad = 0, kd_nm_s_per_rad = 0;
    std::uint16_t kp_code = 0, kd_code = 0;
    float kp_encoded_nm_per_rad = 0, kd_encoded_nm_s_per_rad = 0;
  };
  Gains gains_;
};

/// The description of the protocol; see drive_protocol.h.
struct MitProtocol {
  using Config = MitConfig;
  using Host = MitDrive;
  static constexpr std::string_view kName = "mit";
  static constexpr std::string_view kId = "mit";
  static constexpr std::string_view kExample = "tumbler_drives.toml";
  static constexpr std::string_view kDbc = "mit_mini_cheetah.dbc";
  static constexpr int kFirstReply_ms = 500;
  static constexpr bool kCarriesGains = true;

  static Config Example(int joint) noexcept {
    Config config;
    config.command_id = static_cast<std::uint16_t>(joint + 1);
    config.reply_id = static_cast<std::uint16_t>(joint + 17);
    return config;
  }
  static ShaftRanges CommandRanges(const Config& config) noexcept { return config.command.Shaft(); }
  static DriveRange ReportedPositions(const Config& config) noexcept {
    return config.reply.position_rad;
  }
  static bool CommandedPosition(const Config& config, const CanFrame& frame,
                                double& shaft_rad) noexcept;
  static bool ReportedPosition(const Config& config, const CanFrame& frame,
                               double& shaft_rad) noexcept;
  static bool SamplesAt(const Config& config, const CanFrame& frame) noexcept {
    return !frame.extended && !frame.remote && frame.id == config.command_id;
  }
  static std::span<const HostFrame> HostFrames(const Config& config) noexcept;

  static Config Read(DriveTable& table);
  static KeyTable Keys();
  static std::uint32_t DbcId(std::uint32_t of_example, const Config& config);
  static DbcLine DbcSignal(std::string_view message, std::string_view signal, std::string_view line,
                           const Config& config);
  static DriveTraffic TrafficOf(const DriveEntry& entry, const Config& config, double rate_hz);
  static OwnedDrive Simulate(const DriveEntry& entry, const Config& config,
                             const SimulatedMotorConfig& motor);
};

}  // namespace tumbler
