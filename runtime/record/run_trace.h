#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "firmware_interface/drives/drives_toml.h"
#include "runtime/linux/candump.h"
#include "runtime/record/flight_record.h"

namespace tumbler {

/// A setpoint of one joint, and the reply to it.
struct TraceSample {
  std::int64_t tick = 0;  ///< Ticks since the run began; in a log, the number of the setpoint.
  double time_s = 0;      ///< Since the run began.
  double setpoint_rad = 0;
  std::optional<double> reply_rad;  ///< Measured in the first reply before the next setpoint.
  std::optional<double> delay_s;    ///< From handing the setpoint to the bus to that reply.
};

/// Setpoints and replies of one run.
struct RunTrace {
  std::string name;
  std::vector<std::string> joints;
  std::vector<std::vector<TraceSample>> samples;  ///< Of each joint, by time.
};

/// The trace of a flight record: from the first tick in state running until the executor neither
/// runs, settles nor holds any more.
RunTrace TraceOf(FlightRecord& record, const DrivesConfig& drives);

/// The trace of frames alone: every setpoint that asks for position control.
/// @throws std::runtime_error  when one of the drives has no such setpoint.
RunTrace TraceOf(const std::vector<CandumpFrame>& frames, const DrivesConfig& drives,
                 const std::string& name);

/// How well one joint followed, in one run.
struct TrackingFigures {
  std::int64_t setpoints = 0;
  std::int64_t missing_replies = 0;  ///< The last setpoint is not expected to be answered.
  double error_rms_rad = 0;          ///< Of reply less setpoint.
  double error_max_rad = 0;
  double delay_p50_s = 0;
  double delay_p99_s = 0;
  double delay_max_s = 0;
};
TrackingFigures FiguresOf(std::span<const TraceSample> samples);

/// A comparison of the same joint in two runs, tick by tick.
struct TraceComparison {
  std::int64_t ticks = 0;                ///< Ticks that both runs have.
  std::int64_t different_setpoints = 0;  ///< Of these, ticks with setpoints over 1e-6 rad apart.
  double setpoint_max_rad = 0;           ///< Largest difference of setpoints.
  std::int64_t replies = 0;              ///< Ticks that were answered in both runs.
  double reply_rms_rad = 0;              ///< RMS of the differences of replies.
  double reply_max_rad = 0;              ///< Largest difference of replies.
};
TraceComparison Compare(std::span<const TraceSample> a, std::span<const TraceSample> b);

/// The figures of a run for people, a line for each joint.
std::string Describe(const RunTrace& trace);
/// The comparison of two runs of the same joints for people, a line for each joint.
std::string DescribeDifference(const RunTrace& recorded, const RunTrace& played);

/// Draws setpoints, replies and errors of one run or two, a column for each joint.
/// @throws RecordError naming the file that cannot be written.
void WriteSvg(const RunTrace& first, const RunTrace* second, const std::string& path);

}  // namespace tumbler
