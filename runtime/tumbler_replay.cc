// tumbler-replay: does a recorded run again.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "runtime/record/flight_record.h"
#include "runtime/record/replay.h"

namespace tumbler {
namespace {

constexpr int kExitDifferent = 1;
constexpr int kExitUnusable = 2;

constexpr const char* kFooter =
    R"(Feeds the recorded inputs to an executor with the recorded configuration, and compares every frame and every field
that comes out. A record that was cut off is replayed up to there.

Exit codes:
  0  identical
  1  a tick differs, is damaged or was not recorded
  2  wrong usage, or a file that cannot be used)";

struct Options {
  std::string record;
};

int ReplayOffline(const Options& options) {
  const MappedFile file(options.record);
  FlightRecord record(file.bytes(), options.record);
  const ReplayReport report = Replay(record);
  const std::string compared = fmt::format("{} ticks, {} frames in, {} frames out", report.ticks,
                                           report.frames_in, report.frames_out);
  if (report.difference) {
    const ReplayDifference& d = *report.difference;
    fmt::print("different at tick {} (byte {} of the record): {}: recorded {}, replayed {}\n",
               d.tick, record.tick_offset(), d.field, d.recorded, d.replayed);
    fmt::print("identical before: {}\n", compared);
  } else if (!report.gap.empty()) {
    fmt::print("cannot be replayed further: {}\nidentical before: {}\n", report.gap, compared);
  } else {
    fmt::print("identical: {}\n", compared);
    if (record.cut_off() || !record.end()) {
      for (const std::string& remark : record.Remarks()) fmt::print("{}\n", remark);
    }
  }
  return report.identical() ? 0 : kExitDifferent;
}

int Main(int argc, char** argv) {
  Options options;
  CLI::App app("Replays a flight record of tumbler-run.", "tumbler-replay");
  app.footer(kFooter);
  app.add_option("RECORD", options.record, "flight record (tumbler-run --record)")->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return kExitUnusable;
  }
  try {
    return ReplayOffline(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "tumbler-replay: {}\n", error.what());
    return kExitUnusable;
  }
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::Main(argc, argv); }
