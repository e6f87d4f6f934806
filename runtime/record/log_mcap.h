#pragma once

#include <functional>
#include <string>
#include <vector>

#include "runtime/record/robot_picture.h"

namespace tumbler {

/// An LCM log to be written as MCAP.
struct LogMcapConfig {
  std::string log;
  std::string mcap;
  /// The robot of a run with these joints; empty: the file has no frames and no scene.
  std::function<RobotPicture(const std::vector<std::string>& joints)> robot_of;
};

/// Writes the telemetry of an LCM log as MCAP (RunMcap), whoever logged it. Times are those of the
/// log. Messages that cannot be decoded, and those on other channels, are left out.
/// @throws std::runtime_error or FileError  naming the file that cannot be used or written. There
/// is no new file then.
void ExportLogMcap(const LogMcapConfig& config);

}  // namespace tumbler
