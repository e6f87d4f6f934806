#include "runtime/record/record_program.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/record_export.h"
#include "runtime/record/record_mcap.h"

namespace tumbler {
namespace {

constexpr const char* kRecordFooter =
    R"(Without an option: what the record holds, whether it is complete, and what is lost or damaged in it.
A record that was cut off, or is damaged in part, is exported as far as it is whole.

Exit codes:
  0  the record is whole, if perhaps cut off at its end
  1  wrong usage, or a file that cannot be read or written
  4  parts of it are damaged)";

struct RecordExports {
  std::string record;
  std::string candump;
  std::string csv;
  std::string lcm;
  std::string mcap;
  std::string truth;

  [[nodiscard]] std::vector<std::string> All() const { return {candump, csv, lcm, mcap, truth}; }
};

ExitStatus Export(const RecordExports& options, const PictureSource* pictures) {
  CheckDistinct({options.record}, options.All());
  const MappedFile file(options.record);
  FlightRecord record(file.bytes(), options.record);
  const std::vector<std::string> outputs = options.All();
  const bool exports = std::any_of(outputs.begin(), outputs.end(),
                                   [](const std::string& path) { return !path.empty(); });
  if (!exports) fmt::print("{}", Printable(Summary(record)));
  if (!options.candump.empty()) {
    fmt::print("{}: {} frames\n", options.candump, ExportCandump(record, options.candump));
  }
  if (!(options.csv + options.lcm).empty()) {
    const std::int64_t ticks = ExportTelemetry(record, options.csv, options.lcm);
    for (const std::string& path : {options.csv, options.lcm}) {
      if (!path.empty()) fmt::print("{}: {} ticks\n", path, ticks);
    }
  }
  if (!options.truth.empty())
    fmt::print("{}: {} true states\n", options.truth, ExportTruth(record, options.truth));
  if (!options.mcap.empty()) {
    std::optional<RecordPicture> picture;
    if (pictures != nullptr) picture = pictures->of_record(options.record);
    const std::int64_t ticks =
        ExportMcap(record, options.mcap, "tumbler-record " TUMBLER_VERSION, picture);
    fmt::print("{}: {} ticks{}\n", options.mcap, ticks,
               picture ? "" : ", without the robot, as this build cannot read robot files");
  }
  if (exports) {
    for (const std::string& remark : record.Remarks()) {
      fmt::print(stderr, "{}\n", Printable(fmt::format("{}: {}", options.record, remark)));
    }
  }
  return record.damages().empty() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

}  // namespace

ExitStatus DescribeRecord(int argc, char** argv, const PictureSource* pictures) {
  RecordExports options;
  CommandLine line("Says what a flight record of tumbler-run holds, and exports it.",
                   "tumbler-record");
  line.SetFooter(kRecordFooter);
  line.Option("RECORD", options.record, "flight record (tumbler-run --record)").Required();
  line.Option("--candump", options.candump,
              "write every frame as `candump -l` logs it, for canplayer and others");
  line.Option("--csv", options.csv, "write every tick as CSV, as tumbler-run's --trace does");
  line.Option("--lcm", options.lcm, "write every tick as an LCM log, as tumbler-run's --log");
  line.Option(
      "--mcap", options.mcap,
      "write the run as MCAP for Foxglove and PlotJuggler: moving robot, joints, latencies, "
      "events");
  line.Option("--truth-csv", options.truth,
              "write every true state of a simulated robot as CSV: root and joints");
  line.Parse(argc, argv);
  for (const auto& [option, name] : {std::pair{"--candump", &options.candump},
                                     {"--csv", &options.csv},
                                     {"--lcm", &options.lcm},
                                     {"--mcap", &options.mcap},
                                     {"--truth-csv", &options.truth}}) {
    if (*name == "-") throw UsageError(option, "needs the name of a file, not standard output");
  }
  return Export(options, pictures);
}

}  // namespace tumbler
