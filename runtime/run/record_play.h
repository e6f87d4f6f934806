#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "runtime/assembly/operator_mailbox.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/record_configuration.h"
#include "runtime/run/run_options.h"
#include "runtime/run/run_summary.h"

namespace tumbler {

/// A wish of the operator while the motion was played.
struct RecordedWish {
  std::int64_t offset = 0;  ///< Ticks since the first tick of the motion.
  OperatorWish wish;
};

/// The wishes of the operator of a recorded run while the motion was played, in order.
[[nodiscard]] std::vector<RecordedWish> WishesOf(FlightRecord& record);

/// A recorded run that is to be played on a bus.
struct RecordToPlay {
  std::string name;  ///< The file of the record, for messages.
  RecordConfiguration configuration;
  std::vector<RecordedWish> wishes;  ///< Of the operator, which are repeated at their ticks.
  std::string primitive;  ///< Played instead of the recorded motion; empty: the recorded one.
  /// Whether an option is on the command line; see RunSource.
  std::function<bool(const std::string& option)> given;
};

/// Plays a recorded motion as PlayRun plays one from files: with the drives, the checks and the
/// settings of the command line, which the record can only make stricter (SettingsToRepeat).
/// @param options  of the command line. The recorded motion, its cycles and its speed replace those
///                 there; without a drives file, a dry run takes that of the record.
/// @returns nothing when somebody has interrupted the proofs before the run.
/// @throws Refused when a check fails; FileError, RecordError, UsageError, std::runtime_error.
[[nodiscard]] std::optional<RunSummary> PlayRecord(const RecordToPlay& record, RunOptions options);

}  // namespace tumbler
