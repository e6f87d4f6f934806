#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <utility>

#include "firmware_interface/drives/cansimple.h"
#include "firmware_interface/drives/drive_keys.h"
#include "firmware_interface/drives/drive_traffic.h"

namespace tumbler {

CanSimpleConfig CanSimpleProtocol::Read(DriveTable& table) {
  constexpr double kPositionMax_rad = 1e6;
  constexpr double kVelocityMax_rad_s = 205.88;  // 32.767 turns/s
  constexpr double kTorqueMax_nm = 32.767;
  TomlTable& keys = table.keys;
  CanSimpleConfig can;
  can.node_id = static_cast<std::uint8_t>(keys.Integer("node_id", 0, kCanSimpleNodeMax));
  can.joint = ReadJoint(keys);
  can.range = ReadShaftRanges(keys, kPositionMax_rad, kVelocityMax_rad_s, kTorqueMax_nm);
  ReadOwnGains(table);
  CanSimpleMessages& messages = can.messages;
  messages.heartbeat_s = keys.Number("heartbeat_s", {0.001, 1, false}, messages.heartbeat_s);
  messages.estimates_s = keys.Number("estimates_s", {0.001, 0.1, false}, messages.estimates_s);
  for (const auto& [key, period] : {std::pair{"torques_s", &messages.torques_s},
                                    std::pair{"temperature_s", &messages.temperature_s}}) {
    *period = keys.Number(key, {0, 60, false}, *period);
    if (*period > 0 && *period < 0.001) {
      keys.Fail(key, fmt::format("is {}; allowed: 0 (not sent) or from 0.001 ... 60",
                                 MessageNumber(*period)));
    }
  }
  // A drive whose measurement is older than a few ticks counts as silent.
  const double estimate_ticks = messages.estimates_s * table.rate_hz;
  if (estimate_ticks > 4) {
    keys.Fail("estimates_s",
              fmt::format("is {}, {} ticks of the control loop; at most 4 are "
                          "allowed: raise encoder_msg_rate of the drive",
                          MessageNumber(messages.estimates_s), MessageNumber(estimate_ticks)));
  }
  can.heartbeat_ticks_max =
      static_cast<int>(std::ceil(2.5 * messages.heartbeat_s * table.rate_hz)) + 1;
  can.estimates_per_tick_max = static_cast<int>(std::ceil(1 / estimate_ticks)) + 1;
  return can;
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
  traffic.host_sends = {id(CanSimpleCommand::kSetAxisState),
                        id(CanSimpleCommand::kSetControllerMode),
                        id(CanSimpleCommand::kSetInputPos), id(CanSimpleCommand::kSetInputVel),
                        id(CanSimpleCommand::kClearErrors)};
  traffic.host_receives = {id(CanSimpleCommand::kHeartbeat), id(CanSimpleCommand::kGetError),
                           id(CanSimpleCommand::kGetEncoderEstimates),
                           id(CanSimpleCommand::kGetTemperature),
                           id(CanSimpleCommand::kGetTorques)};
  traffic.host_frames_max = 3;
  return traffic;
}

}  // namespace tumbler
