#pragma once

#include <optional>

#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/protocols.h"

namespace tumbler {

/// The joint's position [rad] to which a frame sends a drive; nothing if it is no such frame of
/// this drive, or does not ask for position control. This is for readers of logs: each frame is
/// read by itself, whatever the drive was doing.
[[nodiscard]] std::optional<double> CommandedPosition(const DriveConfig& drive,
                                                      const CanFrame& frame);

/// The joint's position [rad] that a drive reports in a frame; nothing if it is no such frame of
/// this drive. Positions of MIT drives are those within their range: a wrap is not followed.
[[nodiscard]] std::optional<double> ReportedPosition(const DriveConfig& drive,
                                                     const CanFrame& frame);

}  // namespace tumbler
