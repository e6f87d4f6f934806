#pragma once

#include <string>
#include <vector>

#include "firmware_interface/devices/drives_toml.h"
#include "offline/problem/simulated_motion.h"
#include "offline/twin/twin.h"

namespace tumbler {

/// What is to be said about the damping of the drives that play a motion
/// (common/core/damping_bound.h): first how slow their loops may be, over the poses of all its
/// primitives; then a warning for each loop that is slower than advised, which may be that of the
/// twin, too; and one where contact does not bear the twin's steps.
/// @param twin  with fixed steps; null: the motion is not simulated, or with others.
/// @throws FileError  when the texts of a primitive cannot be used.
std::vector<std::string> DampingNotes(const SimulatedMotion& motion, const DrivesConfig& drives,
                                      const TwinConfig* twin);

}  // namespace tumbler
