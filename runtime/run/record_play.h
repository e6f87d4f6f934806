#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/core/run_procedure.h"
#include "runtime/linux/operator_mailbox.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/record_configuration.h"

namespace tumbler {

/// How a recorded run is played on a bus; empty names leave that out.
struct RecordPlayOptions {
  std::string bus;        ///< The SocketCAN interface.
  std::string primitive;  ///< Played instead of the recorded motion.
  std::string drives;     ///< The drives file of the bus, where it is not that of the record.
  bool arm = false;       ///< Drives the motors; otherwise a dry run.
  bool realtime = false;
  bool without_realtime = false;
};

/// What the operator wanted while the motion was played, by ticks since its first.
struct RecordedWish {
  std::int64_t offset = 0;
  OperatorWish wish;
};

/// What the operator of a recorded run asked for while the motion was played.
[[nodiscard]] std::vector<RecordedWish> WishesOf(FlightRecord& record);

/// The record's configuration with what the options change of it.
/// @throws FileError; std::runtime_error about options that do not fit the record.
[[nodiscard]] RecordConfiguration ConfigurationToPlay(const RecordConfiguration& recorded,
                                                      const RecordPlayOptions& options);

/// How the play of a record ended.
struct PlayedRecord {
  RunOutcome outcome = RunOutcome::kPending;
  std::string reason;  ///< Of a fault or a refusal.
};

/// Runs the configuration on the bus and records it.
/// @param record_file  must not exist.
/// @throws Refused where a check fails; FileError, RecordError, std::runtime_error.
PlayedRecord PlayRecord(const RecordConfiguration& configuration,
                        const std::vector<RecordedWish>& wishes, const RecordPlayOptions& options,
                        const std::string& record_file);

}  // namespace tumbler
