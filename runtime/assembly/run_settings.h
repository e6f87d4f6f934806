#pragma once

#include <string>

#include "firmware_interface/drives/drives_toml.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/core/executor_config.h"
#include "runtime/core/run_procedure.h"

namespace tumbler {

/// What is chosen for one run, beside its files.
struct RunSettings {
  double speed = 1;  ///< 0.1 ... 1, see ExecutorConfig.
  int cycles = 0;    ///< Of a sequence, see ExecutorConfig.
  int branch = -1;   ///< Number of the branch after them.
  double hold_s = 2;
  bool attended = false;
};

/// What the executor asks of this drive: the gains that the file gives it.
[[nodiscard]] JointConfig JointConfigOf(const DriveEntry& entry);

/// The executor's configuration, with the default reactions to faults.
[[nodiscard]] ExecutorConfig ExecutorConfigOf(const RunSettings& settings,
                                              const DrivesConfig& drives);

/// Reads a faults file over what `config` holds. Poses have to be within what every primitive of
/// the motion allows.
/// @throws FileError; `config` is then unchanged.
void LoadFaultsOf(const RunParts& parts, const std::string& path, ExecutorConfig& config);

/// How long the parts of the run may take with these drives.
[[nodiscard]] RunProcedureConfig ProcedureConfigOf(const RunSettings& settings,
                                                   const DrivesConfig& drives);

}  // namespace tumbler
