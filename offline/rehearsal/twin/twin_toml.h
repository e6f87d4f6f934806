#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/key_table.h"
#include "offline/rehearsal/twin/simulated_robot.h"

namespace tumbler {

/// Files that a twin file names, relative to its own folder; empty where it names none.
struct TwinSources {
  std::string motion;
  std::string drives;
};

/// Reads no more than that of a twin file: what else it says is about the robot of the motion.
/// @throws FileError when it is not a twin file.
TwinSources ReadTwinSources(const std::string& path);

/// Reads a twin file (docs/formats.md; `primitives/robots/tumbler_twin.toml` is a commented
/// example), whose joints, links and obstacles are those of `motion`.
/// @throws FileError with file, line, key, value and allowed range.
SimulatedRobotConfig LoadTwin(const std::string& path, const SimulatedMotion& motion);
SimulatedRobotConfig ParseTwin(std::string_view text, const std::string& name,
                               const SimulatedMotion& motion);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> TwinKeyTables();

}  // namespace tumbler
