#pragma once

#include <string>
#include <vector>

#include "runtime/bench/commission.h"

namespace tumbler {

/// The command line of tumbler bench. An empty name leaves the file or output out.
struct BenchOptions {
  std::string bus;
  std::string command;  ///< The subcommand.
  std::string motion;
  std::string drives;
  std::string actual;      ///< sim: the drives as they are.
  std::string bus_faults;  ///< sim
  std::vector<std::string> positions;
  bool arm = false;
  bool ask = false;
  bool yes = false;
  bool clear = false;
  std::string answers;
  std::string json;
  std::string write;
  bool overwrite = false;
  std::string page;
  std::string joint;  ///< Of the commands that are about one drive; empty: all of them.
  double by_rad = 0.1;
  std::vector<double> at_rad;  ///< One angle, or none.
  bool in_drive = false;
  bool without_turning = false;
  CommissionConfig config;

  [[nodiscard]] bool simulated() const { return bus == "sim"; }
  /// Whether the command turns motors, or changes what drives hold.
  [[nodiscard]] bool moves() const {
    return command == "identify" || command == "jog" || command == "step" ||
           command == "watchdog" || command == "check" || command == "commission" ||
           (command == "zero" && in_drive);
  }
};

/// Reads the command line. @throws UsageError, HelpWanted; Refused without --arm;
/// std::runtime_error saying what to change.
[[nodiscard]] BenchOptions ReadBenchOptions(int argc, char** argv);

}  // namespace tumbler
