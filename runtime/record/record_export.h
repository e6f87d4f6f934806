#pragma once

#include <cstdint>
#include <string>

#include "runtime/record/flight_record.h"

namespace tumbler {

/// Writes all frames of a record as `candump -l` logs them: sent frames at the time they were
/// handed to the bus, received ones at that of their arrival, by time. Times are since 1970, or,
/// of a run in virtual time, since its start. @returns the number of frames.
/// @throws RecordError naming the file that cannot be written.
std::int64_t ExportCandump(FlightRecord& record, const std::string& path);

/// Writes the ticks of a record as tumbler-run's `--trace` and `--log` do (either name may be
/// empty). @returns the number of ticks. @throws std::runtime_error likewise.
std::int64_t ExportTelemetry(FlightRecord& record, const std::string& csv_path,
                             const std::string& lcm_path);

/// What a record holds, in several lines for people.
std::string Summary(FlightRecord& record);

}  // namespace tumbler
