#pragma once

#include <functional>
#include <string>

#include "common/core/sequence.h"
#include "common/files/program.h"
#include "common/files/sequence_toml.h"
#include "firmware_interface/can/can_link.h"
#include "firmware_interface/devices/drives_toml.h"

namespace tumbler {

/// Checks that the motion of every node fits the ranges of the drives, joint by joint.
/// @throws Refused naming every joint, limit and range that do not fit.
void CheckRanges(const Sequence<float>& sequence, const DrivesConfig& drives);

/// Checks that the bus has room for every tick.
/// @param say  gets a sentence about how much of the bus a tick takes in the worst case.
/// @throws Refused  when the rate leaves no room for an error.
void CheckSchedule(const DrivesConfig& drives, const std::function<void(const std::string&)>& say);

/// Compares the gains of the drives with those with which the motion was found (GainsOf).
/// @param say  gets a sentence about each joint whose gains are others.
void CompareGains(const SequenceFile& motion, const DrivesConfig& drives,
                  const std::function<void(const std::string&)>& say);

/// Checks that each drive's watchdog bears three ticks of the loop, since one that expires between
/// setpoints lets the drive go again and again.
/// @param may_be_none  whether drives without a watchdog are allowed.
/// @throws Refused naming the joint.
void CheckWatchdogs(const DrivesConfig& drives, bool may_be_none);

/// Checks that the transmit queue of an interface has room for a frame to each drive, as every tick
/// sends one to all of them at once.
/// @throws Refused  with the command that makes it long enough.
void CheckQueue(const std::string& interface, const CanLink& link, const DrivesConfig& drives);

}  // namespace tumbler
