#pragma once

#include <memory>

#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/simulated_drive.h"

namespace tumbler {

/// A simulated drive as its protocol makes it. The type has a name of its own, so that a protocol
/// can be described where there is no heap.
struct OwnedDrive {
  std::unique_ptr<SimulatedDrive> drive;
};

/// Converts a gain of a drives file from the joint to the drive's shaft.
[[nodiscard]] inline double GainAtShaft(const JointMap& joint, float gain) {
  return static_cast<double>(joint.ToDriveGain(gain));
}

/// A motor with what a drives file says of it, and else the defaults.
[[nodiscard]] SimulatedMotorConfig MotorOf(const DriveEntry& entry);

/// The simulated drive that an entry of a drives file describes: its protocol, identifiers, joint,
/// watchdog, and gains where they are the drive's own.
/// @param motor  the motor, with its values at the shaft.
/// @throws std::invalid_argument  naming the value that is not allowed.
std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry,
                                                   const SimulatedMotorConfig& motor);
/// The same with MotorOf.
std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry);

}  // namespace tumbler
