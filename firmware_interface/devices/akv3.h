#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware_interface/devices/configured_drive.h"
#include "firmware_interface/devices/drive_protocol.h"
#include "firmware_interface/devices/impedance.h"
#include "firmware_interface/devices/joint_map.h"

namespace tumbler {

/// The protocol of CubeMars (T-Motor) AK drives with V3 firmware, `force control`, host side and
/// codec.
///
/// Classic CAN at 1 Mbit/s. Identifiers have 29 bits: `function << 8 | drive id`. The host sends
/// 8 bytes with function 8, most significant bit first,
///
///   kp 12 | kd 12 | position 16 | velocity 12 | torque 12 (1)
///
/// and the drive applies torque = kp (position - q) + kd (velocity - qdot) + torque. By its own
/// clock, 500 times a second at most, it reports 8 bytes with function 0x29,
///
///   position 16, 0.1 degrees | speed 16, 10 ERPM | current 16, 0.01 A | temperature 8 | error 8
///   (2)
///
/// as integers with sign, the most significant byte first; the error has no sign. ERPM are turns a
/// minute times pole pairs, of the motor before its gear.
///
/// Codes. A field of n bits covers [min, max) in 2^n steps, as the manual's code has it: the middle
/// of a symmetric range is exactly zero, and `max` goes out as one step less. Some hosts count
/// 2^n - 1 steps; between the two lies one step at most. Here values are rounded to nearest.
///
/// There is no mode to enter or leave, and no order that clears errors: a setpoint without gains
/// and torque is torque off. Nothing here was tried on hardware; docs/protocols/akv3.md names the
/// sources.

/// Functions of identifiers. From 0 to 8 they are commands: 0 duty, 1 current, 2 brake, 3 speed, 4
/// position, 5 origin, 6 position and speed.
inline constexpr std::uint32_t kAkV3SetpointFunction = 0x08;
inline constexpr std::uint32_t kAkV3StatusFunction = 0x29;

/// Ranges of setpoints of an AK80-9. Velocity and torque differ between models.
inline constexpr ImpedanceRanges kAkV3Ranges = {
    {-12.56F, 12.56F}, {-65.0F, 65.0F}, {0.0F, 500.0F}, {0.0F, 5.0F}, {-18.0F, 18.0F}};

/// One drive.
struct AkV3Config {
  std::uint8_t node_id = 1;  ///< The drive's CAN ID.
  ImpedanceRanges range = kAkV3Ranges;
  int pole_pairs = 21;      ///< 1 ... 100, of the motor.
  float gear_inside = 9;    ///< 0.1 ... 1000: turns of the motor per turn of the shaft.
  double status_s = 0.002;  ///< 0.002 ... 0.1: period of the reports that the drive is set to.
  /// >= 0: torque at the shaft per ampere reported. 0: the torque is not known, e.g. where the
  /// current comes without its sign; it is reported as zero.
  float torque_constant_nm_per_a = 0;
  /// The most reports that may come in one tick, >= 1: those of `status_s`, and one for the drift
  /// of the drive's clock.
  int status_per_tick_max = 2;
  JointMap joint;

  /// @retval kInvalidArgument  a value is outside what its comment allows, a range of motion does
  ///                           not contain zero, or one of a gain does not begin there.
  [[nodiscard, gnu::cold]] Status Validate() const noexcept;
};

/// A report in the units of the wire.
struct AkV3Status {
  std::int16_t position = 0;    ///< 0.1 degrees of the shaft
  std::int16_t speed = 0;       ///< 10 ERPM
  std::int16_t current = 0;     ///< 0.01 A
  std::int8_t temperature = 0;  ///< degrees Celsius
  /// 0: none. 1 motor too hot, 2 over-current, 3 over-voltage, 4 under-voltage, 5 encoder, 6
  /// transistors too hot, 7 motor stalled.
  std::uint8_t error = 0;
};

[[nodiscard]] constexpr std::uint32_t AkV3Id(std::uint32_t function, std::uint8_t drive) noexcept {
  return function << 8 | drive;
}

/// The code of `value` in `range`, clamped and rounded to nearest; NaN gives the code of min.
/// @param bits  12 or 16.
[[nodiscard]] std::uint16_t AkV3Quantise(float value, const DriveRange& range, int bits) noexcept;
/// The value of a code.
[[nodiscard]] float AkV3Dequantise(std::uint16_t code, const DriveRange& range, int bits) noexcept;

/// Packs (1), with each field clamped to its range. It always has 8 bytes: a drive would read
/// missing ones as zeros, which are ends of ranges.
[[nodiscard]] CanFrame EncodeAkV3Command(const AkV3Config& config,
                                         const ImpedanceCommand& command) noexcept;
/// @retval kInvalidArgument  no data frame of 8 bytes that is a setpoint for this drive; `command`
/// is unchanged.
Status DecodeAkV3Command(const AkV3Config& config, const CanFrame& frame,
                         ImpedanceCommand& command) noexcept;

/// Packs (2), for simulated drives.
[[nodiscard]] CanFrame EncodeAkV3Status(const AkV3Config& config,
                                        const AkV3Status& status) noexcept;
/// @retval kInvalidArgument  no data frame of 8 bytes that is a report of this drive; `status` is
/// unchanged.
Status DecodeAkV3Status(const AkV3Config& config, const CanFrame& frame,
                        AkV3Status& status) noexcept;

/// Host side of one drive. It sends one frame in every tick.
///
/// kDisable and kClearErrors send a setpoint without gains and torque. kEnable
///   1. sends the same until reports have come in four ticks;
///   2. holds the drive where it reported to stand, with the gains asked for, until they have come
///      in four more. A single report may have been sent before the order; and were the host's
///      frames not going out, its queue would be full by then, which is a fault;
///   3. sends the setpoints.
///
/// Reports do not say whether a drive obeys, so the state is inferred from the host's orders, and
/// from whether reports come: a drive that ignores setpoints looks like an enabled one until its
/// following error shows the difference. kFault is reported while the latest report carries an
/// error. Frames still go out as requested then, since only the executor knows whether cutting the
/// torque is the safe reaction. A setpoint that is not finite takes the torque away.
class AkV3Drive final : public ConfiguredDrive<AkV3Config> {
 public:
  /// @pre config.Validate() is kOk; otherwise every Encode returns kInvalidArgument and sends
  /// nothing.
  explicit AkV3Drive(const AkV3Config& config) noexcept;

  Status Encode(DriveRequest request, const DriveSetpoint& setpoint,
                FrameBatch& batch) noexcept override;
  bool Decode(const CanFrame& frame) noexcept override;
  [[nodiscard]] bool IsCommand(const CanFrame& frame) const noexcept override;

  [[nodiscard]] DriveState state() const noexcept override;
  [[nodiscard]] ReplyRhythm reply_rhythm() const noexcept override {
    return {false, config_.status_per_tick_max};
  }

 private:
  enum class Stage : std::uint8_t { kOff, kBegin, kHold, kFollow };
  static constexpr int kCertainTicks = 4;  // ticks with a report after which a stage is over
  /// One field of a setpoint between the joint and the wire, and back:
  /// code = value * to_code + zero_code, value = code * to_value + value_of_zero.
  struct Field {
    float to_code = 0, zero_code = 0, top = 0, to_value = 0, value_of_zero = 0;
  };

  void NextStage(bool enable) noexcept;
  [[nodiscard]] bool IsCertain() const noexcept {
    return answered_ticks_ + (answered_ ? 1 : 0) >= kCertainTicks;
  }
  /// The field of the joint's values, where `ratio` converts a joint's value to the shaft's after
  /// `zero` was taken away.
  static Field MakeField(const DriveRange& range, int bits, float ratio, float zero) noexcept;
  static std::uint32_t CodeOf(const Field& field, float value) noexcept;
  static float ValueOf(const Field& field, std::uint32_t code) noexcept;
  CanFrame EncodeSetpoint(const DriveSetpoint& setpoint) noexcept;
  CanFrame EncodeOff() noexcept;

  Field position_, velocity_, torque_, kp_, kd_;
  float position_step_ = 0, velocity_step_ = 0, torque_step_ = 0;  // of reports, at the joint
  Stage stage_ = Stage::kOff;
  int answered_ticks_ = 0;  // ticks with a report since the stage began, up to the last Encode
  bool answered_ = false;   // whether a report has come since the last Encode
  bool heard_ = false;      // whether one ever came
  float hold_rad_ = 0;
  // The gains of the last setpoint and their code on the wire. They are kept, because gains hardly
  // ever change.
  float kp_asked_ = 0, kd_asked_ = 0;
  std::uint64_t gains_word_ = 0;
  float kp_encoded_ = 0, kd_encoded_ = 0;
};

/// The description of the protocol; see drive_protocol.h.
struct AkV3Protocol {
  using Config = AkV3Config;
  using Host = AkV3Drive;
  static constexpr std::string_view kName = "ak-v3";
  static constexpr std::string_view kId = "akv3";
  static constexpr std::string_view kExample = "tumbler_drives_akv3.toml";
  static constexpr std::string_view kDbc = "cubemars_ak_v3.dbc";
  static constexpr int kFirstReply_ms = 500;
  static constexpr bool kCarriesGains = true;

  static Config Example(int joint) noexcept { return OfNode<Config>(joint + 1); }
  static ShaftRanges CommandRanges(const Config& config) noexcept { return config.range.Shaft(); }
  static DriveRange ReportedPositions(const Config& /*config*/) noexcept {
    constexpr float kEnd_rad = 55.8505F;  // 3200 degrees
    return {-kEnd_rad, kEnd_rad};
  }
  static bool CommandedPosition(const Config& config, const CanFrame& frame,
                                double& shaft_rad) noexcept;
  static bool ReportedPosition(const Config& config, const CanFrame& frame,
                               double& shaft_rad) noexcept;
  static bool SamplesAt(const Config& /*config*/, const CanFrame& /*frame*/) noexcept {
    return false;  // Reports are cyclic.
  }
  static std::span<const HostFrame> HostFrames(const Config& config) noexcept;
  /// The name of an error, or null.
  static const char* ErrorName(std::uint32_t error) noexcept;

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
