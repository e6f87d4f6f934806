#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "common/core/status.h"
#include "firmware_interface/devices/inertial_sensor.h"

namespace tumbler {

class TomlTable;
struct KeyRow;  // common/files/key_table.h

/// Identifiers of an Xsens MTi's messages, 11 bits each, as set in the sensor.
struct XsensMtiConfig {
  std::uint16_t quaternion_id = 0x021;
  std::uint16_t rate_id = 0x032;
  std::uint16_t time_id = 0x005;
  /// @retval kInvalidArgument  an identifier has more than 11 bits, or two are the same.
  [[nodiscard]] Status Validate() const noexcept;
};

/// An Xsens MTi on CAN, with these messages (numbers are big-endian):
///
///   quaternion   4 x int16, / 32767          w, x, y, z
///   rate of turn 3 x int16, / 512            rad/s
///   sample time  uint32                      100 us
class XsensMti final : public InertialSensor {
 public:
  static constexpr float kQuaternionStep = 1.0F / 32767;
  static constexpr float kRateStep_rad_s = 1.0F / 512;
  static constexpr std::uint8_t kQuaternionBytes = 8;
  static constexpr std::uint8_t kRateBytes = 6;
  static constexpr std::uint8_t kTimeBytes = 4;

  /// @pre the configuration is valid.
  explicit XsensMti(const XsensMtiConfig& config = {}) noexcept { Configure(config); }
  /// Starts anew with this configuration. @pre it is valid.
  void Configure(const XsensMtiConfig& config) noexcept;

  InertialPart Decode(const CanFrame& frame) noexcept override;

 private:
  enum Id : std::size_t { kQuaternion, kRate, kTime };  ///< Of `ids_`.
  std::uint64_t quaternion_ = 0;                        ///< The last payloads.
  std::uint64_t rate_ = 0;
  bool same_quaternion_ = false;
};

/// Its description (sensor_protocols.h).
struct XsensMtiProtocol {
  using Config = XsensMtiConfig;
  using Host = XsensMti;
  static constexpr std::string_view kName = "xsens-mti";

  [[nodiscard]] static std::array<SensorMessage, 3> Messages(const Config& config) noexcept;
  [[nodiscard]] static std::array<CanFrame, 3> Frames(const Config& config,
                                                      const SensorReport& report) noexcept;
  [[nodiscard]] static Config Read(TomlTable& table);
  [[nodiscard]] static std::vector<KeyRow> Rows();
};

/// The frames of the sensor's side. Values are rounded, and saturated at the ends of the wire.
/// @param attitude  w, x, y, z.
[[nodiscard]] CanFrame XsensQuaternionFrame(const XsensMtiConfig& config,
                                            const std::array<double, 4>& attitude) noexcept;
[[nodiscard]] CanFrame XsensRateFrame(const XsensMtiConfig& config,
                                      const std::array<double, 3>& rate_rad_s) noexcept;
[[nodiscard]] CanFrame XsensTimeFrame(const XsensMtiConfig& config, std::uint32_t time) noexcept;

}  // namespace tumbler
