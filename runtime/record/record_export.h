#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/record/flight_record.h"
#include "runtime/record/run_description.h"
#include "runtime/record/run_exports.h"
#include "runtime/record/timed_record.h"

namespace tumbler {

/// What telemetry said of the ticks of a record. Where the record's drives cannot be used, it is
/// not known when replies were sampled.
[[nodiscard]] TimedRecords TimedRecordsOf(const RecordConfiguration& configuration);

/// What telemetry says of the run as a whole.
/// @throws FileError or RecordError  about a file of the record that cannot be used.
RunDescription DescribeRun(const RecordConfiguration& configuration);

/// What exports of a record are told of its run. Their files appear when they are whole.
/// @throws as DescribeRun.
RunExportConfig ExportConfigOf(const RecordConfiguration& configuration);

/// Makes exports of a record: hands them its ticks and true states, and puts their files in place
/// once all of them are whole.
/// @param figures  those of the exports, which get the ticks that the record has lost, at its end,
///                 too, where no later tick tells of them. Null: the exports say nothing of them.
/// @returns the number of ticks.
/// @throws std::runtime_error  naming the files that cannot be written, and what an export throws.
std::int64_t ExportRecord(FlightRecord& record, const std::vector<RunExport*>& exports,
                          LiveFigures* figures = nullptr);

/// Writes all frames of a record by time, as `candump -l` logs them. Sent frames have the time at
/// which they were handed to the bus, received frames that of their arrival. Times count from 1970,
/// or, for a run in virtual time, from its start. The file appears when it is whole, as those
/// below. It needs none of the record's files.
/// @returns the number of frames.
/// @throws std::runtime_error  naming the file that cannot be written.
std::int64_t ExportCandump(FlightRecord& record, const std::string& path);

/// Writes the ticks of a record as tumbler run's `--csv` and `--log` do. Either name may be
/// empty.
/// @returns the number of ticks.
/// @throws std::runtime_error  naming the file that cannot be written.
std::int64_t ExportTelemetry(FlightRecord& record, const std::string& csv_path,
                             const std::string& lcm_path);

/// Writes the true states of a simulated robot as a table (runtime/record/truth_csv.h): root,
/// and the run's joints.
/// @returns the number of true states.
/// @throws RecordError  when the record has none, or they are of another version; FileError when
/// the file cannot be written.
std::int64_t ExportTruth(FlightRecord& record, const std::string& csv_path);

/// The content of a record in several lines for people.
std::string Summary(FlightRecord& record);

}  // namespace tumbler
