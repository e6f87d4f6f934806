#include "firmware_interface/drives/drive_keys.h"

#include <fmt/format.h>

#include <cstdint>
#include <vector>

namespace tumbler {

namespace {

/// Largest magnitude of a range's end.
constexpr double kLargest = 1e6;

}  // namespace

float NumberAsFloat(TomlTable& table, std::string_view key, Range range) {
  return static_cast<float>(table.Number(key, range));
}

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

float ReadGain(TomlTable& table, std::string_view key, const DriveRange& range,
               const JointMap& joint) {
  const float gain = NumberAsFloat(table, key, Range::NonNegative());
  if (joint.ToDriveGain(gain) > range.max) {
    table.Fail(key, fmt::format("is {}; the drive carries at most {} at the joint",
                                MessageNumber(static_cast<double>(gain)),
                                MessageNumber(static_cast<double>(joint.ToJointGain(range.max)))));
  }
  return gain;
}

JointMap ReadJoint(TomlTable& table) {
  JointMap joint;
  const std::int64_t direction = table.Integer("direction", -1, 1, 1);
  if (direction == 0) table.Fail("direction", "is 0; allowed: 1 or -1");
  joint.direction = static_cast<float>(direction);
  joint.gear_ratio = static_cast<float>(table.Number("gear_ratio", {0.001, 1000, false}, 1));
  joint.zero_offset_rad =
      static_cast<float>(table.Number("zero_offset_rad", {-1000, 1000, false}, 0));
  return joint;
}

ShaftRanges ReadShaftRanges(TomlTable& table, double position_max, double velocity_max,
                            double torque_max) {
  TomlTable range = table.Table("range");
  const auto read = [&range](std::string_view key, double most) {
    const DriveRange ends = ReadRange(range, key, false);
    // Ends are floats: a number that rounds to the last one that fits is let pass.
    if (!ends.ContainsZeroWithin(static_cast<float>(most))) {
      range.Fail(key,
                 fmt::format("is [{}, {}]; the protocol carries at most +-{} at the shaft",
                             MessageNumber(static_cast<double>(ends.min)),
                             MessageNumber(static_cast<double>(ends.max)), MessageNumber(most)));
    }
    return ends;
  };
  return {read("position_rad", position_max), read("velocity_rad_s", velocity_max),
          read("torque_nm", torque_max)};
}

void ReadOwnGains(DriveTable& table) {
  table.entry.kp_nm_per_rad = NumberAsFloat(table.keys, "kp_nm_per_rad", {0, 1e6, true});
  table.entry.kd_nm_s_per_rad = NumberAsFloat(table.keys, "kd_nm_s_per_rad", {0, 1e6, true});
}

}  // namespace tumbler
