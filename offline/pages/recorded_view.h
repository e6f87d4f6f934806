#pragma once

#include <string>
#include <vector>

#include "common/files/json.h"

namespace tumbler {

/// A flight record for its page.
struct RecordedRun {
  Json data;
  /// Where it is damaged, what of it could not be read (FlightRecord::Remarks).
  std::vector<std::string> remarks;
};

/// Its data are those of the page for a flight record: `scene`, the robot and its surroundings,
/// `frames` (ViewedRun::Frame at up to 6001 evenly spaced ticks, in the order of time), and
/// `events`, the first 2000.
/// @throws RecordError, FileError or std::runtime_error  naming the file.
RecordedRun RecordedView(const std::string& path);

}  // namespace tumbler
