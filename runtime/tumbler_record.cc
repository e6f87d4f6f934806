// tumbler-record: describes the content of a flight record, and exports it for other tools.

#include <fmt/format.h>

#include <cstdio>
#include <string>

#include "common/command_line.h"
#include "common/printable.h"
#include "common/program.h"
#include "common/result_file.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/record_export.h"

namespace tumbler {
namespace {

constexpr const char* kFooter =
    R"(Without an option: what the record holds, whether it is complete, and what is lost or damaged in it.
A record that was cut off, or is damaged in part, is exported as far as it is whole.

Exit codes:
  0  the record is whole, if perhaps cut off at its end
  1  wrong usage, or a file that cannot be read or written
  4  parts of it are damaged)";

struct Options {
  std::string record;
  std::string candump;
  std::string csv;
  std::string lcm;
};

ExitStatus Run(const Options& options) {
  CheckDistinct({options.record}, {options.candump, options.csv, options.lcm});
  const MappedFile file(options.record);
  FlightRecord record(file.bytes(), options.record);
  const bool exports = !(options.candump + options.csv + options.lcm).empty();
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
  if (exports) {
    for (const std::string& remark : record.Remarks()) {
      fmt::print(stderr, "{}\n", Printable(fmt::format("{}: {}", options.record, remark)));
    }
  }
  return record.damages().empty() ? ExitStatus::kDone : ExitStatus::kAmiss;
}

ExitStatus Main(int argc, char** argv) {
  Options options;
  CommandLine line("Says what a flight record of tumbler-run holds, and exports it.",
                   "tumbler-record");
  line.SetFooter(kFooter);
  line.Option("RECORD", options.record, "flight record (tumbler-run --record)").Required();
  line.Option("--candump", options.candump,
              "write every frame as `candump -l` logs it, for canplayer and others");
  line.Option("--csv", options.csv, "write every tick as CSV, as tumbler-run's --trace does");
  line.Option("--lcm", options.lcm, "write every tick as an LCM log, as tumbler-run's --log");
  line.Parse(argc, argv);
  return Run(options);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-record", argc, argv, tumbler::Main);
}
