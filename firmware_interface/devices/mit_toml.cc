#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "firmware_interface/devices/drive_keys.h"
#include "firmware_interface/devices/drive_models.h"
#include "firmware_interface/devices/drive_traffic.h"
#include "firmware_interface/devices/drives_dbc.h"
#include "firmware_interface/devices/mit.h"

namespace tumbler {

namespace {

constexpr std::array kIdKeys = {
    KeyOf<&MitConfig::command_id>("command_id", {1, 0xff}, "the drive's CAN_ID").Required(),
    KeyOf<&MitConfig::reply_id>("reply_id", {0, 0x7ff},
                                "the drive's CAN_MASTER, or its CAN_ID where it answers on that")
        .Required()
        .Allowed("0 to 0x7ff"),
};

constexpr std::array<std::string_view, 2> kDialects = {"mini-cheetah", "damiao"};
constexpr std::array kDialectKeys = {
    KeyOf<&MitConfig::dialect>("dialect", kDialects, "whose replies the drive sends"),
};

/// The ranges that the firmware of a model is delivered with: +-12.5 rad, kp 0 ... 500, kd 0 ... 5,
/// and these. No source states the rate of their own loops. docs/protocols/mit.md says where
/// published tables disagree. DM4340 is not here, since they give it 8 or 10 rad/s.
struct MitModel {
  std::string_view name;
  MitDialect dialect;
  float velocity_rad_s;
  float torque_nm;
};
// AK: MIT_Params in src/TMotorCANControl/mit_can.py of github.com/neurobionics/TMotorCANControl.
// DM: Limit_Param in DM_CAN.py of github.com/cmjang/DM_Control_Python. Registers 21 to 23 of a
// Damiao drive hold the ranges that it really has.
constexpr std::array<MitModel, 9> kModels = {{
    {"AK60-6", MitDialect::kMiniCheetah, 50, 15},
    {"AK70-10", MitDialect::kMiniCheetah, 50, 25},
    {"AK80-6", MitDialect::kMiniCheetah, 76, 12},
    {"AK80-9", MitDialect::kMiniCheetah, 50, 18},
    {"AK80-64", MitDialect::kMiniCheetah, 8, 144},
    {"AK10-9", MitDialect::kMiniCheetah, 50, 65},
    {"DM4310", MitDialect::kDamiao, 30, 10},
    {"DM8009", MitDialect::kDamiao, 45, 54},
    {"DM10010", MitDialect::kDamiao, 20, 200},
}};
constexpr auto kModelNames = NamesOf(kModels);

void ReadModel(TomlTable& table, std::string_view key, MitConfig& mit) {
  const std::string name = table.Choice(key, kModelNames, "");
  for (const MitModel& model : kModels) {
    if (model.name != name) continue;
    mit.dialect = model.dialect;
    TakeModelRanges(model.velocity_rad_s, model.torque_nm, mit.command);
  }
}
constexpr std::array kModelKeys = {
    KeyReadBy<MitConfig>("model", ReadModel, "gives `dialect` and `[drive.range]` as delivered")
        .Schema(R"({"type": "string"})")
        .Allowed("[see there](#models)"),
};

constexpr std::array<std::string_view, 2> kTemperatures = {"signed", "offset-40"};
constexpr std::array kTemperatureKeys = {
    KeyOf<&MitConfig::temperature_encoding>("temperature_encoding", kTemperatures,
                                            "of the reply's seventh byte"),
};

constexpr const char* kReplies = "where replies differ from commands";
constexpr std::array kReplyRangeKeys = {
    RangeOf<&ImpedanceRanges::position_rad>("position_rad", kReplies).Default("that of `range`"),
    RangeOf<&ImpedanceRanges::velocity_rad_s>("velocity_rad_s", kReplies)
        .Default("that of `range`"),
    RangeOf<&ImpedanceRanges::torque_nm>("torque_nm", kReplies).Default("that of `range`"),
};

}  // namespace

std::vector<DriveModel> MitModels() {
  std::vector<DriveModel> models;
  for (const MitModel& model : kModels)
    models.push_back({model.name, double{model.velocity_rad_s}, double{model.torque_nm}});
  return models;
}

MitConfig MitProtocol::Read(DriveTable& table) {
  TomlTable& keys = table.keys;
  MitConfig mit;
  ReadKeys(keys, kIdKeys, mit);
  mit.joint = ReadJoint(keys);
  ReadKeys(keys, kModelKeys, mit);
  ReadKeys(keys, kDialectKeys, mit);
  ReadImpedanceRanges(keys, keys.Has("model"), mit.command);
  mit.reply = mit.command;
  if (auto reply = keys.OptionalTable("reply_range")) ReadKeys(*reply, kReplyRangeKeys, mit.reply);
  ReadKeys(keys, kTemperatureKeys, mit);
  ReadCarriedGains(table, mit.joint, mit.command.kp_nm_per_rad, mit.command.kd_nm_s_per_rad);
  return mit;
}

KeyTable MitProtocol::Keys() {
  return {
      "firmware_interface/devices/mit_toml.cc", "mit",
      Joined({RowsOf(kIdKeys), RowsOf(kModelKeys), RowsOf(kDialectKeys), RowsOf(kTemperatureKeys),
              ImpedanceRangeRows(), RowsOf(kReplyRangeKeys, "`[drive.reply_range]`")})};
}

std::uint32_t MitProtocol::DbcId(std::uint32_t of_example, const MitConfig& config) {
  return of_example == Example(0).command_id ? config.command_id : config.reply_id;
}

DbcLine MitProtocol::DbcSignal(std::string_view message, std::string_view signal,
                               std::string_view line, const MitConfig& config) {
  const bool reply = message == "MIT_REPLY";
  const ImpedanceRanges& ranges = reply ? config.reply : config.command;
  constexpr double kSteps12 = (1 << 12) - 1, kSteps16 = (1 << 16) - 1;
  if (signal == "position") return {WithScale(line, ranges.position_rad, kSteps16)};
  if (signal == "velocity") return {WithScale(line, ranges.velocity_rad_s, kSteps12)};
  if (signal == "kp") return {WithScale(line, ranges.kp_nm_per_rad, kSteps12)};
  if (signal == "kd") return {WithScale(line, ranges.kd_nm_s_per_rad, kSteps12)};
  if (signal == "torque") return {WithScale(line, ranges.torque_nm, kSteps12)};
  const bool offset = config.temperature_encoding == MitTemperature::kOffset40;
  const std::string degrees =
      offset ? "8@0+ (1,-40) [-40|215] \"degC\" HOST" : "8@0- (1,0) [-128|127] \"degC\" HOST";
  const bool damiao = config.dialect == MitDialect::kDamiao;
  if (signal == "temperature")
    return {(damiao ? " SG_ transistors : 55|" : " SG_ temperature : 55|") + degrees};
  if (!damiao) return {std::string(line)};
  if (signal == "error") return {" SG_ rotor : 63|" + degrees};
  return {
      " SG_ sender : 3|4@0+ (1,0) [0|15] \"\" HOST\n"
      " SG_ status : 7|4@0+ (1,0) [0|15] \"\" HOST"};
}

DriveTraffic MitProtocol::TrafficOf(const DriveEntry& /*entry*/, const MitConfig& config,
                                    double /*rate_hz*/) {
  DriveTraffic traffic;
  traffic.schedule = {{"setpoints", 8}, {"replies", 8}};
  DriveIdentifiers commands{"command_id", config.command_id, true, false, {}};
  for (const HostFrame& frame : HostFrames(config)) {
    const CanId id(frame.to_all ? frame.id : frame.id | config.command_id, frame.extended);
    traffic.host_sends.push_back(id);
    // What drives have in common collides with nothing. Of 29 bits, they obey only in servo mode,
    // where a drive of another protocol may have the same number.
    if (!frame.to_all && !frame.extended) commands.ids.push_back(id);
  }
  traffic.identifiers = {commands};
  if (config.reply_id != config.command_id) {
    traffic.identifiers.push_back({"reply_id", config.reply_id, false, false, {config.reply_id}});
  }
  traffic.host_receives = {config.reply_id};
  traffic.host_frames_max = 1;
  return traffic;
}

}  // namespace tumbler
