#pragma once

#include <stdexcept>

#include "common/sequence.h"
#include "firmware_interface/drives/drives_toml.h"

namespace tumbler {

/// A run that may not start; the message says why and what to do.
class Refused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Checks that every node's motion fits what the drives can be told, joint by joint.
/// @throws Refused naming joint, limit and range.
void CheckRanges(const Sequence<float>& sequence, const DrivesConfig& drives);

/// Says on standard error what a tick takes of the bus in the worst case.
/// @throws Refused when the rate leaves no room.
void CheckSchedule(const DrivesConfig& drives);

}  // namespace tumbler
