// tumbler-record: says what a flight record holds, and exports it for other tools.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "runtime/record/flight_record.h"
#include "runtime/record/record_export.h"

namespace tumbler {
namespace {

constexpr int kExitDamaged = 1;
constexpr int kExitUnusable = 2;

constexpr const char* kFooter =
    R"(Without an option: what the record holds, whether it is complete, and what is lost or damaged in it.
A record that was cut off, or is damaged in part, is exported as far as it is whole.

Exit codes:
  0  the record is whole, if perhaps cut off at its end
  1  parts of it are damaged
  2  wrong usage, or a file that cannot be read or written)";

struct Options {
  std::string record;
  std::string candump;
  std::string csv;
  std::string lcm;
};

int Run(const Options& options) {
  const MappedFile file(options.record);
  FlightRecord record(file.bytes(), options.record);
  const bool exports = !(options.candump + options.csv + options.lcm).empty();
  if (!exports) fmt::print("{}", Summary(record));
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
      fmt::print(stderr, "{}: {}\n", options.record, remark);
    }
  }
  return record.damages().empty() ? 0 : kExitDamaged;
}

int Main(int argc, char** argv) {
  Options options;
  CLI::App app("Says what a flight record of tumbler-run holds, and exports it.", "tumbler-record");
  app.footer(kFooter);
  app.add_option("RECORD", options.record, "flight record (tumbler-run --record)")->required();
  app.add_option("--candump", options.candump,
                 "write every frame as `candump -l` logs it, for canplayer and others");
  app.add_option("--csv", options.csv, "write every tick as CSV, as tumbler-run's --trace does");
  app.add_option("--lcm", options.lcm, "write every tick as an LCM log, as tumbler-run's --log");
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return kExitUnusable;
  }
  try {
    return Run(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "tumbler-record: {}\n", error.what());
    return kExitUnusable;
  }
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::Main(argc, argv); }
