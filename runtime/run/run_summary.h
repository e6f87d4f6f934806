#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/core/exit_status.h"
#include "common/files/purpose.h"
#include "firmware_interface/can/socketcan_bus.h"
#include "runtime/assembly/machine.h"
#include "runtime/assembly/realtime_thread.h"
#include "runtime/run/control_loop.h"

namespace tumbler {

/// The simulated robot in and after a node of the sequence. "Later" is two seconds after the end of
/// the motion, or when the next node began, or when the motion had settled, if that was later.
struct Passage {
  static constexpr double kLater_s = 2;

  std::string node;
  /// What the motion is for, in the coordinates of its task: as if it had begun where its primitive
  /// begins.
  std::vector<JudgedTarget> purpose;
  bool free_root = true;  ///< Whether the root moves in the plane, or else is fixed.
  bool hinged = false;    ///< Whether it does so on a bar, where no robot stands.
  /// Whether the robot moves in space. Then the pitches below are angles between what is vertical
  /// in the root's frame and what is at the exit of the primitive, and the planned one is 0.
  bool in_space = false;
  /// Whether nothing brings the root to rest after the motion: only the purpose counts then.
  bool swings_on = false;
  /// The root's pitch by the exits and entries of the primitives.
  double expected_pitch_rad = 0;
  /// The root's pitch at the end of the motion, before it settled.
  double pitch_at_end_rad = 0;
  /// The root's pitch later; absent when the run ended before.
  std::optional<double> pitch_later_rad;
  double later_s = kLater_s;  ///< How long after the end of the motion that was.
  /// How far the pitch may be off the plan later; the sequence may allow more.
  double tolerance_rad = 0.05;

  /// Whether every target was met; absent where one was not judged and none was missed, and where
  /// there is none.
  [[nodiscard]] std::optional<bool> purpose_met() const { return AllMet(purpose); }
  /// Whether the pitch later was that of the plan; absent when the run ended before, and of a root
  /// that swings on or is fixed.
  [[nodiscard]] std::optional<bool> as_planned() const;
  /// Whether the motion is to end at rest with a pitch that its task asks for: standing, or lying
  /// on a side, which is not told apart here.
  [[nodiscard]] bool is_to_rest() const;
  /// Whether the robot did what the motion is for, or as planned where it is for nothing; absent
  /// where that was not judged. A robot whose pitch is not the planned one is never as asked.
  [[nodiscard]] std::optional<bool> as_asked() const;
  [[nodiscard]] bool amiss() const { return as_asked() == false; }
  [[nodiscard]] bool unjudged() const { return !as_asked(); }
};

/// The passages that a long run has left out, so that its memory does not grow with it.
struct PassagesLeftOut {
  std::int64_t motions = 0;
  std::int64_t amiss = 0;     ///< Of these.
  std::int64_t unjudged = 0;  ///< Likewise.
};

/// Something that a simulated robot does and should not.
struct Mishap {
  double time_s = 0;  ///< of the simulation
  std::string what;
};

/// The frames of a run on a SocketCAN interface.
struct InterfaceSummary {
  SocketCanStatistics statistics;
  CanControllerState controller = CanControllerState::kErrorActive;
  int in_flight = 0;  ///< Frames neither confirmed nor discarded, which may still go out.
};

/// Everything that is reported about a run when it is over.
struct RunSummary {
  std::string bus;
  std::string primitive;
  double speed = 1;
  double rate_hz = 0;
  bool dry_run = false;
  bool simulated = false;
  RunOutcome outcome = RunOutcome::kPending;
  std::string reason;  ///< The reason of a refusal, a fault or a stop; empty when completed.
  std::vector<std::string> joints;
  LoopStatistics statistics;
  int worst_case_tick_bits = 0;
  double worst_case_load = 0;                 ///< 0 ... 1
  std::optional<double> measured_load;        ///< 0 ... 1; on the simulated bus only.
  std::optional<InterfaceSummary> interface;  ///< Of an armed run on an interface.
  std::vector<Passage> passages;              ///< Of a simulated robot; empty otherwise.
  PassagesLeftOut left_out;                   ///< Passages that are not among them.
  /// The node whose motion had begun when the run ended, and was not played to its end; of a
  /// simulated robot, else empty.
  std::string broken_off;
  std::vector<Mishap> falls;  ///< Of a simulated robot.
  /// What becomes of a simulated robot in the 3 s after torque off; empty for others.
  std::string after_torque_off;
  std::vector<Mishap> overlaps;  ///< Of a simulated robot's own shapes, likewise.
  int cycles = 0;                ///< Complete cycles of the sequence.
  int runs = 1;                  ///< Runs started; more than one only where attended.
  bool attended = false;
  std::optional<RealtimeGrant> realtime;
  Machine machine;
  std::int64_t lost_records = 0;
  std::int64_t unpublished_messages = 0;
  std::int64_t unreadable_messages = 0;  ///< Received by LCM, and no request.
  std::int64_t refused_messages = 0;     ///< Requests to another run, or too old.
  std::int64_t recorded_ticks = 0;       ///< Ticks in the flight record, where there is one.
  std::int64_t unrecorded_ticks = 0;     ///< Ticks that are not in it.
  std::string record_problem;            ///< Why recording stopped early; empty otherwise.
  std::vector<std::string> files;
  std::vector<std::string> unwritten;  ///< Why files are not whole, e.g. `run.log: ...`.
};

/// Whether a simulated robot did what all motions of a completed run are for, and did not fall;
/// absent where one of them was not judged, or where there was none.
[[nodiscard]] std::optional<bool> AsAsked(const RunSummary& summary);

/// e.g. `completed`; a string literal.
[[nodiscard]] const char* ToString(RunOutcome outcome) noexcept;

/// Wake-up latencies and tick times as a table, with the machine that they belong to.
std::string DescribeTiming(const LoopStatistics& statistics, const Machine& machine,
                           const std::string& scheduling);

/// The same as one JSON object, with every bin, ending with a line feed.
std::string TimingToJson(const LoopStatistics& statistics, const Machine& machine,
                         const std::string& scheduling);

/// For people, in one line: how the run ended, and whether a simulated robot was as asked, such as
/// `completed; NOT as asked; walk: heading, settled: asked 1.57, got 1.31 rad (within 0.1):
/// MISSED`. Records and their pages say it.
std::string ToOutcome(const RunSummary& summary);
/// For people: several lines, ending with a line feed.
std::string ToText(const RunSummary& summary);
/// The same as one JSON object, units in the keys, ending with a line feed.
std::string ToJson(const RunSummary& summary);
/// The exit status of tumbler run. It is kAmiss when the motion was completed, but the robot fell
/// and got up, or the simulated robot fell, missed what the motion is for, or is not where the
/// primitive says, or the run ended before that could be judged, or a file of the run is not whole.
ExitStatus StatusOf(const RunSummary& summary);

}  // namespace tumbler
