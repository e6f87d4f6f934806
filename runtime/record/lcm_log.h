#pragma once

#include <cstdint>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <string>

namespace tumbler {

/// How much of a log could be read.
struct LogReading {
  std::int64_t lost_bytes = 0;  ///< That belong to no event, or to one that is damaged or cut off.
  std::int64_t first_lost = 0;  ///< The place of the first of them, from the log's begin.
};

/// Calls `take` for every event of an LCM log. Behind a damaged event it goes on with the next that
/// can be found.
/// @throws FileError  when the log cannot be read, or is a device.
LogReading ForEachLogEvent(const std::string& path,
                           const std::function<void(const lcm::LogEvent& event)>& take);

}  // namespace tumbler
