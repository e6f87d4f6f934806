#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/candump.h"
#include "runtime/record/flight_record.h"

namespace tumbler {

/// A setpoint of one joint, and the reply to it.
struct TraceSample {
  std::int64_t tick = 0;  ///< Ticks since the run began; in a log, the number of the setpoint.
  double time_s = 0;      ///< Time since the run began.
  double setpoint_rad = 0;
  std::optional<double> reply_rad;  ///< The position in the first reply before the next setpoint.
  std::optional<double> delay_s;    ///< Time from handing the setpoint to the bus to that reply.
};

/// Setpoints and replies of one run.
struct RunTrace {
  std::string name;
  std::vector<std::string> joints;
  std::vector<std::vector<TraceSample>> samples;  ///< For each joint, in the order of time.
};

/// The trace of a flight record: from the first tick in state running until the executor neither
/// runs, settles nor holds any more.
RunTrace TraceOf(FlightRecord& record, const DrivesConfig& drives);

/// The trace of frames alone. It has every setpoint that asks for position control.
/// @throws std::runtime_error  when one of the drives has no such setpoint.
RunTrace TraceOf(const std::vector<CandumpFrame>& frames, const DrivesConfig& drives,
                 const std::string& name);

}  // namespace tumbler
