#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <tumbler/space_truth_t.hpp>

namespace tumbler {

/// A message truth_t or space_truth_t, and the time at which it was logged.
struct LoggedTruth {
  std::int64_t utime_us = 0;  ///< Since 1970, or since the start of a run in virtual time.
  space_truth_t truth;
};

/// All messages of an LCM log on channel TUMBLER_TRUTH.
/// @throws std::runtime_error  naming the file, when it cannot be read, has no such message, or has
/// a damaged one.
std::vector<LoggedTruth> ReadTruthLog(const std::string& path);

/// The positions of joints without a motor, by their names. Empty where one of them is not told, as
/// by truths that were made before they had such joints.
std::vector<double> PassiveOf(const truth_t& truth, const std::vector<std::string>& names);

}  // namespace tumbler
