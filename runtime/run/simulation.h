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

/// Takes what is true of a simulated robot, as LCM messages truth_t.
using TruthSink = std::function<void(std::span<const std::uint8_t>)>;

/// What `tumbler-run sim` runs on; empty names leave that out.
struct SimulatedWorldConfig {
  std::string twin_file;   ///< The robot as it is (docs/formats.md); else as the motion has it.
  std::string bus_faults;  ///< File that disturbs the bus (docs/formats.md).
  std::string truth_log;   ///< truth_t to this LCM log.
  std::string lcm_url;     ///< truth_t live.
  TruthSink truth_sink;    ///< Called with every truth_t as it is encoded; for a flight record.
  bool paced = false;      ///< At the pace of the clock; else in virtual time.
};

/// Makes simulated robots, which are no part of the runtime: whoever has them passes them in.
struct Simulation {
  /// The drives file that a twin file names; empty where it names none. Throws FileError.
  std::function<std::string(const std::string& twin_file)> drives_file_of;
  /// The robot of a motion, behind simulated drives on a simulated bus. The motion has to outlive
  /// the world. Throws FileError about a file of the configuration, and std::runtime_error about
  /// where the truth goes.
  std::function<std::unique_ptr<World>(const SequenceFile& motion, const DrivesConfig& drives,
                                       const SimulatedWorldConfig& config)>
      make_world;
};

}  // namespace tumbler
