#pragma once

#include <array>
#include <string>

#include "firmware_interface/devices/drives_toml.h"
#include "runtime/executor/executor_config.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// The file that keeps where the joints of a robot on an interface were last, below
/// $XDG_STATE_HOME or ~/.local/state; empty where neither is known.
[[nodiscard]] std::string DefaultPoseFile(const std::string& robot, const std::string& interface);

/// Reads where the joints were last, in the order of the drives. Joints that the file does not have
/// are not known, and none is where there is no file. Positions are kept at the drives' shafts, so
/// that a zero that was entered since does not count as a move.
/// @throws std::runtime_error  naming the file when it cannot be used, with what to do.
[[nodiscard]] std::array<KnownPosition, kMaxJoints> ReadKnownPose(const std::string& path,
                                                                  const DrivesConfig& drives);

/// Writes where the joints are by the last record of a run. Joints that have not been heard for
/// some ticks are left out. The file is replaced as a whole.
/// @throws std::runtime_error  when it cannot be written.
void WriteKnownPose(const std::string& path, const TickRecord& record, const DrivesConfig& drives);

}  // namespace tumbler
