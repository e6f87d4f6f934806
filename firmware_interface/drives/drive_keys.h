#pragma once

#include <string_view>

#include "common/toml_reader.h"
#include "firmware_interface/drives/drive_entry.h"
#include "firmware_interface/drives/drive_range.h"
#include "firmware_interface/drives/joint_map.h"

namespace tumbler {

/// A drive of a file, as a protocol reads it.
struct DriveTable {
  TomlTable& keys;    ///< of the drive
  TomlTable& bus;     ///< of the bus, for saying what does not go with the protocol
  double rate_hz;     ///< of the control loop
  DriveEntry& entry;  ///< takes the gains
};

// Keys that protocols have in common. All of them throw FileError.

/// `direction`, `gear_ratio`, `zero_offset_rad`.
JointMap ReadJoint(TomlTable& table);

/// A range [min, max] around zero, or from zero on for gains.
DriveRange ReadRange(TomlTable& table, std::string_view key, bool from_zero);

/// `range`: what the drive may be told at its shaft, none wider than the wire carries.
ShaftRanges ReadShaftRanges(TomlTable& table, double position_max, double velocity_max,
                            double torque_max);

/// A gain at the joint that the drive can carry at its shaft.
float ReadGain(TomlTable& table, std::string_view key, const DriveRange& range,
               const JointMap& joint);

/// `kp_nm_per_rad`, `kd_nm_s_per_rad`: what the drive was tuned to, for protocols that do not carry
/// gains.
void ReadOwnGains(DriveTable& table);

float NumberAsFloat(TomlTable& table, std::string_view key, Range range);

}  // namespace tumbler
