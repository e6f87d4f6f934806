#pragma once

#include <string>

#include "firmware_interface/devices/protocols.h"

namespace tumbler {

/// How a drive's motor differs from what the drive reckons with, as far as that is stated: by the
/// drive's documentation, or by a measurement. It is simulated, and a fit of records begins from
/// it. What is sent to the drive does not depend on it.
struct MotorFacts {
  /// > 0: what the motor exerts for each newton metre that its drive reckons with.
  double torque_factor = 1;
  /// >= 0: time constant of the current loop, which the torque follows in the first order [s].
  double torque_time_constant_s = 0;
  /// >= 0: time constant of the first-order filter through which the drive sees its velocity [s].
  double velocity_filter_s = 0;

  bool operator==(const MotorFacts&) const = default;
};

/// One drive of a drives file, with the joint that it moves.
struct DriveEntry {
  std::string joint;  ///< The joint's name in the robot's URDF.
  DriveConfig config;
  /// Gains of the running drive, at the joint. Where the protocol does not carry gains, these are
  /// the ones to which the drive was tuned: the simulated drive uses them, and kp > 0 asks for
  /// position control.
  float kp_nm_per_rad = 0;
  float kd_nm_s_per_rad = 0;
  float temperature_max_c = 80;  ///< A hotter drive is a fault.
  double watchdog_s = 0.025;     ///< Setting of the drive's time-out; 0: it has none.
  /// Rate of the drive's own loop, in which it computes its torque from its gains; 0: not known.
  /// Whether its damping is stable depends on it (common/core/damping_bound.h).
  double loop_hz = 0;
  MotorFacts motor;
};

}  // namespace tumbler
