#pragma once

#include <limits>
#include <string>
#include <vector>

#include "offline/rehearsal/flight_report/run_data.h"
#include "offline/report/page_file.h"

namespace tumbler {

/// How much of a run its page has.
struct FlightReportOptions {
  /// Ticks of each run, evenly spaced, and of those between, the ones that stand out: the events',
  /// and in each interval that of the largest following error and the oldest reply. All figures
  /// are of all ticks.
  std::size_t ticks_max = 4000;
  /// Only this part of the runs is shown, in the time of the page; figures are of all ticks.
  double from_s = -std::numeric_limits<double>::infinity();
  double to_s = std::numeric_limits<double>::infinity();

  [[nodiscard]] bool Shows(double time_s) const { return time_s >= from_s && time_s <= to_s; }
};

/// What the page of these runs is made of: their scene, ticks, robots, events, latencies, and how
/// the others differ from the first. Every number of a tick is the record's: as a float it has the
/// same bits.
/// @throws std::runtime_error naming the file that shows another robot than the first, or that has
/// nothing in the part to be shown;
/// std::invalid_argument naming a field that is not finite.
PageJson FlightReportJson(const std::vector<RunData>& runs,
                          const FlightReportOptions& options = {});

/// Writes `DIR/index.html`, one page that needs no network, and creates DIR where it is missing.
/// @returns the page's path. @throws as FlightReportJson; std::runtime_error with the path when it
/// cannot be written.
std::string WriteFlightReport(const std::vector<RunData>& runs, const std::string& directory,
                              const FlightReportOptions& options = {});

}  // namespace tumbler
