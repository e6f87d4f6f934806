#pragma once

#include <string_view>

#include "common/toml_reader.h"
#include "firmware_interface/drives/drive_entry.h"
#include "firmware_interface/drives/drive_range.h"
#include "firmware_interface/drives/joint_map.h"

namespace tumbler {

/// A drive of a file, as a protocol reads it.
struct DriveTable {
  TomlTable& keys;    ///< The drive's table.
  TomlTable& bus;     ///< The bus's table, for messages about what does not go with the protocol.
  double rate_hz;     ///< Of the control loop.
  DriveEntry& entry;  ///< Gets the gains.
};

// Readers of keys that protocols have in common. All of them throw FileError.

/// `direction`, `gear_ratio`, `zero_offset_rad`.
JointMap ReadJoint(TomlTable& table);

/// A range [min, max] around zero, or from zero on for gains.
DriveRange ReadRange(TomlTable& table, std::string_view key, bool from_zero);

/// `range`: the ranges of setpoints at the drive's shaft, none wider than the wire carries.
ShaftRanges ReadShaftRanges(TomlTable& table, double position_max, double velocity_max,
                            double torque_max);

/// A gain at the joint that the drive can carry at its shaft.
float ReadGain(TomlTable& table, std::string_view key, const DriveRange& range,
               const JointMap& joint);

/// `kp_nm_per_rad`, `kd_nm_s_per_rad`: the gains to which the drive was tuned, for protocols that
/// do not carry gains.
void ReadOwnGains(DriveTable& table);

float NumberAsFloat(TomlTable& table, std::string_view key, Range range);

}  // namespace tumbler
