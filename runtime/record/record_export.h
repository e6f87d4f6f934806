#pragma once

#include <cstdint>
#include <string>

#include "runtime/record/flight_record.h"
#include "runtime/record/run_description.h"
#include "runtime/record/timed_record.h"

namespace tumbler {

/// Makes of the ticks of a record, in their order, what the loop gave to telemetry.
class TimedRecords {
 public:
  /// Where the record's drives cannot be used, it is not known when replies were sampled.
  explicit TimedRecords(const RecordConfiguration& configuration);
  [[nodiscard]] TimedRecord Next(const TickEntry& entry);

 private:
  SampleTimes replies_;
  std::int64_t index_ = 0;  ///< Of the tick after the last one.
};

/// What telemetry says of the run as a whole.
/// @throws FileError or RecordError  about a file of the record that cannot be used.
RunDescription DescribeRun(const RecordConfiguration& configuration);

/// Writes all frames of a record by time, as `candump -l` logs them. Sent frames have the time at
/// which they were handed to the bus, received frames that of their arrival. Times count from 1970,
/// or, for a run in virtual time, from its start. The file appears when it is whole, as those
/// below.
/// @returns the number of frames.
/// @throws RecordError or FileError  naming the file that cannot be written.
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
