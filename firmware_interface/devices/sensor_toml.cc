#include "firmware_interface/devices/sensor_toml.h"

#include <fmt/format.h>

#include <array>
#include <string_view>

#include "common/core/fixed_string.h"
#include "common/files/file_keys.h"

namespace tumbler {
namespace {

void ReadSensorProtocol(TomlTable& table, std::string_view key, SensorEntry& /*sensor*/) {
  if (!table.Has(key)) table.Fail(key, "is missing and has no default");
  table.Choice(key, SensorProtocols::kNames, "");
}

void ReadLink(TomlTable& table, std::string_view key, SensorEntry& sensor) {
  sensor.link = table.String(key);
  if (sensor.link.empty() || !FixedString<32>::fits(sensor.link))
    table.Fail(key, fmt::format("is '{}'; allowed: 1 to 32 bytes", sensor.link));
}

constexpr std::array kSensorHeadKeys = {
    KeyReadBy<SensorEntry>("protocol", ReadSensorProtocol, "").Schema("").Required(),
    KeyReadBy<SensorEntry>("link", ReadLink, "that carries the sensor, as in the URDF")
        .Schema(R"({"type": "string", "minLength": 1, "maxLength": 32})")
        .Required()
        .Allowed("1 to 32 bytes"),
};
constexpr std::array kSensorKeys = {
    KeyOf<&SensorEntry::rate_hz>("rate_hz", {10, 2000}, "of attitudes and rates of turn")
        .Default("that of the bus"),
    KeyOf<&SensorEntry::time_rate_hz>(
        "time_rate_hz", {0, 2000},
        "of sample times, by which late reports are noticed; 0: the sensor sends none"),
    KeyOf<&SensorEntry::mount_rpy_rad>(
        "mount_rpy_rad", {-6.3, 6.3},
        "roll, pitch and yaw of the sensor's frame in the link's, as in a URDF"),
    KeyOf<&SensorEntry::age_max_s>("age_max_s", {0, 1, true}, "an older report is stale")
        .Allowed("1.5 / `rate_hz` to 1"),
    KeyOf<&SensorEntry::frozen_after_s>(
        "frozen_after_s", {0, 10},
        "the same numbers for longer are implausible; 0: they never are"),
    KeyOf<&SensorEntry::tilt_max_rad>("tilt_max_rad", {0, 1.5, true},
                                      "a larger tilt out of the robot's plane is implausible"),
    KeyOf<&SensorEntry::rate_max_rad_s>(
        "rate_max_rad_s", {0, 64, true},
        "a faster turn is implausible; out of the plane, of a quarter of it"),
    KeyOf<&SensorEntry::jump_max_rad>(
        "jump_max_rad", {0, 3, true},
        "an attitude that parts further from the sum of the rates, of late, is implausible"),
    KeyOf<&SensorEntry::late_max_s>(
        "late_max_s", {0, 1, true},
        "later than the promptest report, by the sample times, and the report is stale"),
};

}  // namespace

SensorEntry ReadSensor(TomlTable& table, double loop_rate_hz) {
  SensorEntry sensor;
  sensor.rate_hz = loop_rate_hz;
  ReadKeys(table, kSensorHeadKeys, sensor);
  SensorProtocols::ForEach([&](auto protocol) {
    if (table.String("protocol") == decltype(protocol)::kName)
      sensor.config = decltype(protocol)::Read(table);
  });
  ReadKeys(table, kSensorKeys, sensor);
  if (sensor.age_max_s < 1.5 / sensor.rate_hz) {
    table.Fail("age_max_s",
               fmt::format("is {}; allowed: from {} (1.5 / rate_hz) ... 1",
                           MessageNumber(sensor.age_max_s), MessageNumber(1.5 / sensor.rate_hz)));
  }
  return sensor;
}

std::vector<KeyRow> SensorRows() {
  std::vector<KeyRow> rows = RowsOf(kSensorHeadKeys, "`[sensor]`");
  for (const std::string_view name : SensorProtocols::kNames) {
    rows[0].schema += fmt::format("{}\"{}\"", rows[0].schema.empty() ? "" : ", ", name);
    rows[0].allowed += fmt::format("{}`\"{}\"`", rows[0].allowed.empty() ? "" : ", ", name);
  }
  rows[0].schema = fmt::format(R"({{"enum": [{}]}})", rows[0].schema);
  SensorProtocols::ForEach([&rows](auto protocol) {
    rows = Joined({rows, decltype(protocol)::Rows()});
  });
  return Joined({rows, RowsOf(kSensorKeys, "`[sensor]`")});
}

std::vector<SensorMessage> SensorEntry::Messages() const {
  std::vector<SensorMessage> messages;
  SensorProtocols::With(config, [&](auto protocol, const auto& own) {
    for (const SensorMessage& message : decltype(protocol)::Messages(own)) {
      if (RateOf(message) > 0) messages.push_back(message);
    }
  });
  return messages;
}

std::unique_ptr<InertialSensor> SensorEntry::MakeHost() const {
  return SensorProtocols::With(
      config, [](auto protocol, const auto& own) -> std::unique_ptr<InertialSensor> {
        return std::make_unique<typename decltype(protocol)::Host>(own);
      });
}

}  // namespace tumbler
