#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "runtime/record/run_trace.h"

namespace tumbler {

/// Figures of how well one joint followed its setpoints in one run.
struct TrackingFigures {
  std::int64_t setpoints = 0;
  /// Setpoints without a reply. The last setpoint is left out: it need not be answered.
  std::int64_t missing_replies = 0;
  double error_rms_rad = 0;  ///< RMS of reply less setpoint.
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

}  // namespace tumbler
