#pragma once

#include <functional>
#include <optional>
#include <string>

#include "common/core/exit_status.h"
#include "common/files/toml_reader.h"
#include "runtime/record/picture_source.h"
#include "runtime/record/record_configuration.h"
#include "runtime/run/control_loop.h"
#include "runtime/run/run_options.h"
#include "runtime/run/run_summary.h"
#include "runtime/run/simulation.h"

namespace tumbler {

/// Where a run comes from, beside its options. The default: from the files that they name.
struct RunSource {
  /// Reads the files of the motion, and of the drives; empty: from the file system.
  FileReader motion, drives;
  /// The run that is repeated; null: none is. It has to outlive the run.
  const RecordConfiguration* recorded = nullptr;
  std::string record_name;  ///< The file of its record, for messages.
  /// Of a repetition: whether an option is on the command line. It decides then.
  std::function<bool(const std::string& option)> given;
  std::function<void(const ControlLoop&)> each_tick;  ///< Called after every tick; may be empty.
};

/// The one way to a run, and so to armed drives, for every program that plays a motion: checks
/// everything that can refuse the run, schedules the thread, reads the pose file, opens the bus,
/// proves the drives, plays, and writes the pose and the files of the run. The bus is not touched
/// before everything that needs no bus was checked.
/// @param simulation  makes the bus `sim`; null where there is none.
/// @param pictures    of robots, for MCAP; null where there are none.
/// @returns nothing when somebody has interrupted the proofs before the run.
/// @throws Refused; FileError, UsageError and other exceptions about what cannot be used.
[[nodiscard]] std::optional<RunSummary> PlayRun(RunOptions options, const Simulation* simulation,
                                                const RunSource& source = {},
                                                const PictureSource* pictures = nullptr);

/// The program tumbler run (docs/runtime.md): reads the command line, runs, and reports the
/// outcome. Throws as RunProgram (common/files/program.h) expects it.
/// @param simulation, pictures  as for PlayRun; null where the build has none.
ExitStatus PlayMotion(int argc, char** argv, const Simulation* simulation,
                      const PictureSource* pictures);

}  // namespace tumbler
