#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "runtime/linux/control_loop.h"
#include "runtime/linux/realtime_thread.h"

namespace tumbler {

/// The simulated robot's root at the end of the motion and two seconds later, against what the
/// primitive promises.
struct StandingReport {
  double expected_pitch_rad = 0;
  std::optional<double> pitch_at_end_rad;
  std::optional<double> pitch_later_rad;  ///< Absent when the run ended earlier.
  static constexpr double kLater_s = 2;
  static constexpr double kTolerance_rad =
      0.1;  ///< A fallen robot is off by half a radian at least.

  /// Still there two seconds later. Absent when that was not seen.
  [[nodiscard]] std::optional<bool> standing() const;
};

/// Everything that is said about a run when it is over.
struct RunReport {
  std::string bus;
  std::string primitive;
  double speed = 1;
  double rate_hz = 0;
  bool dry_run = false;
  bool simulated = false;
  RunOutcome outcome = RunOutcome::kPending;
  std::string reason;  ///< Of a refusal, a fault or a stop; empty when completed.
  std::vector<std::string> joints;
  LoopStatistics statistics;
  int worst_case_tick_bits = 0;
  double worst_case_load = 0;           ///< 0 ... 1
  std::optional<double> measured_load;  ///< 0 ... 1; known of the simulated bus only.
  std::optional<StandingReport> standing;
  std::optional<RealtimeReport> realtime;
  std::int64_t lost_records = 0;
  std::int64_t unpublished_messages = 0;
  std::vector<std::string> files;
};

/// For people: several lines, ending with a line feed.
std::string ToText(const RunReport& report);
/// The same as one JSON object, units in the keys, ending with a line feed.
std::string ToJson(const RunReport& report);
/// The exit code of tumbler-run: 0 completed, 2 refused, 3 fault, 130 stopped.
int ExitCode(RunOutcome outcome);

}  // namespace tumbler
