#pragma once

#include <functional>
#include <string>
#include <vector>

#include "firmware_interface/devices/drives_toml.h"
#include "runtime/bench/bench_operator.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_world.h"

namespace tumbler {

/// What is proved of the drives before a run arms them.
struct ArmingChecks {
  /// Each drive turns its joint a little and back, one at a time. Its encoder has to show that, and
  /// no other one. Encoders cannot tell which joint a drive turns, nor its direction: somebody who
  /// looks on is asked. The velocities that are reported meanwhile have to fit the positions.
  bool identity = false;
  /// Each drive is enabled and left alone, and has to let go in its time-out (ProveWatchdog).
  bool watchdog = false;
  bool clear = false;  ///< Whether the drives are first told to forget latched errors.
  BenchBounds bounds;  ///< No motion and no torque of the checks is larger.
};

/// Carries out the checks, drive by drive in the order of the file, up to the first that fails.
/// Leaves all drives off.
/// @param joints  of the motion, among which is chosen.
/// @param say     gets a line about each drive that is as it should be.
/// @throws Refused  naming the drive and what is wrong: it does not reply, it reports an error, its
///                  encoder shows no motion, or another one does, it turns another joint, or
///                  against its axis, its velocities do not fit its positions, it has no watchdog,
///                  or another time-out than the file says.
/// @throws BenchInterrupted  after Ctrl-C, or a request towards rest.
void CheckBeforeArming(BenchWorld& world, const DrivesConfig& drives,
                       const std::vector<std::string>& joints, const ArmingChecks& checks,
                       BenchOperator& somebody, const std::function<void(const std::string&)>& say);

}  // namespace tumbler
