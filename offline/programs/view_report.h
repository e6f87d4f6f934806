#pragma once

#include <string>
#include <vector>

#include "common/core/exit_status.h"
#include "offline/pages/flight_report.h"

namespace tumbler {

/// The page of runs and plans that `tumbler view --out` writes.
struct ReportArguments {
  std::vector<std::string> files;   ///< Flight records and primitives, of one robot.
  std::vector<std::string> truths;  ///< LCM logs with the truth of the first records.
  std::string out;                  ///< A page, `*.html`, or a folder for `index.html`.
  FlightReportOptions options;
};

/// Checks what concerns several of them. @throws UsageError
void CheckReport(const ReportArguments& arguments);

/// Writes the page, and prints figures of the runs and how they differ.
/// @throws std::runtime_error, RecordError, FileError  naming the file.
ExitStatus WriteReportOfRuns(const ReportArguments& arguments);

}  // namespace tumbler
