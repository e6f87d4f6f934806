#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

#include "firmware_interface/devices/cansimple.h"
#include "firmware_interface/devices/drive_keys.h"
#include "firmware_interface/devices/drive_traffic.h"

namespace tumbler {

namespace {

// The largest magnitudes that the wire carries.
constexpr double kPositionMax_rad = 1e6;
constexpr double kVelocityMax_rad_s = 205.88;  // 32.767 turns/s
constexpr double kTorqueMax_nm = 32.767;

constexpr std::array kCanSimpleKeys = {
    KeyOf<&CanSimpleConfig::node_id>("node_id", {0, kCanSimpleNodeMax}, "").Required(),
};

constexpr const char* kPeriod = "period of what the drive is set to send";

template <auto kMember>
void ReadPeriodOrNone(TomlTable& table, std::string_view key, CanSimpleMessages& messages) {
  const double period = table.Number(key, {0, 60});
  if (period > 0 && period < 0.001) {
    table.Fail(key, fmt::format("is {}; allowed: 0 (not sent) or from 0.001 ... 60",
                                MessageNumber(period)));
  }
  messages.*kMember = period;
}
template <auto kMember>
constexpr FileKey<CanSimpleMessages> PeriodOrNoneOf(std::string_view name) {
  return KeyOf<kMember>(name, kPeriod)
      .Allowed("0 (not sent), 0.001 to 60")
      .ReadBy(ReadPeriodOrNone<kMember>);
}

constexpr std::array kMessageKeys = {
    KeyOf<&CanSimpleMessages::heartbeat_s>("heartbeat_s", {0.001, 1}, kPeriod),
    KeyOf<&CanSimpleMessages::estimates_s>("estimates_s", {0.001, 0.1}, kPeriod)
        .Allowed("0.001 to 0.1, at most 4 ticks"),
    PeriodOrNoneOf<&CanSimpleMessages::torques_s>("torques_s"),
    PeriodOrNoneOf<&CanSimpleMessages::temperature_s>("temperature_s"),
};

}  // namespace

CanSimpleConfig CanSimpleProtocol::Read(DriveTable& table) {
  TomlTable& keys = table.keys;
  CanSimpleConfig can;
  ReadKeys(keys, kCanSimpleKeys, can);
  can.joint = ReadJoint(keys);
  can.range = ReadShaftRanges(keys, kPositionMax_rad, kVelocityMax_rad_s, kTorqueMax_nm);
  ReadOwnGains(table);
  CanSimpleMessages& messages = can.messages;
  ReadKeys(keys, kMessageKeys, messages);
  // A drive whose measurement is older than a few ticks counts as silent.
  const double estimate_ticks = messages.estimates_s * table.rate_hz;
  if (estimate_ticks > 4) {
    keys.Fail("estimates_s",
              fmt::format("is {}, {} ticks of the control loop; at most 4 are "
                          "allowed: raise encoder_msg_rate of the drive",
                          MessageNumber(messages.estimates_s), MessageNumber(estimate_ticks)));
  }
  // Two that get lost on the wire, and an adapter that pauses, are borne.
  constexpr double kPause_s = 0.01;
  can.heartbeat_ticks_max =
      static_cast<int>(std::ceil((3.5 * messages.heartbeat_s + kPause_s) * table.rate_hz - 1e-6)) +
      1;
  can.estimates_per_tick_max = static_cast<int>(std::ceil(1 / estimate_ticks)) + 1;
  return can;
}

KeyTable CanSimpleProtocol::Keys() {
  const KeyRow range{"`[drive.range]`", "`velocity_rad_s`, `torque_nm`", "required",
                     fmt::format("+-{}, +-{}", kVelocityMax_rad_s, kTorqueMax_nm),
                     "what the feed-forwards carry"};
  return {"firmware_interface/devices/cansimple_toml.cc", "cansimple",
          Joined({RowsOf(kCanSimpleKeys), RowsOf(kMessageKeys), {range}})};
}

std::uint32_t CanSimpleProtocol::DbcId(std::uint32_t of_example, const CanSimpleConfig& config) {
  constexpr std::uint32_t kCommand = 0x1f;
  return std::uint32_t{config.node_id} << 5 | (of_example & kCommand);
}

DriveTraffic CanSimpleProtocol::TrafficOf(const DriveEntry& /*entry*/,
                                          const CanSimpleConfig& config, double rate_hz) {
  const CanSimpleMessages& messages = config.messages;
  DriveTraffic traffic;
  traffic.schedule = {{"setpoints", 8},
                      {"estimates", 8, messages.estimates_s * rate_hz},
                      {"heartbeats", 8, PeriodTicks(messages.heartbeat_s, rate_hz)}};
  if (messages.torques_s > 0) {
    traffic.schedule.push_back({"torques", 8, PeriodTicks(messages.torques_s, rate_hz)});
  }
  if (messages.temperature_s > 0) {
    traffic.schedule.push_back({"temperatures", 8, PeriodTicks(messages.temperature_s, rate_hz)});
  }
  DriveIdentifiers all{"node_id", config.node_id, true, false, {}};
  for (std::uint32_t command = 0; command < 32; ++command) {
    all.ids.push_back(std::uint32_t{config.node_id} << 5 | command);
  }
  traffic.identifiers = {all};
  const auto id = [&config](CanSimpleCommand command) {
    return CanSimpleId(config.node_id, command);
  };
  for (const HostFrame& frame : HostFrames(config))
    traffic.host_sends.emplace_back(std::uint32_t{config.node_id} << 5 | frame.id);
  traffic.host_receives = {id(CanSimpleCommand::kHeartbeat), id(CanSimpleCommand::kGetError),
                           id(CanSimpleCommand::kGetEncoderEstimates),
                           id(CanSimpleCommand::kGetTemperature),
                           id(CanSimpleCommand::kGetTorques)};
  traffic.host_frames_max = 3;
  return traffic;
}

}  // namespace tumbler
