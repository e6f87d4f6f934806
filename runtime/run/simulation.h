#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/files/sequence_toml.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/run/world.h"

namespace tumbler {

/// Takes the true states of a simulated robot, as LCM messages truth_t.
using TruthSink = std::function<void(std::span<const std::uint8_t>)>;

/// The options of `tumbler run sim`. An empty name leaves the file or output out.
struct SimulatedWorldConfig {
  /// File about the real robot (docs/formats.md). Without it the robot is that of the motion.
  std::string twin_file;
  std::string bus_faults;  ///< File that disturbs the bus (docs/formats.md).
  TruthSink truth_sink;    ///< Called with every encoded truth_t.
  int begin = -1;          ///< The node as at whose start the robot lies; -1: the first.
  bool paced = false;      ///< Whether time keeps the pace of the clock, or is virtual.
};

/// Makes simulated robots. They are no part of the runtime, so a program that has them passes this
/// in.
struct Simulation {
  /// Returns the drives file that a twin file names; empty where it names none. Throws FileError.
  std::function<std::string(const std::string& twin_file)> drives_file_of;
  /// Likewise the URDF that it names.
  std::function<std::string(const std::string& twin_file)> robot_file_of;
  /// Makes the robot of a motion, behind simulated drives on a simulated bus. The motion has to
  /// outlive the world. Throws FileError about a file of the configuration.
  std::function<std::unique_ptr<World>(const SequenceFile& motion, const DrivesConfig& drives,
                                       const SimulatedWorldConfig& config)>
      make_world;
  /// Returns what is to be said about the drives' damping and their loops, of robots and, with a
  /// configuration, of the simulated one. Throws FileError.
  std::function<std::vector<std::string>(const SequenceFile& motion, const DrivesConfig& drives,
                                         const SimulatedWorldConfig* config)>
      damping_notes;
};

}  // namespace tumbler
