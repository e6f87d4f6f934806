#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "runtime/core/tick.h"
#include "runtime/record/flight_record.h"

namespace tumbler {

/// Where a replay first differs from its record.
struct ReplayDifference {
  std::int64_t index = 0;  ///< Ticks of the run before this one.
  std::int64_t tick = 0;
  std::string
      field;  ///< e.g. `joint leg1: measured.position_rad`, or `joint leg1: frame 0, byte 3`
  std::string recorded;
  std::string replayed;
};

/// What became of a replay.
struct ReplayResult {
  std::int64_t ticks = 0;       ///< Replayed with identical outputs.
  std::int64_t frames_out = 0;  ///< Compared byte by byte, in these ticks.
  std::int64_t frames_in = 0;   ///< Fed.
  std::optional<ReplayDifference> difference;
  /// Why not all ticks that were executed could be replayed: some are damaged or were lost, and
  /// without them the executor's state is unknown. Empty when nothing is missing, and when the
  /// record merely ends early.
  std::string gap;

  [[nodiscard]] bool identical() const { return !difference && gap.empty(); }
};

/// The first difference between what was recorded of a tick and what an executor made of its
/// input: frames by identifier, kind, size and bytes, the record by the bits of every field.
std::optional<ReplayDifference> Compare(const TickEntry& recorded, const TickOutput& replayed,
                                        const std::vector<std::string>& joints);

/// Feeds the record's inputs to an executor with the record's configuration, from the first tick to
/// the first difference, gap or end. @throws FileError or RecordError when the configuration cannot
/// be used.
ReplayResult Replay(FlightRecord& record);

}  // namespace tumbler
