#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/core/sequence.h"
#include "runtime/assembly/realtime_thread.h"

namespace tumbler {

class CommandLine;
class CommandLineOption;

/// What a run is told by its command line. An empty name leaves the file or output out.
struct RunOptions {
  std::string program = "tumbler run";  ///< Whose run it is, for messages and records.
  std::string bus;
  std::string motion;
  std::string drives;
  std::string faults;
  std::string bus_faults;
  bool arm = false;
  bool realtime = false;
  bool without_realtime = false;
  bool without_watchdog = false;
  bool clear = false;
  bool check_identity = false;
  bool prove_watchdog = false;
  std::string answers;  ///< File with the answers to the questions of --check-identity.
  double moved_within_rad = 0.5;
  std::string pose_file;
  bool forget_pose = false;
  std::string doctor;         ///< The interface to examine; empty: none.
  std::optional<RunEnd> end;  ///< In place of that of the motion's file.
  double start_within_rad = 1;
  RealtimeConfig scheduling;
  double latency_test_s = 0;
  double rate_hz = 1000;  ///< Of the loop in the latency test.
  bool attended = false;
  double speed = 1;
  double pace = 1;
  double hold_s = 2;
  int cycles = 0;
  std::string branch;
  std::string from;  ///< Node with which the run begins, by the operator's word.
  int get_ups = 0;   ///< How often a robot that has fallen gets up.
  std::string log;
  std::string lcm_url;
  std::string key;    ///< File with the key of requests for motion.
  std::string robot;  ///< Its name in messages; that of this computer unless given.
  std::string json;
  std::string trace;
  std::string twin;
  std::string truth;
  std::string mcap;
  std::string candump;
  std::string record;
  std::vector<std::string> command_line;
  /// Whether a recorded request ends a sequence that goes round, where no cycles are given.
  bool ended_by_record = false;

  /// The files that a run writes tick by tick; names may be empty.
  [[nodiscard]] std::vector<std::string> files() const {
    return {log, trace, record, truth, mcap, candump};
  }
  /// Whether the run is on the simulated bus.
  [[nodiscard]] bool simulated() const { return bus == "sim"; }
  /// Whether the run is for an interface, but does not touch it.
  [[nodiscard]] bool dry_run() const { return !simulated() && !arm; }
  /// Whether the run turns motors.
  [[nodiscard]] bool drives_motors() const { return !simulated() && arm; }
  /// Whether something is proved of the drives before the run arms.
  [[nodiscard]] bool checks_drives() const { return check_identity || prove_watchdog; }
  /// Whether time is virtual: the run goes as fast as it can.
  [[nodiscard]] bool virtual_time() const { return dry_run() || (simulated() && !realtime); }
  /// The scheduling that was asked for, with this period.
  [[nodiscard]] RealtimeConfig SchedulingAt(std::int64_t period_ns) const {
    RealtimeConfig config = scheduling;
    config.period_ns = period_ns;
    return config;
  }
};

/// The names of two options of DeclareArming, until TakeArming has made values of them.
struct ArmingNames {
  std::string scheduling = "fifo";
  std::string end;
};

/// Declares the options of a run that may drive motors, alike in every program that has one: how
/// it is scheduled, what is checked and proved before the drives are armed, what happens on faults
/// and in the end, and where it can be stopped.
/// @param needed  the option without which these have no use; null: there is none.
void DeclareArming(CommandLine& line, RunOptions& options, ArmingNames& names,
                   const CommandLineOption* needed = nullptr);
/// Completes these options when the line has been parsed.
/// @throws UsageError, std::runtime_error  about options that do not go together.
void TakeArming(const CommandLine& line, const ArmingNames& names, RunOptions& options);

/// Reads the command line of tumbler run, and makes the checks that do not depend on the motion.
/// @throws UsageError, HelpWanted; std::runtime_error saying what to change.
[[nodiscard]] RunOptions ReadRunOptions(int argc, char** argv);

/// Checks that the options suit each other and this motion.
/// @throws std::runtime_error saying what to change; FileError  when it would be played for ever.
void CheckOptions(const RunOptions& options, const SequenceFile& file);

}  // namespace tumbler
