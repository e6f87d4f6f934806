#pragma once

#include <memory>

#include "firmware_interface/drives/drives_toml.h"
#include "firmware_interface/drives/simulated_drive.h"

namespace tumbler {

/// The simulated drive that an entry of a drives file describes: its protocol, identifiers, joint,
/// watchdog, and gains where they are the drive's own.
/// @param motor  at the shaft.
/// @throws std::invalid_argument  when such a drive cannot be.
std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry,
                                                   const SimulatedMotorConfig& motor = {});

}  // namespace tumbler
