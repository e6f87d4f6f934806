#pragma once

#include <string>

#include "common/files/json.h"

namespace tumbler {

/// The data of the page for a flight record: `scene`, the robot and its surroundings, `frames`
/// (ViewedRun::Frame at up to 6001 evenly spaced ticks, in the order of time), and
/// `events`, the first 2000.
/// @throws RecordError, FileError or std::runtime_error  naming the file.
Json RecordedView(const std::string& path);

}  // namespace tumbler
