#pragma once

#include <memory>

#include "firmware_interface/drives/drives_toml.h"
#include "firmware_interface/drives/simulated_drive.h"

namespace tumbler {

/// A simulated drive as its protocol makes it: a name that a protocol can be described with where
/// there is no heap.
struct OwnedDrive {
  std::unique_ptr<SimulatedDrive> drive;
};

/// A gain of a drives file, at the joint, as the drive has it at its shaft.
[[nodiscard]] inline double GainAtShaft(const JointMap& joint, float gain) {
  return static_cast<double>(joint.ToDriveGain(gain));
}

/// The simulated drive that an entry of a drives file describes: its protocol, identifiers, joint,
/// watchdog, and gains where they are the drive's own.
/// @param motor  at the shaft.
/// @throws std::invalid_argument  when such a drive cannot be.
std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry,
                                                   const SimulatedMotorConfig& motor = {});

}  // namespace tumbler
