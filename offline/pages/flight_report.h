#pragma once

#include <limits>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "offline/pages/page_file.h"
#include "offline/pages/run_data.h"

namespace tumbler {

/// The part of each run that the page shows. Figures are always computed from all ticks.
struct FlightReportOptions {
  /// Number of evenly spaced ticks that are shown of each run. Ticks between them are shown when
  /// they stand out: ticks with events, and in each interval the ticks with the largest following
  /// error and the oldest reply.
  std::size_t ticks_max = 4000;
  /// The interval that is shown, in the time of the page.
  double from_s = -std::numeric_limits<double>::infinity();
  double to_s = std::numeric_limits<double>::infinity();

  [[nodiscard]] bool Shows(double time_s) const { return time_s >= from_s && time_s <= to_s; }
};

/// The data of the page: scene, ticks, robots, events and latencies of the runs, and how the others
/// differ from the first. Every number of a tick, read as a float, has the bits of the record.
/// @throws std::runtime_error  naming the file that shows another robot than the first, or that has
/// nothing in the interval that is shown.
/// @throws std::invalid_argument  naming a field that is not finite.
Json FlightReportJson(const std::vector<RunData>& runs, const FlightReportOptions& options = {});

/// Writes `DIR/index.html`, one page that needs no network, and creates DIR where it is missing.
/// @returns the page's path.
/// @throws std::runtime_error  with the path when the page cannot be written; others as
/// FlightReportJson.
std::string WriteFlightReport(const std::vector<RunData>& runs, const std::string& directory,
                              const FlightReportOptions& options = {});

}  // namespace tumbler
