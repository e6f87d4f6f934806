#pragma once

#include <optional>
#include <string>

#include "common/core/sequence.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/executor/executor_config.h"
#include "runtime/executor/run_procedure.h"

namespace tumbler {

/// The choices for one run, beside its files.
struct RunSettings {
  double speed = 1;       ///< 0.1 ... 1; see ExecutorConfig.
  int cycles = 0;         ///< Of a sequence; see ExecutorConfig.
  int branch = -1;        ///< Number of the branch after these cycles; see ExecutorConfig.
  int begin = -1;         ///< Node with which the run begins, by the operator; see ExecutorConfig.
  int get_ups = 0;        ///< How often a robot that falls gets up; see ExecutorConfig.
  double hold_s = 2;      ///< Hold after the motion has settled.
  double rest_s = 0.5;    ///< Rest after a move to the start; see RunProcedureConfig.
  bool attended = false;  ///< See RunProcedureConfig.
  bool clear = false;     ///< Whether the drives are to forget latched errors before arming.
  /// The end of the run, in place of that of the motion's file.
  std::optional<RunEnd> end;
  /// Whether somebody can ask for torque off: time is real. Otherwise a robot that is to be held
  /// until then is held for 2 s.
  bool operated = false;
  double start_within_rad = 1;  ///< ExecutorConfig::start_way_max_rad.
};

/// The node of that name, with which a run of this motion begins; -1 for an empty name.
/// @throws std::invalid_argument  when it cannot, with the names that are allowed.
[[nodiscard]] int BeginningNamed(const SequenceGraph<float>& graph, const std::string& name);

/// @param beginnings  of the motion.
/// @throws std::invalid_argument  when a robot is to get up, and nobody could tell how it lies.
void CheckGetUps(int get_ups, int beginnings, const DrivesConfig& drives);

/// The executor's settings for the joint of this drive: gains and temperature limit.
[[nodiscard]] JointConfig JointConfigOf(const DriveEntry& entry);

/// `ExecutorConfig::pause_ticks_max` for these drives: so many ticks are surely shorter than the
/// shortest of their watchdogs, and than 0.2 s, also where a drive has none.
[[nodiscard]] int PauseTicksMax(const DrivesConfig& drives);

/// The executor's configuration, with the default reactions to faults. A reply is stale after five
/// ticks, and after 10 ms where that is longer.
[[nodiscard]] ExecutorConfig ExecutorConfigOf(const RunSettings& settings,
                                              const DrivesConfig& drives);

/// Reads a faults file into `config`, in place of the defaults there. Positions have to be within
/// the limits of every primitive of the motion.
/// @throws FileError; `config` is then unchanged.
void LoadFaultsOf(const RunParts& parts, const std::string& path, ExecutorConfig& config);

/// The durations of the parts of the run with these drives, and how it ends.
[[nodiscard]] RunProcedureConfig ProcedureConfigOf(const RunSettings& settings,
                                                   const DrivesConfig& drives,
                                                   const SequenceGraph<float>& graph);

}  // namespace tumbler
