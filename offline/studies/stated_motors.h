#pragma once

#include <span>
#include <string>
#include <vector>

#include "firmware_interface/devices/drive_entry.h"
#include "offline/problem/posterior_toml.h"
#include "offline/scene/robot_posterior.h"
#include "offline/scene/variation.h"

namespace tumbler {

// What drives files say of motors, and what a fit makes of it. The quantities torque_factor,
// velocity_filter and torque_lag are of all drives of a robot; drives files say each of one.

/// What drives files say of the drives of a posterior's records, in the order of its drives.
[[nodiscard]] std::vector<MotorFacts> StatedIn(const PosteriorDrives& drives);

/// The average of what is said of drives; that of none is MotorFacts{}.
[[nodiscard]] MotorFacts AverageOf(std::span<const MotorFacts> stated);

/// Gives each joint of a robot its own drive. Quantities of all drives are of their average: by how
/// much a drive departs from it, it does as was stated. What is no quantity is as stated.
/// @param stated  of each joint; empty: MotorFacts{}.
/// @param robot   as VariationOf makes it of these quantities.
void OwnDrives(std::span<const MotorFacts> stated, std::span<const RobotQuantity> quantities,
               RobotVariation& robot);

/// The motor of a joint's drive, as it was found, or else stated.
[[nodiscard]] MotorFacts MotorFound(const PosteriorFile& file, const std::string& joint);

}  // namespace tumbler
