#pragma once

#include <string>

#include "common/core/exit_status.h"
#include "runtime/record/picture_source.h"

namespace tumbler {

/// An LCM log of a run, and what is made of it. An empty name leaves the file out.
struct LogExports {
  std::string log;
  std::string csv;  ///< `-` for standard output.
  std::string mcap;
  std::string motion;  ///< That was played, for the robot in the MCAP file.
};

/// What `tumbler record` does with an LCM log: shows it, or converts it.
/// @param pictures  of robots, for MCAP; null where the build has none, and `motion` is empty.
/// @throws FileError, std::runtime_error  naming the file.
ExitStatus ShowLog(const LogExports& options, const PictureSource* pictures);

}  // namespace tumbler
