#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "common/sequence_toml.h"
#include "firmware_interface/drives/drives_toml.h"
#include "runtime/run/world.h"

namespace tumbler {

/// What `tumbler-run sim` runs on; empty names leave that out.
struct SimulatedWorldConfig {
  std::string twin_file;   ///< The robot as it is (docs/formats.md); else as the motion has it.
  std::string bus_faults;  ///< File that disturbs the bus (docs/formats.md).
  std::string truth_log;   ///< truth_t to this LCM log.
  std::string lcm_url;     ///< truth_t live.
  /// Called with every truth_t as it is encoded; for a flight record.
  std::function<void(std::span<const std::uint8_t>)> truth_sink;
  bool paced = false;  ///< At the pace of the clock; else in virtual time.
};

/// The robot of a motion, simulated, behind simulated drives on a simulated bus.
/// @param file  must outlive the world.
/// @throws FileError about a file of the configuration; std::runtime_error about where the truth
///         goes.
std::unique_ptr<World> MakeSimulatedWorld(const SequenceFile& file, const DrivesConfig& drives,
                                          const SimulatedWorldConfig& config);

}  // namespace tumbler
