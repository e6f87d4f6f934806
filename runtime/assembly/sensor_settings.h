#pragma once

#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/sensor_entry.h"
#include "runtime/executor/sensor_watch.h"

namespace tumbler {

/// The executor's settings for a sensor of a drives file. Where the sensor is on the robot follows
/// from the chains of the motion's primitives with feedback.
/// @param rate_hz  of the control loop.
/// @throws Refused  naming a primitive with feedback that does not know the sensor's link, or two
/// that do not agree about it; and when the sequence is about the pitch of another link.
[[nodiscard]] SensorSettings SensorSettingsOf(const SensorEntry& entry, const SequenceFile& motion,
                                              double rate_hz);

}  // namespace tumbler
