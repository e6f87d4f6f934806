#pragma once

#include <memory>

#include "common/sequence_toml.h"
#include "firmware_interface/drives/drives_toml.h"
#include "runtime/world.h"

namespace tumbler {

/// The robot of a motion, simulated, behind simulated drives on a simulated bus.
/// @param file  must outlive the world.
/// @param paced  at the pace of the clock; else in virtual time.
std::unique_ptr<World> MakeSimulatedWorld(const SequenceFile& file, const DrivesConfig& drives,
                                          bool paced);

}  // namespace tumbler
