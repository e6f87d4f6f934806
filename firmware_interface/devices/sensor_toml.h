#pragma once

#include <vector>

#include "common/files/key_table.h"
#include "common/files/toml_reader.h"
#include "firmware_interface/devices/sensor_entry.h"

namespace tumbler {

/// Reads the table `[sensor]` of a drives file.
/// @param loop_rate_hz  of the control loop, which is the default of the sensor's.
/// @throws FileError.
SensorEntry ReadSensor(TomlTable& table, double loop_rate_hz);

/// The keys of that table.
std::vector<KeyRow> SensorRows();

}  // namespace tumbler
