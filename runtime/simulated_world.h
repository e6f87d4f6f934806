#pragma once

#include <memory>
#include <string>

#include "common/sequence_toml.h"
#include "firmware_interface/drives/drives_toml.h"
#include "runtime/world.h"

namespace tumbler {

/// What `tumbler-run sim` runs on; an empty name leaves that out.
struct SimulatedWorldConfig {
  std::string bus_faults;  ///< File that disturbs the bus (docs/formats.md).
  bool paced = false;      ///< At the pace of the clock; else in virtual time.
};

/// The robot of a motion, simulated, behind simulated drives on a simulated bus.
/// @param file  must outlive the world.
/// @throws FileError about a file of the configuration.
std::unique_ptr<World> MakeSimulatedWorld(const SequenceFile& file, const DrivesConfig& drives,
                                          const SimulatedWorldConfig& config);

}  // namespace tumbler
