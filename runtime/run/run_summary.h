#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/exit_status.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "runtime/linux/realtime_thread.h"
#include "runtime/run/control_loop.h"

namespace tumbler {

/// Where the simulated robot was when a node of the sequence was over: two seconds after the end of
/// its motion, or when the next one began.
struct Passage {
  std::string node;
  double expected_pitch_rad = 0;  ///< Of the root, by the exits and entries of the primitives.
  double pitch_at_end_rad = 0;    ///< Of the motion, before it settled.
  std::optional<double> pitch_later_rad;  ///< Absent when the run ended earlier.
  std::optional<double> pitch_rate_later_rad_s;
  double tolerance_rad = 0.05;  ///< Of the pitch then; the sequence may allow more.
  static constexpr double kLater_s = 2;
  static constexpr double kRateTolerance_rad_s = 0.05;  ///< Slower than this is at rest.

  /// Where it should be, and at rest. Absent when that was not seen.
  [[nodiscard]] std::optional<bool> standing() const;
};

/// A fall of a simulated robot.
struct Fall {
  double time_s = 0;  ///< of the simulation
  std::string what;
};

/// What became of the frames on a SocketCAN interface.
struct InterfaceSummary {
  SocketCanStatistics statistics;
  CanControllerState controller = CanControllerState::kErrorActive;
  int in_flight = 0;  ///< Neither confirmed nor discarded: they go out when the bus comes back.
};

/// Everything that is said about a run when it is over.
struct RunSummary {
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
  double worst_case_load = 0;                 ///< 0 ... 1
  std::optional<double> measured_load;        ///< 0 ... 1; known of the simulated bus only.
  std::optional<InterfaceSummary> interface;  ///< Of an armed run on an interface.
  std::vector<Passage> passages;              ///< Of a simulated robot; empty otherwise.
  std::vector<Fall> falls;                    ///< Of a simulated robot.
  int cycles = 0;                             ///< Of a sequence, complete.
  int runs = 1;                               ///< Started; more than one only where attended.
  bool attended = false;
  std::optional<RealtimeGrant> realtime;
  Machine machine;
  std::int64_t lost_records = 0;
  std::int64_t unpublished_messages = 0;
  std::int64_t recorded_ticks = 0;    ///< In the flight record, where there is one,
  std::int64_t unrecorded_ticks = 0;  ///< and those that are not.
  std::string record_problem;         ///< Why recording stopped early; empty otherwise.
  std::vector<std::string> files;
};

/// e.g. `completed`; a string literal.
[[nodiscard]] const char* ToString(RunOutcome outcome) noexcept;

/// Wake-up latencies and tick times as a table, with the machine that they belong to.
std::string DescribeTiming(const LoopStatistics& statistics, const Machine& machine,
                           const std::string& scheduling);

/// The same as one JSON object, with every bin, ending with a line feed.
std::string TimingToJson(const LoopStatistics& statistics, const Machine& machine,
                         const std::string& scheduling);

/// For people: several lines, ending with a line feed.
std::string ToText(const RunSummary& summary);
/// The same as one JSON object, units in the keys, ending with a line feed.
std::string ToJson(const RunSummary& summary);
/// How tumbler-run ends: kAmiss when the motion was completed, but the simulated robot fell or is
/// not where the primitive says.
ExitStatus StatusOf(const RunSummary& summary);

}  // namespace tumbler
