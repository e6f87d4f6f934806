#pragma once

#include <atomic>
#include <string>

#include "common/files/sequence_toml.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/run/run_summary.h"

namespace tumbler {

/// A run on the simulated robot. An empty name leaves the file out.
struct SimulatedRunPlan {
  std::string motion;
  std::string drives;  ///< Empty: those of the twin file, else the default drives.
  std::string twin;
  std::string faults;      ///< Reactions to faults.
  std::string bus_faults;  ///< Disturbances of the bus.
  std::string branch;      ///< Taken once the cycles are done; empty: none.
  std::string from_node;   ///< With which the run begins, the robot lying as at its start.
  RunSettings settings;    ///< Its branch and beginning follow from these.
  std::string record;      ///< Where the flight record goes. The file must not exist.
};

/// The number of a branch, -1 where none is named. @throws std::invalid_argument  when the motion
/// has no such branch, or the cycles do not suit a motion that ends by itself, or goes on for ever.
int BranchOf(const SequenceFile& motion, const std::string& path, const std::string& branch,
             int cycles);

/// Plays the motion as `tumbler run sim` does with the same files, in virtual time.
/// @param stop  ends the run where it is, by an exception that nobody need look at.
/// @throws FileError, Refused and std::runtime_error  as `tumbler run` does, and
/// std::invalid_argument  as BranchOf and BeginningNamed.
RunSummary SimulateRun(const SimulatedRunPlan& plan, const std::atomic<bool>& stop);

}  // namespace tumbler
