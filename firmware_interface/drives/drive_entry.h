#pragma once

#include <string>

#include "firmware_interface/drives/protocols.h"

namespace tumbler {

/// One drive and the joint that it moves, as a drives file has them.
struct DriveEntry {
  std::string joint;  ///< The joint's name in the robot's URDF.
  DriveConfig config;
  /// Gains of the running drive, at the joint. Where the protocol does not carry them they say what
  /// the drive was tuned to: the simulated drive has them, and kp > 0 asks for position control.
  float kp_nm_per_rad = 0;
  float kd_nm_s_per_rad = 0;
  float temperature_max_c = 80;  ///< The executor stops above it.
  double watchdog_s = 0.025;     ///< What the drive's time-out is set to; 0 says that it has none.
};

}  // namespace tumbler
