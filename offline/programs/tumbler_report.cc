// tumbler-report: shows planned, commanded, measured and true motion of runs on one page.

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "offline/pages/flight_report.h"
#include "runtime/record/flight_record.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  written
  1  wrong usage, or a file that cannot be used or written: nothing was written)";

/// The most runs on one page. With more of them nobody can read the plots.
constexpr std::size_t kRunsMax = 6;

struct Arguments {
  std::vector<std::string> files;
  std::vector<std::string> truths;
  std::string out;
  FlightReportOptions options;
};

bool IsRecord(const std::string& path) {
  const MappedFile file(path);
  return StartOf(file.bytes()) != RecordStart::kNotARecord && !file.bytes().empty();
}

ExitStatus Report(const Arguments& arguments) {
  std::vector<std::string> inputs = arguments.files;
  inputs.insert(inputs.end(), arguments.truths.begin(), arguments.truths.end());
  CheckDistinct(inputs, {(std::filesystem::path(arguments.out) / "index.html").string()});
  std::vector<RunData> runs;
  std::size_t truths = 0;
  for (const std::string& path : arguments.files) {
    if (IsRecord(path)) {
      const bool has_log = truths < arguments.truths.size();
      runs.push_back(ReadRun(path, has_log ? arguments.truths[truths] : std::string()));
      ++truths;
    } else {
      runs.push_back(ReadPlan(path));
    }
  }
  if (truths < arguments.truths.size()) {
    throw std::runtime_error(
        fmt::format("{}: --truth is given {} times, for {} records; the first log belongs to the "
                    "first record",
                    arguments.truths[truths], arguments.truths.size(), truths));
  }
  const std::string page = WriteFlightReport(runs, arguments.out, arguments.options);
  for (const RunData& run : runs) {
    fmt::print("{}:\n", Printable(run.name));
    for (const auto& [name, value] : run.facts) fmt::print("  {}: {}\n", name, Printable(value));
    for (const RunEvent& event : run.events) {
      if (event.kind != RunEvent::Kind::kFault) continue;
      fmt::print("  fault at {:.3f} s: {}\n", event.time_s, Printable(event.text));
    }
  }
  for (std::size_t k = 1; k < runs.size(); ++k) {
    for (const RunDifference& d : Compare(runs.front(), runs[k])) {
      if (d.ticks == 0) {
        fmt::print("{} less {}: {}, {}: not measured in both\n", runs[k].name, runs.front().name,
                   d.joint, d.quantity);
        continue;
      }
      fmt::print("{} less {}: {}, {}: at most {:.6g} {} at {:.3f} s, rms {:.3g} {}\n", runs[k].name,
                 runs.front().name, d.joint, d.quantity, d.max, d.unit, d.max_at_s, d.rms, d.unit);
    }
  }
  fmt::print("wrote {}\n", page);
  return ExitStatus::kDone;
}

/// Checks that concern several options together.
void CheckTogether(const Arguments& arguments) {
  if (arguments.files.size() > kRunsMax) {
    throw UsageError("RECORD|PRIMITIVE",
                     fmt::format("are {}, allowed: 1 ... {}", arguments.files.size(), kRunsMax));
  }
  if (!(arguments.options.from_s < arguments.options.to_s)) {
    throw UsageError("--from", fmt::format("is {}, must be before --to, {}",
                                           arguments.options.from_s, arguments.options.to_s));
  }
  if (arguments.out.empty()) throw UsageError("--out", "is empty");
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line(
      "Shows runs and plans on one page: plan, command, measurement and truth of every joint on "
      "one time axis, the robots of plan and truth, faults and transitions, latencies, and how "
      "runs differ.",
      "tumbler-report");
  line.SetFooter(kExitCodes);
  line.Option("RECORD|PRIMITIVE", arguments.files,
              "flight records (tumbler-run --record) and primitives, of one robot")
      .Required();
  line.Option("--out", arguments.out, "folder for the page, index.html").Required();
  line.Option("--truth", arguments.truths,
              "LCM log with TUMBLER_TRUTH (tumbler-twin --truth) of the first record; given again, "
              "of the second, ...")
      .TakesOneValueEachTime();
  line.Option("--ticks", arguments.options.ticks_max,
              "how many ticks of each run the plots have, and those that stand out; figures are of "
              "all ticks")
      .Within(100, 200'000)
      .ShowDefault();
  line.Option("--from", arguments.options.from_s,
              "show the runs from this time on only [s]; 0 is where the motion begins");
  line.Option("--to", arguments.options.to_s, "show the runs up to this time only [s]");
  line.Parse(argc, argv);
  CheckTogether(arguments);
  return Report(arguments);
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-report", argc, argv, tumbler::Main);
}
