#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/core/run_procedure.h"
#include "runtime/linux/operator_mailbox.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {

/// Options for playing a recorded run on a bus.
struct RecordPlayOptions {
  std::string bus;        ///< The SocketCAN interface.
  std::string primitive;  ///< Played instead of the recorded motion; empty: the recorded one.
  std::string drives;     ///< The drives file of the bus; empty: that of the record.
  bool arm = false;       ///< Whether to drive the motors; otherwise it is a dry run.
  bool realtime = false;
  bool without_realtime = false;
};

/// A wish of the operator while the motion was played.
struct RecordedWish {
  std::int64_t offset = 0;  ///< Ticks since the first tick of the motion.
  OperatorWish wish;
};

/// The wishes of the operator of a recorded run while the motion was played, in order.
[[nodiscard]] std::vector<RecordedWish> WishesOf(FlightRecord& record);

/// The record's configuration with the changes of the options.
/// @throws FileError; std::runtime_error about options that do not fit the record.
[[nodiscard]] RecordConfiguration ConfigurationToPlay(const RecordConfiguration& recorded,
                                                      const RecordPlayOptions& options);

/// The outcome of playing a record.
struct PlayedRecord {
  RunOutcome outcome = RunOutcome::kPending;
  std::string reason;  ///< A sentence about a fault or a refusal.
};

/// Runs the configuration on the bus and records the run.
/// @param record_file  must not exist.
/// @throws Refused when a check fails; FileError, RecordError, std::runtime_error.
PlayedRecord PlayRecord(const RecordConfiguration& configuration,
                        const std::vector<RecordedWish>& wishes, const RecordPlayOptions& options,
                        const std::string& record_file);

}  // namespace tumbler
