#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "runtime/record/flight_record.h"
#include "runtime/record/picture_source.h"

namespace tumbler {

/// Writes a flight record as MCAP (RunMcap).
/// @param program  that writes it, with its version.
/// @param picture  of its robot, with its plan; none: the file has no frames and no scene.
/// @returns the number of ticks.
/// @throws RecordError or FileError  naming the file that cannot be used or written. There is no
/// new file then.
std::int64_t ExportMcap(FlightRecord& record, const std::string& path, const std::string& program,
                        const std::optional<RecordPicture>& picture);

}  // namespace tumbler
