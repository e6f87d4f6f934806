#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <string_view>

#include "firmware_interface/drives/drive_keys.h"
#include "firmware_interface/drives/drive_traffic.h"
#include "firmware_interface/drives/mit.h"

namespace tumbler {

namespace {

MitRanges ReadRanges(TomlTable& table) {
  MitRanges ranges;
  ranges.position_rad = ReadRange(table, "position_rad", false);
  ranges.velocity_rad_s = ReadRange(table, "velocity_rad_s", false);
  ranges.kp_nm_per_rad = ReadRange(table, "kp_nm_per_rad", true);
  ranges.kd_nm_s_per_rad = ReadRange(table, "kd_nm_s_per_rad", true);
  ranges.torque_nm = ReadRange(table, "torque_nm", false);
  return ranges;
}

/// Reads the ranges of replies, where they differ from those of commands.
MitRanges ReadReplyRanges(TomlTable& table, MitRanges ranges) {
  if (table.Has("position_rad")) ranges.position_rad = ReadRange(table, "position_rad", false);
  if (table.Has("velocity_rad_s")) {
    ranges.velocity_rad_s = ReadRange(table, "velocity_rad_s", false);
  }
  if (table.Has("torque_nm")) ranges.torque_nm = ReadRange(table, "torque_nm", false);
  return ranges;
}

}  // namespace

MitConfig MitProtocol::Read(DriveTable& table) {
  static constexpr std::array<std::string_view, 2> kTemperatures = {"signed", "offset-40"};
  TomlTable& keys = table.keys;
  MitConfig mit;
  mit.command_id = static_cast<std::uint16_t>(keys.Integer("command_id", 1, 0xff));
  mit.reply_id = static_cast<std::uint16_t>(keys.Integer("reply_id", 0, 0x7ff));
  mit.joint = ReadJoint(keys);
  TomlTable range = keys.Table("range");
  mit.command = ReadRanges(range);
  mit.reply = mit.command;
  if (auto reply = keys.OptionalTable("reply_range")) {
    mit.reply = ReadReplyRanges(*reply, mit.command);
  }
  mit.temperature_encoding =
      keys.Choice("temperature_encoding", kTemperatures, "signed") == "signed"
          ? MitTemperature::kSigned
          : MitTemperature::kOffset40;
  table.entry.kp_nm_per_rad = ReadGain(keys, "kp_nm_per_rad", mit.command.kp_nm_per_rad, mit.joint);
  table.entry.kd_nm_s_per_rad =
      ReadGain(keys, "kd_nm_s_per_rad", mit.command.kd_nm_s_per_rad, mit.joint);
  if (mit.reply_id == mit.command_id) {
    keys.Fail("reply_id", fmt::format("is {}, as command_id; a drive's two identifiers must differ",
                                      mit.reply_id));
  }
  return mit;
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
