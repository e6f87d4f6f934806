#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "firmware_interface/devices/akv3.h"
#include "firmware_interface/devices/drive_keys.h"
#include "firmware_interface/devices/drive_models.h"
#include "firmware_interface/devices/drive_traffic.h"
#include "firmware_interface/devices/drives_dbc.h"

namespace tumbler {

namespace {

constexpr std::array kIdKeys = {
    KeyOf<&AkV3Config::node_id>("drive_id", {0, 0xff}, "the drive's CAN ID").Required(),
};

/// What a model is delivered with: +-12.56 rad, kp 0 ... 500, kd 0 ... 5, and these.
struct AkV3Model {
  std::string_view name;
  float velocity_rad_s;
  float torque_nm;
  int pole_pairs;
  float gear_inside;
};
// Ranges: the manual's table as CUBEMARS_AK_V3_LIMITS in src/cubemars/ak_v3/ak_v3_common.py of
// github.com/bhattner143/exo-actuator-sensor-drivers has it; pole pairs and gears: MOTOR_PARAMS in
// epicallypowerful/actuation/motor_data.py of github.com/gatech-epic-power/epically-powerful.
constexpr std::array<AkV3Model, 3> kModels = {{
    {"AK10-9", 28, 54, 21, 9},
    {"AK60-6", 60, 12, 14, 6},
    {"AK80-9", 65, 18, 21, 9},
}};
constexpr auto kModelNames = NamesOf(kModels);

void ReadModel(TomlTable& table, std::string_view key, AkV3Config& config) {
  const std::string name = table.Choice(key, kModelNames, "");
  for (const AkV3Model& model : kModels) {
    if (model.name != name) continue;
    TakeModelRanges(model.velocity_rad_s, model.torque_nm, config.range);
    config.pole_pairs = model.pole_pairs;
    config.gear_inside = model.gear_inside;
  }
}
constexpr std::array kModelKeys = {
    KeyReadBy<AkV3Config>("model", ReadModel,
                          "gives `pole_pairs`, `gear_inside` and `[drive.range]` as delivered")
        .Schema(R"({"type": "string"})")
        .Allowed("[see there](#models)"),
};

constexpr const char* kOfModel = "that of `model`";
constexpr std::array kMotorKeys = {
    KeyOf<&AkV3Config::pole_pairs>("pole_pairs", {1, 100}, "of the motor").Default(kOfModel),
    KeyOf<&AkV3Config::gear_inside>("gear_inside", {0.1, 1000},
                                    "turns of the motor per turn of the drive's shaft")
        .Default(kOfModel),
};

constexpr std::array kReportKeys = {
    KeyOf<&AkV3Config::torque_constant_nm_per_a>(
        "torque_constant_nm_per_a", {0, 1000},
        "torque at the drive's shaft per ampere reported; 0: the torque is not known"),
    KeyOf<&AkV3Config::status_s>("status_s", {0.002, 0.1},
                                 "period of the reports that the drive is set to send")
        .Allowed("0.002 to 0.1, at most 4 ticks"),
};

}  // namespace

std::vector<DriveModel> AkV3Models() {
  std::vector<DriveModel> models;
  for (const AkV3Model& model : kModels) {
    models.push_back({model.name, double{model.velocity_rad_s}, double{model.torque_nm},
                      model.pole_pairs * double{model.gear_inside}});
  }
  return models;
}

AkV3Config AkV3Protocol::Read(DriveTable& table) {
  TomlTable& keys = table.keys;
  AkV3Config config;
  ReadKeys(keys, kIdKeys, config);
  config.joint = ReadJoint(keys);
  ReadKeys(keys, kModelKeys, config);
  const bool of_model = keys.Has("model");
  ReadKeys(keys, of_model ? kMotorKeys : AllRequired(kMotorKeys), config);
  ReadImpedanceRanges(keys, of_model, config.range);
  ReadKeys(keys, kReportKeys, config);
  ReadCarriedGains(table, config.joint, config.range.kp_nm_per_rad, config.range.kd_nm_s_per_rad);
  // A drive whose measurement is older than a few ticks counts as silent.
  const double ticks = config.status_s * table.rate_hz;
  if (ticks > 4) {
    keys.Fail("status_s", fmt::format("is {}, {} ticks of the control loop; at most 4 are allowed: "
                                      "raise the drive's CAN feedback rate, or lower rate_hz",
                                      MessageNumber(config.status_s), MessageNumber(ticks)));
  }
  config.status_per_tick_max = static_cast<int>(std::ceil(1 / ticks)) + 1;
  return config;
}

KeyTable AkV3Protocol::Keys() {
  return {"firmware_interface/devices/akv3_toml.cc", "akv3",
          Joined({RowsOf(kIdKeys), RowsOf(kModelKeys), RowsOf(kMotorKeys), RowsOf(kReportKeys),
                  ImpedanceRangeRows()})};
}

std::uint32_t AkV3Protocol::DbcId(std::uint32_t of_example, const AkV3Config& config) {
  return (of_example & ~0xffU) | config.node_id;
}

DbcLine AkV3Protocol::DbcSignal(std::string_view message, std::string_view signal,
                                std::string_view line, const AkV3Config& config) {
  if (message != "AKV3_SETPOINT") return {std::string(line)};
  constexpr double kSteps12 = 1 << 12, kSteps16 = 1 << 16;
  if (signal == "position") return {WithScale(line, config.range.position_rad, kSteps16)};
  if (signal == "velocity") return {WithScale(line, config.range.velocity_rad_s, kSteps12)};
  if (signal == "kp") return {WithScale(line, config.range.kp_nm_per_rad, kSteps12)};
  if (signal == "kd") return {WithScale(line, config.range.kd_nm_s_per_rad, kSteps12)};
  return {WithScale(line, config.range.torque_nm, kSteps12)};
}

DriveTraffic AkV3Protocol::TrafficOf(const DriveEntry& /*entry*/, const AkV3Config& config,
                                     double rate_hz) {
  DriveTraffic traffic;
  traffic.schedule = {{"setpoints", 8, 1, false, true},
                      {"reports", 8, config.status_s * rate_hz, false, true}};
  DriveIdentifiers all{"drive_id", config.node_id, true, false, {}};
  for (const HostFrame& frame : HostFrames(config))
    traffic.host_sends.emplace_back(frame.id | config.node_id, true);
  traffic.host_receives = {{AkV3Id(kAkV3StatusFunction, config.node_id), true}};
  all.ids = traffic.host_sends;
  all.ids.insert(all.ids.end(), traffic.host_receives.begin(), traffic.host_receives.end());
  traffic.identifiers = {all};
  traffic.host_frames_max = 1;
  return traffic;
}

}  // namespace tumbler
