#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "firmware_interface/drives/drive.h"
#include "firmware_interface/drives/drive_protocol.h"
#include "firmware_interface/drives/drive_range.h"
#include "firmware_interface/drives/joint_map.h"

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
/// of 6 bytes (older bgkatz), 7 (newer: the seventh is bus voltage) or 8 (AK), packed before the
/// command is applied, also outside motor mode. A field of n bits covers [min, max] in 2^n - 1
/// steps.
///
/// Rounding. The well-known host code truncates, which biases every field by half a step towards
/// minus infinity: with the ranges below 1.9e-4 rad, 0.0122 rad/s (0.049 N m at kd = 4) and
/// 0.0044 N m. Here commands are rounded to nearest: no bias on average, at most half a step. A
/// range that is symmetric has an even number of codes and none for zero: a zero goes out as half a
/// step up (+1.9e-4 rad, +0.0122 rad/s, +0.0044 N m); kp = kd = 0 is exact. Drives truncate their
/// replies, so decoded values are on average half a step low.
///
/// Wrap. Drives do not clamp their replies: beyond the range, position reappears at the other end.
/// MitDrive follows it across while the setpoints are followed: of two positions that one reply can
/// mean, the one nearer to the last is taken. Before that the range is taken at its word, so keep
/// the joint's travel inside it by the choice of `JointMap::zero_offset_rad`.
///
/// Watchdog. A drive that hears no setpoint for its time-out (25 ms by default, may be off) sets
/// gains and feed-forward to zero, and resumes by itself with the next setpoint. Clones differ: try
/// it on the bench.

/// Largest magnitude of a range's end; beyond it the arithmetic of codes could overflow.
inline constexpr float kMitLargest = 1e6F;

/// What a field can carry. Ranges of position, velocity and torque contain zero; gains start at
/// exactly zero.
using MitRange = DriveRange;

/// Ranges compiled into the drive's firmware. They differ between models, firmware versions and
/// published tables; verify them on the bench: with wrong ranges a drive obeys, scaled.
struct MitRanges {
  MitRange position_rad{-12.5F, 12.5F};
  MitRange velocity_rad_s{-50.0F, 50.0F};
  MitRange kp_nm_per_rad{0.0F, 500.0F};
  MitRange kd_nm_s_per_rad{0.0F, 5.0F};
  MitRange torque_nm{-18.0F, 18.0F};
};

/// How a reply of 8 bytes carries temperature.
enum class MitTemperature : std::uint8_t {
  kSigned,    ///< two's complement, degrees Celsius
  kOffset40,  ///< degrees Celsius + 40
};

/// One drive.
struct MitConfig {
  /// 1 ... 255: the drive's CAN_ID. Replies name their sender in one byte.
  std::uint16_t command_id = 1;
  /// 0 ... 0x7ff: the drive's CAN_MASTER. Firmware defaults to 0 for every drive; drives send
  /// without retransmission, so replies that share an identifier are lost when they meet. Give each
  /// drive its own.
  std::uint16_t reply_id = 17;
  MitRanges command;
  MitRanges reply;  ///< kp and kd of it are not used. Newer bgkatz firmware has a wider torque
                    ///< range here.
  MitTemperature temperature = MitTemperature::kSigned;
  JointMap joint;

  /// @retval kInvalidArgument  an id is out of range, both ids are equal, a range is not as
  ///                           MitRange says, or the joint map is not valid.
  [[nodiscard]] Status Validate() const noexcept;
};

/// A command at the drive's shaft.
struct MitCommand {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float kp_nm_per_rad = 0;
  float kd_nm_s_per_rad = 0;
  float torque_nm = 0;
};

/// A reply at the drive's shaft.
struct MitReply {
  std::uint8_t sender = 0;  ///< low byte of the drive's command id
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;
  std::uint8_t size = 8;  ///< 6, 7 or 8 bytes; only 8 has the two that follow.
  float temperature_c = 0;
  std::uint8_t error = 0;  ///< AK: 1 over-temperature, 2 over-current, 3 over- and 4 under-voltage,
                           ///< 5 encoder, 6 phase
};

/// Frames that are commands by their value: seven bytes 0xff and one of these.
enum class MitMagic : std::uint8_t {
  kEnter = 0xfc,  ///< Into motor mode.
  kExit = 0xfd,   ///< Out of it; bgkatz firmware obeys once the current is below 1 A.
  kZero = 0xfe,   ///< Here is the encoder's zero; bgkatz firmware obeys outside motor mode only.
};

/// The code of `value` in `range`, clamped and rounded to nearest. `bits` is 12 or 16. NaN gives
/// the code of min.
[[nodiscard]] std::uint16_t MitQuantise(float value, const MitRange& range, int bits) noexcept;
/// The value of a code.
[[nodiscard]] float MitDequantise(std::uint16_t code, const MitRange& range, int bits) noexcept;

/// Packs (1), each field clamped to its range. The one pattern of a setpoint that would read as a
/// magic frame (all fields at their maximum, torque one to three steps below it) goes out with the
/// position one step lower.
[[nodiscard]] CanFrame EncodeMitCommand(const MitConfig& config,
                                        const MitCommand& command) noexcept;
/// Unpacks (1) as the drive does.
/// @retval kInvalidArgument  not a data frame of 8 bytes with the drive's command id, or a magic
/// frame.
Status DecodeMitCommand(const MitConfig& config, const CanFrame& frame,
                        MitCommand& command) noexcept;

/// Packs (2) with `reply.size` bytes as firmware does: truncating and unclamped, so that values
/// wrap (see above). For simulated drives.
[[nodiscard]] CanFrame EncodeMitReply(const MitConfig& config, const MitReply& reply) noexcept;
/// Unpacks (2). @retval kInvalidArgument  not a data frame of 6 ... 8 bytes with the drive's reply
/// id and sender.
Status DecodeMitReply(const MitConfig& config, const CanFrame& frame, MitReply& reply) noexcept;

[[nodiscard]] CanFrame MitMagicFrame(const MitConfig& config, MitMagic magic) noexcept;
/// Whether the frame is a magic one of this drive, and which.
[[nodiscard]] bool DecodeMitMagic(const MitConfig& config, const CanFrame& frame,
                                  MitMagic& magic) noexcept;

/// Host side of one MIT drive. One frame a tick, always.
///
/// kDisable and kClearErrors send kExit each tick: the protocol has no order to clear an error.
/// kEnable runs the start-up sequence, one frame a tick:
///   1. one neutral setpoint (no gains, no feed-forward, measured position): firmware keeps the
///      last setpoint it heard and would act on it as it enters motor mode;
///   2. kEnter, until replies were decoded in two ticks since the first of them;
///   3. a neutral setpoint, until a reply was decoded;
///   4. the setpoints.
///
/// Replies do not say in which mode a drive is, so states are inferred: kEnabled from steps 2 and
/// 3, kDisabled from replies in two ticks since the first kExit. Two, because the first may be the
/// late answer to the frame before. A drive that restarts by itself while enabled cannot be told
/// from an enabled one; its following error can. kFault is reported while the latest reply carries
/// an error code; frames go out as requested all the same, since only the executor knows whether
/// cutting the torque now is the safe reaction. A setpoint that is not finite disables; it is not
/// looked at with kDisable.
class MitDrive final : public Drive {
 public:
  /// @pre config.Validate() is kOk; otherwise every Encode returns kInvalidArgument and sends
  /// nothing.
  explicit MitDrive(const MitConfig& config) noexcept;

  Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                FrameBatch& batch) noexcept override;
  bool Decode(const CanFrame& frame) noexcept override;

  /// After a magic or neutral frame: the measured position, everything else zero.
  [[nodiscard]] DriveSetpoint encoded_setpoint() const noexcept override { return encoded_; }
  [[nodiscard]] DriveFeedback feedback() const noexcept override { return feedback_; }
  [[nodiscard]] DriveState state() const noexcept override;
  [[nodiscard]] const MitConfig& config() const noexcept { return config_; }

 private:
  enum class Stage : std::uint8_t { kStart, kExit, kClear, kEnter, kNeutral, kFollow };
  static constexpr int kCertainTicks = 2;  // answered, before a magic frame counts as obeyed

  void NextStage(bool enable) noexcept;
  void GoTo(Stage stage) noexcept;
  [[nodiscard]] int answered_ticks() const noexcept;
  [[nodiscard]] DriveState Inferred() const noexcept;
  [[nodiscard]] MitCommand ToCommand(const DriveSetpoint& setpoint) const noexcept;
  CanFrame EncodeSetpoint(const DriveSetpoint& setpoint) noexcept;

  // Position, velocity, torque and one more lane side by side: operations that the compiler can do
  // at once. The fourth is idle in commands and the temperature in replies.
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
  static LaneRange MakeRange(const MitRanges& ranges) noexcept;
  [[nodiscard]] Lanes ToJoint(const LaneRange& range,
                              const std::array<std::int32_t, 4>& codes) const noexcept;

  MitConfig config_;
  LaneMap map_;
  LaneRange command_range_;
  LaneRange reply_range_;
  bool valid_;
  Stage stage_ = Stage::kStart;
  DriveState before_exit_ = DriveState::kUnknown;
  int answered_ticks_ =
      0;  // ticks with a reply since the stage's first frame, up to the last Encode
  bool answered_ = false;           // a reply since the last Encode
  bool heard_ = false;              // a reply ever
  std::int32_t position_code_ = 0;  // of the last reply, beyond 16 bits where it has wrapped
  DriveFeedback feedback_;
  // Gains hardly ever change: those of the last setpoint, as asked, as codes and as the drive sees
  // them.
  struct Gains {
    float kp_nm_per_rad = 0, kd_nm_s_per_rad = 0;
    std::uint16_t kp_code = 0, kd_code = 0;
    float kp_encoded_nm_per_rad = 0, kd_encoded_nm_s_per_rad = 0;
  };
  Gains gains_;
  DriveSetpoint encoded_;
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

  static Config Example(int joint) noexcept {
    Config config;
    config.command_id = static_cast<std::uint16_t>(joint + 1);
    config.reply_id = static_cast<std::uint16_t>(joint + 17);
    return config;
  }
  static ShaftRanges CommandRanges(const Config& config) noexcept {
    return {config.command.position_rad, config.command.velocity_rad_s, config.command.torque_nm};
  }
  static DriveRange ReportedPositions(const Config& config) noexcept {
    return config.reply.position_rad;
  }
  static bool CommandedPosition(const Config& config, const CanFrame& frame,
                                double& shaft_rad) noexcept;
  static bool ReportedPosition(const Config& config, const CanFrame& frame,
                               double& shaft_rad) noexcept;

  static Config Read(DriveTable& table);
  static DriveTraffic TrafficOf(const DriveEntry& entry, const Config& config, double rate_hz);
  static OwnedDrive Simulate(const DriveEntry& entry, const Config& config,
                             const SimulatedMotorConfig& motor);
};

}  // namespace tumbler
