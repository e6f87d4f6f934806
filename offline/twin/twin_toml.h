#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/files/key_table.h"
#include "offline/twin/simulated_robot.h"

namespace tumbler {

/// The files that a twin file names, relative to its own folder; empty: it names none.
struct TwinSources {
  std::string motion;
  std::string drives;
  std::string robot;  ///< A URDF.
};

/// Reads only these names from a twin file, since its other keys depend on the motion's robot.
/// @throws FileError  when it is not a twin file.
TwinSources ReadTwinSources(const std::string& path);
/// A twin file and all that it names; of an empty path none. For CheckDistinct.
/// @throws FileError  when it is not a twin file.
std::vector<std::string> FilesOfTwin(const std::string& path);

/// Reads a twin file (docs/formats.md; `primitives/robots/tumbler_twin.toml` is a commented
/// example), whose joints, links and obstacles are those of `motion`.
/// @throws FileError  with file, line, key, value and allowed range.
SimulatedRobotConfig LoadTwin(const std::string& path, const SimulatedMotion& motion);
SimulatedRobotConfig ParseTwin(std::string_view text, const std::string& name,
                               const SimulatedMotion& motion);

/// The keys of the file, for docs/formats.md.
std::vector<KeyTable> TwinKeyTables();
/// Those that are others for a robot in space, for docs/space.md.
std::vector<KeyTable> SpaceTwinKeyTables();

}  // namespace tumbler
