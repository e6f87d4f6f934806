#pragma once

#include <functional>
#include <string>
#include <vector>

#include "runtime/assembly/run_parts.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/executor/executor_config.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {

/// A setting of safety that was milder when a run was recorded than it is now.
struct MilderSetting {
  std::string name;      ///< e.g. `start_way_max_rad`, or `reactions: following error`
  std::string recorded;  ///< Its value in the record.
  std::string now;       ///< Its value by the command line and the defaults.
  std::string option;    ///< The option that says it; empty: there is none.
};

/// The settings of a run that repeats a recorded one.
struct RepeatedSettings {
  ExecutorConfig executor;
  RunProcedureConfig procedure;
  /// What the record has milder, and no option says. Nothing of it is in force.
  std::vector<MilderSetting> milder;
  /// Sentences about what the record has otherwise, and is not a question of milder or stricter.
  std::vector<std::string> notes;
};

/// Takes from a record what belongs to its motion. Settings of safety are those of now, by the
/// command line and the defaults; where the record has a stricter one that no option says, the
/// record's holds. What becomes of each number stands in runtime/record/configuration_fields.h.
/// Of two reactions the stricter one is the stronger, in every state; `abort` may be anything from
/// hold to damp. Of two ends of a run it is the one that lets the robot down less: torque off,
/// lower, hold or safe.
/// @param executor  as the command line and the defaults have it.
/// @param settings  likewise, for the procedure.
/// @param given     whether an option, e.g. `--faults`, is on the command line: it decides then,
///                  whatever the record has.
[[nodiscard]] RepeatedSettings SettingsToRepeat(
    const RecordConfiguration& recorded, const ExecutorConfig& executor, RunSettings settings,
    const RunParts& parts, const std::function<bool(const std::string& option)>& given);

/// A refusal that names each of these settings, with both values and the option that says it.
[[nodiscard]] std::string DescribeMilder(const std::string& record,
                                         const std::vector<MilderSetting>& milder);

}  // namespace tumbler
