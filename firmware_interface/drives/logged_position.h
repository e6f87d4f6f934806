#pragma once

#include <optional>

#include "firmware_interface/can/frame.h"
#include "firmware_interface/drives/protocols.h"

namespace tumbler {

/// The joint's position [rad] that a frame tells a drive to go to; nothing if it is no such frame
/// of this drive, or does not ask for position control. For readers of logs: each frame is taken by
/// itself, whatever the drive was doing.
[[nodiscard]] std::optional<double> CommandedPosition(const DriveConfig& drive,
                                                      const CanFrame& frame);

/// The joint's position [rad] that a drive reports in a frame; nothing if it is no such frame of
/// this drive. Positions of MIT drives are taken within their range: a wrap is not followed.
[[nodiscard]] std::optional<double> ReportedPosition(const DriveConfig& drive,
                                                     const CanFrame& frame);

}  // namespace tumbler
