#include "runtime/record/record_program.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/file_kind.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/log_program.h"
#include "runtime/record/record_blocks.h"
#include "runtime/record/record_export.h"
#include "runtime/record/record_mcap.h"

namespace tumbler {
namespace {

constexpr const char* kRecordFooter =
    R"(RECORD is a flight record (`tumbler run --record`), or an LCM log (`tumbler run --log`, or lcm-logger's): what is in
the file tells which. Without an option: what it holds, whether it is complete, and what is lost or damaged in it; of a
log its events, too. What was cut off, or is damaged in part, is exported as far as it is whole.

Exit codes:
  0  it is whole, if perhaps a record that was cut off at its end
  1  wrong usage, or a file that cannot be read or written
  4  parts of it are damaged; of a log, also: ticks are missing, or its end is cut off)";

struct RecordExports {
  std::string record;
  std::string candump;
  std::string csv;
  std::string log;
  std::string mcap;
  std::string truth;
  std::string motion;  ///< Of a log.

  [[nodiscard]] std::vector<std::string> All() const { return {candump, csv, log, mcap, truth}; }
};

ExitStatus Export(const RecordExports& options, const PictureSource* pictures) {
  CheckDistinct({options.record}, options.All());
  KeepRecords(options.All());
  const MappedFile file(options.record);
  FlightRecord record(file.bytes(), options.record);
  const std::vector<std::string> outputs = options.All();
  const bool exports = std::any_of(outputs.begin(), outputs.end(),
                                   [](const std::string& path) { return !path.empty(); });
  if (!exports) fmt::print("{}", Printable(Summary(record)));
  if (!options.candump.empty()) {
    fmt::print("{}: {} frames\n", options.candump, ExportCandump(record, options.candump));
  }
  if (!(options.csv + options.log).empty()) {
    const std::int64_t ticks = ExportTelemetry(record, options.csv, options.log);
    for (const std::string& path : {options.csv, options.log}) {
      if (!path.empty()) fmt::print("{}: {} ticks\n", path, ticks);
    }
  }
  if (!options.truth.empty())
    fmt::print("{}: {} true states\n", options.truth, ExportTruth(record, options.truth));
  if (!options.mcap.empty()) {
    const std::int64_t ticks = ExportMcap(record, options.mcap, pictures);
    fmt::print(
        "{}: {} ticks{}\n", options.mcap, ticks,
        pictures != nullptr ? "" : ", without the robot, as this build cannot read robot files");
  }
  if (exports) {
    for (const std::string& remark : record.Remarks()) {
      fmt::print(stderr, "{}\n", Printable(fmt::format("{}: {}", options.record, remark)));
    }
  }
  return record.damages().empty() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

/// Whether a file is an LCM log: events begin with four bytes that nothing else has. A log may be
/// damaged where it begins.
bool IsLog(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t kBegin = 1U << 16U;
  const auto begin = bytes.first(std::min(bytes.size(), kBegin));
  return std::search(begin.begin(), begin.end(), kLcmEventBegin.begin(), kLcmEventBegin.end()) !=
         begin.end();
}

/// What the file is, by its content. @throws RecordError when it is neither.
bool IsLogRatherThanRecord(const std::string& path) {
  const MappedFile file(path);
  if (StartOf(file.bytes()) != RecordStart::kNotARecord) return false;
  if (!IsLog(file.bytes())) throw RecordError(path + ": is neither a flight record nor an LCM log");
  return true;
}

/// Of an LCM log. @throws UsageError when something is wanted that is in no log.
ExitStatus ExportLog(const RecordExports& options, const PictureSource* pictures) {
  for (const auto& [option, name] : {std::pair{"--candump", &options.candump},
                                     {"--log", &options.log},
                                     {"--truth-csv", &options.truth}}) {
    if (!name->empty())
      throw UsageError(option, "is for flight records, and " + options.record + " is an LCM log");
  }
  if (!options.motion.empty() && options.mcap.empty())
    throw UsageError("--motion", "needs --mcap, since nothing else has a robot in it");
  if (!options.motion.empty() && pictures == nullptr)
    throw UsageError("--motion", "this build cannot read robot files");
  return ShowLog({options.record, options.csv, options.mcap, options.motion}, pictures);
}

}  // namespace

ExitStatus DescribeRecord(int argc, char** argv, const PictureSource* pictures) {
  RecordExports options;
  CommandLine line("Says what a flight record or an LCM log of a run holds, and exports it.",
                   "tumbler record");
  line.SetFooter(kRecordFooter);
  line.Option("RECORD", options.record, "flight record, or LCM log").Required();
  line.Option("--csv", options.csv,
              "write every tick as CSV, as `tumbler run --csv` does; of a log also - for standard "
              "output");
  line.Option(
      "--mcap", options.mcap,
      "write the run as MCAP for Foxglove and PlotJuggler: moving robot, joints, latencies, "
      "events");
  line.Option("--candump", options.candump,
              "of a flight record: write every frame as `candump -l` logs it, for canplayer and "
              "others");
  line.Option("--log", options.log,
              "of a flight record: write every tick as an LCM log, as `tumbler run --log` does");
  line.Option("--truth-csv", options.truth,
              "of a flight record: write every true state of a simulated robot as CSV: root and "
              "joints");
  line.Option("--motion", options.motion,
              "of a log, with --mcap: the motion that was played, which has the robot that is "
              "drawn; a log has none");
  line.Parse(argc, argv);
  for (const auto& [option, name] : {std::pair{"--candump", &options.candump},
                                     {"--log", &options.log},
                                     {"--mcap", &options.mcap},
                                     {"--truth-csv", &options.truth}}) {
    if (*name == "-") throw UsageError(option, "needs the name of a file, not standard output");
  }
  if (IsLogRatherThanRecord(options.record)) return ExportLog(options, pictures);
  if (!options.motion.empty())
    throw UsageError("--motion", "is for LCM logs: a flight record has its own robot");
  if (options.csv == "-") throw UsageError("--csv", "needs the name of a file for a flight record");
  return Export(options, pictures);
}

}  // namespace tumbler
