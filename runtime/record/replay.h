#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "runtime/executor/tick.h"
#include "runtime/record/flight_record.h"

namespace tumbler {

/// The first difference of a replay from its record.
struct ReplayDifference {
  /// Number of the tick in the run, from 0 on.
  std::int64_t index = 0;
  /// The executor's tick number.
  std::int64_t tick = 0;
  /// e.g. `joint leg1: measured.position_rad`, or `joint leg1: frame 0, byte 3`
  std::string field;
  std::string recorded;
  std::string replayed;
};

/// The result of a replay.
struct ReplayResult {
  std::int64_t ticks = 0;       ///< Ticks that were replayed with identical outputs.
  std::int64_t frames_out = 0;  ///< Frames that were compared byte by byte in these ticks.
  std::int64_t frames_in = 0;   ///< Frames that were fed to the executor.
  std::optional<ReplayDifference> difference;
  /// Why some of the executed ticks could not be replayed: ticks are damaged or were lost, and
  /// without them the executor's state is unknown. Empty when nothing is missing, or when the
  /// record merely ends early.
  std::string gap;

  [[nodiscard]] bool identical() const { return !difference && gap.empty(); }
};

/// The first difference between a recorded tick and the output of an executor that was given the
/// same input. Frames are compared by identifier, kind, size and bytes, records by the bits of
/// every field.
std::optional<ReplayDifference> Compare(const TickEntry& recorded, const TickOutput& replayed,
                                        const std::vector<std::string>& joints);

/// Feeds the record's inputs to an executor with the record's configuration, from the first tick to
/// the first difference, gap or end.
/// @throws FileError or RecordError  when the configuration cannot be used.
ReplayResult Replay(FlightRecord& record);

}  // namespace tumbler
