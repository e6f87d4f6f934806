#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <string_view>

#include "firmware_interface/drives/drive_keys.h"
#include "firmware_interface/drives/drive_traffic.h"
#include "firmware_interface/drives/mit.h"

namespace tumbler {

namespace {

constexpr std::array kIdKeys = {
    KeyOf<&MitConfig::command_id>("command_id", {1, 0xff}, "the drive's CAN_ID").Required(),
    KeyOf<&MitConfig::reply_id>("reply_id", {0, 0x7ff}, "the drive's CAN_MASTER")
        .Required()
        .Allowed("0 to 0x7ff"),
};

constexpr std::array<std::string_view, 2> kTemperatures = {"signed", "offset-40"};
constexpr std::array kTemperatureKeys = {
    KeyOf<&MitConfig::temperature_encoding>("temperature_encoding", kTemperatures,
                                            "of the reply's seventh byte"),
};

constexpr const char* kAtShaft = "at the drive's shaft";
constexpr std::array kRangeKeys = AllRequired(std::array{
    RangeOf<&MitRanges::position_rad>("position_rad", kAtShaft),
    RangeOf<&MitRanges::velocity_rad_s>("velocity_rad_s", kAtShaft),
    RangeOf<&MitRanges::kp_nm_per_rad, true>("kp_nm_per_rad", kAtShaft),
    RangeOf<&MitRanges::kd_nm_s_per_rad, true>("kd_nm_s_per_rad", kAtShaft),
    RangeOf<&MitRanges::torque_nm>("torque_nm", kAtShaft),
});

constexpr const char* kReplies = "where replies differ from commands";
constexpr std::array kReplyRangeKeys = {
    RangeOf<&MitRanges::position_rad>("position_rad", kReplies).Default("that of `range`"),
    RangeOf<&MitRanges::velocity_rad_s>("velocity_rad_s", kReplies).Default("that of `range`"),
    RangeOf<&MitRanges::torque_nm>("torque_nm", kReplies).Default("that of `range`"),
};

}  // namespace

MitConfig MitProtocol::Read(DriveTable& table) {
  TomlTable& keys = table.keys;
  MitConfig mit;
  ReadKeys(keys, kIdKeys, mit);
  mit.joint = ReadJoint(keys);
  TomlTable range = keys.Table("range");
  ReadKeys(range, kRangeKeys, mit.command);
  mit.reply = mit.command;
  if (auto reply = keys.OptionalTable("reply_range")) ReadKeys(*reply, kReplyRangeKeys, mit.reply);
  ReadKeys(keys, kTemperatureKeys, mit);
  ReadCarriedGains(table, mit.joint, mit.command.kp_nm_per_rad, mit.command.kd_nm_s_per_rad);
  if (mit.reply_id == mit.command_id) {
    keys.Fail("reply_id", fmt::format("is {}, as command_id; a drive's two identifiers must differ",
                                      mit.reply_id));
  }
  return mit;
}

KeyTable MitProtocol::Keys() {
  return {"firmware_interface/drives/mit_toml.cc", "mit",
          Joined({RowsOf(kIdKeys), RowsOf(kTemperatureKeys), RowsOf(kRangeKeys, "`[drive.range]`"),
                  RowsOf(kReplyRangeKeys, "`[drive.reply_range]`")})};
}

DriveTraffic MitProtocol::TrafficOf(const DriveEntry& /*entry*/, const MitConfig& config,
                                    double /*rate_hz*/) {
  DriveTraffic traffic;
  traffic.schedule = {{"setpoints", 8}, {"replies", 8}};
  traffic.identifiers = {{"command_id", config.command_id, true, false, {config.command_id}},
                         {"reply_id", config.reply_id, false, false, {config.reply_id}}};
  traffic.host_sends = {config.command_id};
  traffic.host_receives = {config.reply_id};
  traffic.host_frames_max = 1;
  return traffic;
}

}  // namespace tumbler
