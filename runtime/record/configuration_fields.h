#pragma once

#include <type_traits>

#include "runtime/executor/executor_config.h"
#include "runtime/executor/run_procedure.h"

namespace tumbler {

/// What becomes of a recorded number when its run is played again
/// (runtime/run/repeated_settings.h).
enum class Repetition {
  kOfMotion,         ///< It belongs to the motion that was played, and is taken from the record.
  kOfNow,            ///< The drives, the pose file or the program of now say it.
  kOfNowAndSaid,     ///< Likewise, and the operator is told where the record's is another.
  kGreaterIsMilder,  ///< A setting of safety: of the two the smaller holds.
  kSmallerIsMilder,  ///< A setting of safety: of the two the greater holds.
  kPoseLimit,        ///< As kGreaterIsMilder; the default says that no pose was known.
  kWordOfThatDay,    ///< The operator's word about the robot, which has to be given again.
  kEnd,              ///< Part of how the run ends, which is compared as a whole.
};

/// A number of a configuration, as records name it.
struct ConfigField {
  const char* key;
  Repetition repetition = Repetition::kOfNow;
  /// Option of the command line that says it, e.g. `--faults`; empty: there is none.
  const char* option = "";
  /// Whether records may lack it, since runs did not have it from the beginning.
  bool may_lack = false;
};

// Each number of a run's configuration is described once, here: records write and read by these
// lists, and a run that is played again follows them. A member that is added to one of these types
// has to be added below, or a replay would lack it.
static_assert(sizeof(JointConfig) == 16);
static_assert(sizeof(KnownPosition) == 12);
static_assert(sizeof(CollapseConfig) == 8 + kMaxJoints * sizeof(float));
static_assert(sizeof(ExecutorConfig) ==
              60 + kMaxJoints * (sizeof(KnownPosition) + sizeof(JointConfig)) + sizeof(FaultTable) +
                  sizeof(CollapseConfig));
static_assert(sizeof(RunProcedureConfig) == 96);

/// Calls `visit(field, value)` for every number of a configuration, with a ConfigField.
template <typename Config, typename Visit>
requires std::is_same_v<std::remove_const_t<Config>, JointConfig>
void VisitNumbers(Config& config, const Visit& visit) {
  constexpr Repetition kDrives = Repetition::kOfNowAndSaid;
  visit(ConfigField{"kp_nm_per_rad", kDrives, "--drives"}, config.kp_nm_per_rad);
  visit(ConfigField{"kd_nm_s_per_rad", kDrives, "--drives"}, config.kd_nm_s_per_rad);
  visit(ConfigField{"damping_nm_s_per_rad", kDrives, "--drives"}, config.damping_nm_s_per_rad);
  visit(ConfigField{"temperature_max_c", kDrives, "--drives"}, config.temperature_max_c);
}

template <typename Config, typename Visit>
requires std::is_same_v<std::remove_const_t<Config>, KnownPosition>
void VisitNumbers(Config& config, const Visit& visit) {
  visit(ConfigField{"known", Repetition::kOfNow, "--pose"}, config.known);
  visit(ConfigField{"position_rad", Repetition::kOfNow, "--pose"}, config.position_rad);
  visit(ConfigField{"turn_rad", Repetition::kOfNow, "--pose"}, config.turn_rad);
}

template <typename Config, typename Visit>
requires std::is_same_v<std::remove_const_t<Config>, ExecutorConfig>
void VisitNumbers(Config& config, const Visit& visit) {
  constexpr Repetition kGreater = Repetition::kGreaterIsMilder;
  visit(ConfigField{"period_s", Repetition::kOfNow, "--drives"}, config.period_s);
  visit(ConfigField{"speed", kGreater}, config.speed);
  visit(ConfigField{"move_fraction", kGreater}, config.move_fraction);
  visit(ConfigField{"torque_rise_s", Repetition::kSmallerIsMilder}, config.torque_rise_s);
  visit(ConfigField{"stale_ticks_max", kGreater, "--faults"}, config.stale_ticks_max);
  visit(ConfigField{"sequence_errors_max", kGreater, "--faults"}, config.sequence_errors_max);
  visit(ConfigField{"late_ticks_max", kGreater, "--faults"}, config.late_ticks_max);
  visit(ConfigField{"arming_ticks_max", kGreater, "--faults"}, config.arming_ticks_max);
  visit(ConfigField{"pause_ticks_max", Repetition::kOfNow, "--drives", true},
        config.pause_ticks_max);
  visit(ConfigField{"start_way_max_rad", kGreater, "--start-within", true},
        config.start_way_max_rad);
  visit(ConfigField{"moved_max_rad", Repetition::kPoseLimit, "--moved-within", true},
        config.moved_max_rad);
  visit(ConfigField{"cycles", Repetition::kOfMotion}, config.cycles);
  visit(ConfigField{"branch", Repetition::kOfMotion}, config.branch);
  visit(ConfigField{"begin", Repetition::kWordOfThatDay, "--from", true}, config.begin);
  visit(ConfigField{"get_ups_max", kGreater, "--get-ups", true}, config.get_ups_max);
}

template <typename Config, typename Visit>
requires std::is_same_v<std::remove_const_t<Config>, RunProcedureConfig>
void VisitNumbers(Config& config, const Visit& visit) {
  constexpr Repetition kEnd = Repetition::kEnd;
  visit(ConfigField{"hold_ticks", Repetition::kOfMotion}, config.hold_ticks);
  visit(ConfigField{"reply_ticks_max", Repetition::kOfNow}, config.reply_ticks_max);
  visit(ConfigField{"start_ticks_max", Repetition::kOfNow}, config.start_ticks_max);
  visit(ConfigField{"rest_ticks", Repetition::kOfNow, "", true}, config.rest_ticks);
  visit(ConfigField{"stop_hold_ticks", Repetition::kOfNow}, config.stop_hold_ticks);
  visit(ConfigField{"fault_ticks", Repetition::kOfNow}, config.fault_ticks);
  visit(ConfigField{"lower_ticks", kEnd, "--end", true}, config.lower_ticks);
  visit(ConfigField{"end_hold_ticks", kEnd, "--end", true}, config.end_hold_ticks);
  // The nodes are those of the motion that is played now, which need not be the recorded one.
  visit(ConfigField{"safe_nodes", Repetition::kOfNow, "", true}, config.safe_nodes);
  visit(ConfigField{"go_home", kEnd, "--end", true}, config.go_home);
  visit(ConfigField{"clear_ticks", Repetition::kOfNowAndSaid, "--clear", true}, config.clear_ticks);
  visit(ConfigField{"disarmed_ticks", Repetition::kOfNow}, config.disarmed_ticks);
  // A run that is played again is one run, which whoever starts the program begins.
  visit(ConfigField{"attended", Repetition::kOfNow}, config.attended);
}

template <typename Config, typename Visit>
requires std::is_same_v<std::remove_const_t<Config>, CollapseConfig>
void VisitNumbers(Config& config, const Visit& visit) {
  visit(ConfigField{"stiffness", Repetition::kGreaterIsMilder, "--faults"}, config.stiffness);
}

}  // namespace tumbler
