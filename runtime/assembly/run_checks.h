#pragma once

#include "common/program.h"
#include "common/sequence.h"
#include "firmware_interface/drives/drives_toml.h"

namespace tumbler {

/// Checks that the motion of every node fits the ranges of the drives, joint by joint.
/// @throws Refused naming joint, limit and range.
void CheckRanges(const Sequence<float>& sequence, const DrivesConfig& drives);

/// Prints on standard error how much of the bus a tick takes in the worst case.
/// @throws Refused  when the rate leaves no room for an error.
void CheckSchedule(const DrivesConfig& drives);

}  // namespace tumbler
