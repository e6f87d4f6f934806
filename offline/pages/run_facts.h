#pragma once

#include <string_view>

#include "offline/pages/run_data.h"
#include "runtime/record/flight_record.h"

namespace tumbler {

/// Adds the facts of a run, for people.
/// @param run     complete but for them.
/// @param record  the run's, read to its end.
void AddFacts(RunData& run, const FlightRecord& record, std::string_view motion_name);

}  // namespace tumbler
