#include "firmware_interface/devices/drive_keys.h"

#include <fmt/format.h>

#include <array>
#include <cstdint>

namespace tumbler {

namespace {

/// Largest magnitude of a range's end.
constexpr double kLargest = 1e6;

void ReadDirection(TomlTable& table, std::string_view key, JointMap& joint) {
  const std::int64_t direction = table.Integer(key, -1, 1);
  if (direction == 0) table.Fail(key, "is 0; allowed: 1 or -1");
  joint.direction = static_cast<float>(direction);
}

constexpr std::array kJointKeys = {
    KeyOf<&JointMap::direction>("direction", "-1 where the drive turns against the joint")
        .Allowed("1, -1")
        .Schema(R"({"enum": [1, -1]})")
        .ReadBy(ReadDirection),
    KeyOf<&JointMap::gear_ratio>("gear_ratio", {0.001, 1000},
                                 "turns of the drive's shaft per turn of the joint"),
    KeyOf<&JointMap::zero_offset_rad>("zero_offset_rad", {-1000, 1000},
                                      "the joint's angle when the drive reads zero"),
};

/// Ranges at the shaft, and the largest that the wire carries.
struct ShaftRangesEntry : ShaftRanges {
  double position_max = 0;
  double velocity_max = 0;
  double torque_max = 0;
};

template <auto kMember, auto kMost>
void ReadShaftRange(TomlTable& table, std::string_view key, ShaftRangesEntry& ranges) {
  const DriveRange ends = ReadRange(table, key, false);
  const double most = ranges.*kMost;
  // Ends are floats, so a number that rounds to the largest float that fits is allowed.
  if (!ends.ContainsZeroWithin(static_cast<float>(most))) {
    table.Fail(key, fmt::format("is [{}, {}]; the protocol carries at most +-{} at the shaft",
                                MessageNumber(static_cast<double>(ends.min)),
                                MessageNumber(static_cast<double>(ends.max)), MessageNumber(most)));
  }
  ranges.*kMember = ends;
}

template <auto kMember, auto kMost>
constexpr FileKey<ShaftRangesEntry> ShaftRangeOf(std::string_view name) {
  return KeyReadBy<ShaftRangesEntry>(name, ReadShaftRange<kMember, kMost>, "at the drive's shaft")
      .Schema(R"({"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2})")
      .Required()
      .Allowed("[min, max] around 0");
}

constexpr std::array kShaftRangeKeys = {
    ShaftRangeOf<&ShaftRanges::position_rad, &ShaftRangesEntry::position_max>("position_rad"),
    ShaftRangeOf<&ShaftRanges::velocity_rad_s, &ShaftRangesEntry::velocity_max>("velocity_rad_s"),
    ShaftRangeOf<&ShaftRanges::torque_nm, &ShaftRangesEntry::torque_max>("torque_nm"),
};

/// Gains at the joint, and the gains at the drive's shaft that a protocol carries.
struct GainsEntry {
  float kp_nm_per_rad = 0;
  float kd_nm_s_per_rad = 0;
  JointMap joint;
  const DriveRange* kp_carried = nullptr;  ///< Null: none.
  const DriveRange* kd_carried = nullptr;
};

template <auto kMember, auto kCarried>
void ReadGain(TomlTable& table, std::string_view key, GainsEntry& gains) {
  const DriveRange* const carried = gains.*kCarried;
  const Range allowed = carried != nullptr ? Range::NonNegative() : Range{0, 1e6, true};
  const auto gain = static_cast<float>(table.Number(key, allowed));
  if (carried != nullptr && gains.joint.ToDriveGain(gain) > carried->max) {
    table.Fail(key, fmt::format(
                        "is {}; the drive carries at most {} at the joint",
                        MessageNumber(static_cast<double>(gain)),
                        MessageNumber(static_cast<double>(gains.joint.ToJointGain(carried->max)))));
  }
  gains.*kMember = gain;
}

template <auto kMember, auto kCarried>
constexpr FileKey<GainsEntry> GainOf(std::string_view name) {
  return KeyReadBy<GainsEntry>(name, ReadGain<kMember, kCarried>,
                               "gains at the joint: sent, or what the drive's own amount to")
      .Schema(R"({"type": "number", "minimum": 0})")
      .Required()
      .Allowed("0 to what the protocol carries; above 0 where it carries none");
}

constexpr std::array kGainKeys = {
    GainOf<&GainsEntry::kp_nm_per_rad, &GainsEntry::kp_carried>("kp_nm_per_rad"),
    GainOf<&GainsEntry::kd_nm_s_per_rad, &GainsEntry::kd_carried>("kd_nm_s_per_rad"),
};

void ReadGains(DriveTable& table, GainsEntry gains) {
  ReadKeys(table.keys, kGainKeys, gains);
  table.entry.kp_nm_per_rad = gains.kp_nm_per_rad;
  table.entry.kd_nm_s_per_rad = gains.kd_nm_s_per_rad;
}

constexpr std::array kWatchdogKeys = {
    KeyOf<&DriveEntry::watchdog_s>("watchdog_s", {0, 10},
                                   "what the drive's time-out is set to; 0: it has none")
        .Required(),
};

constexpr const char* kOfModel = "that of `model`";
constexpr const char* kAtShaft = "at the drive's shaft";
constexpr std::array kImpedanceRangeKeys = {
    RangeOf<&ImpedanceRanges::position_rad>("position_rad", kAtShaft).Default(kOfModel),
    RangeOf<&ImpedanceRanges::velocity_rad_s>("velocity_rad_s", kAtShaft).Default(kOfModel),
    RangeOf<&ImpedanceRanges::kp_nm_per_rad, true>("kp_nm_per_rad", kAtShaft).Default(kOfModel),
    RangeOf<&ImpedanceRanges::kd_nm_s_per_rad, true>("kd_nm_s_per_rad", kAtShaft).Default(kOfModel),
    RangeOf<&ImpedanceRanges::torque_nm>("torque_nm", kAtShaft).Default(kOfModel),
};

}  // namespace

DriveRange ReadRange(TomlTable& table, std::string_view key, bool from_zero) {
  const std::vector<double> ends = table.Numbers(key, {-kLargest, kLargest, false}, 2);
  if (!(ends[0] < ends[1])) {
    table.Fail(key, fmt::format("is [{}, {}]; the first number must be below the second",
                                MessageNumber(ends[0]), MessageNumber(ends[1])));
  }
  if (from_zero ? ends[0] != 0 : !(ends[0] < 0 && ends[1] > 0)) {
    table.Fail(key, fmt::format(
                        "is [{}, {}]; {}", MessageNumber(ends[0]), MessageNumber(ends[1]),
                        from_zero ? "a gain's range must start at 0" : "the range must contain 0"));
  }
  return {static_cast<float>(ends[0]), static_cast<float>(ends[1])};
}

JointMap ReadJoint(TomlTable& table) {
  JointMap joint;
  ReadKeys(table, kJointKeys, joint);
  return joint;
}
std::vector<KeyRow> JointRows() { return RowsOf(kJointKeys); }

ShaftRanges ReadShaftRanges(TomlTable& table, double position_max, double velocity_max,
                            double torque_max) {
  ShaftRangesEntry ranges;
  ranges.position_max = position_max;
  ranges.velocity_max = velocity_max;
  ranges.torque_max = torque_max;
  TomlTable range = table.Table("range");
  ReadKeys(range, kShaftRangeKeys, ranges);
  return ranges;
}
std::vector<KeyRow> ShaftRangeRows() { return RowsOf(kShaftRangeKeys, "`[drive.range]`"); }

void ReadImpedanceRanges(TomlTable& drive, bool of_model, ImpedanceRanges& ranges) {
  if (!of_model) {
    TomlTable range = drive.Table("range");
    ReadKeys(range, AllRequired(kImpedanceRangeKeys), ranges);
  } else if (auto range = drive.OptionalTable("range")) {
    ReadKeys(*range, kImpedanceRangeKeys, ranges);
  }
}
std::vector<KeyRow> ImpedanceRangeRows() { return RowsOf(kImpedanceRangeKeys, "`[drive.range]`"); }

void TakeModelRanges(float velocity_rad_s, float torque_nm, ImpedanceRanges& ranges) {
  ranges.velocity_rad_s = {-velocity_rad_s, velocity_rad_s};
  ranges.torque_nm = {-torque_nm, torque_nm};
}

void ReadCarriedGains(DriveTable& table, const JointMap& joint, const DriveRange& kp,
                      const DriveRange& kd) {
  ReadGains(table, {0, 0, joint, &kp, &kd});
}
void ReadOwnGains(DriveTable& table) { ReadGains(table, {}); }
std::vector<KeyRow> GainRows() { return RowsOf(kGainKeys); }

void ReadWatchdog(TomlTable& table, DriveEntry& drive) { ReadKeys(table, kWatchdogKeys, drive); }
KeyRow WatchdogRow() { return RowsOf(kWatchdogKeys).front(); }

}  // namespace tumbler
