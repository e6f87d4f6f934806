// tumbler abort: finds out how a motion that cannot go on hurts the robot least, by the time in it.

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <thread>

#include "common/files/command_line.h"
#include "common/files/program.h"
#include "common/files/progress_line.h"
#include "common/files/result_file.h"
#include "offline/studies/abort_check.h"
#include "offline/studies/abort_study.h"
#include "offline/studies/spread_options.h"
#include "offline/twin/twin_toml.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  done
  1  wrong usage, or a file that cannot be used or written
  2  refused: the motion is a sequence, its drives do not suit it, or there is no table to check
  130  interrupted: nothing was written)";

struct Arguments {
  AbortStudy study;
  std::optional<std::uint64_t> seed;
  int check = 0;
  bool write = false;
  bool quiet = false;
  std::string json;
};

void Declare(CommandLine& line, Arguments& arguments) {
  AbortStudy& study = arguments.study;
  line.Option("PRIMITIVE", study.primitive, "Primitive file (TOML)").Required();
  const auto write = line.Flag("--write", arguments.write,
                               "Write the table into the primitive's file, in place of the one "
                               "that is there");
  line.Option("--check", arguments.check,
              "Find no table: play so many aborts with the one in the file, and without")
      .Within(1, 1000000)
      .Excludes(write);
  line.Option("--robots", study.robots, "For which the table is found, the model among them")
      .Within(1, 100000)
      .ShowDefault();
  line.Seed(arguments.seed, "Of robots and what happens to them; 1 if left out");
  line.Option("--step", study.step_s, "About how long a part of the motion is [s]")
      .Within(0.001, 10.0)
      .ShowDefault();
  line.Option("--late", study.late_s, "The latest tick that robots get [s]")
      .Within(0.005, 1.0)
      .ShowDefault();
  line.Option("--scale", study.scale, "Multiplies every spread").Within(0.0, 10.0).ShowDefault();
  DeclareSpreads(line, study.spreads);
  line.Option(
      "--drives", study.drives,
      "Drives file; without it, that which the twin file names, or the default drives with the "
      "gains that the motion's file says");
  line.Option("--twin", study.twin, "Twin file, for what all robots share");
  line.Option("--threads", study.threads, "0: one for each core").Within(0, 1024).ShowDefault();
  line.Option("--json", arguments.json,
              "Write figures as JSON to this file, or to standard output for -");
  line.Flag("--quiet", arguments.quiet, "No progress: only what was found");
}

template <typename Result>
void Print(const Arguments& arguments, const Result& result) {
  fmt::print(arguments.json == "-" ? stderr : stdout, "{}", ToText(result));
  if (arguments.json.empty()) return;
  const std::string text = ToJson(result).Dump(2) + "\n";
  if (arguments.json == "-") {
    fmt::print("{}", text);
  } else {
    PendingFile(arguments.json, text).Commit();
  }
}

ExitStatus Interrupted() {
  fmt::print(stderr, "interrupted: nothing was written\n");
  return ExitStatus::kInterrupted;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line(
      "Finds out how a motion that cannot simply go on hurts the robot least, by the time in it: "
      "whether its joints are caught, fold to a pose, or roll the motion out to its end. Each "
      "way is played through the runtime, simulated drives and the twin, on the model and on "
      "robots that are not. What is found depends on nothing but the files and the options.",
      "tumbler abort");
  line.SetFooter(kExitCodes);
  Declare(line, arguments);
  line.Parse(argc, argv);
  AbortStudy& study = arguments.study;
  if (arguments.seed) study.seed = *arguments.seed;
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  if (study.threads == 0) study.threads = cores;
  std::vector<std::string> inputs = FilesOfTwin(study.twin);
  inputs.insert(inputs.end(), {study.primitive, study.drives});
  CheckDistinct(inputs, {arguments.json});
  if (arguments.write) CheckWritable(study.primitive);
  if (!arguments.json.empty() && arguments.json != "-") CheckTextFile(arguments.json);
  study.interrupt = &EndOnSignals();
  std::optional<CountProgress> known;
  int of_all = 0;
  if (!arguments.quiet) {
    study.progress = [&known, &of_all](int played, int of) {
      if (of != of_all) known.emplace(of, "aborts");  // More are known to be worth it.
      of_all = of;
      (*known)(played);
    };
  }
  if (arguments.check > 0) {
    study.robots = arguments.check;
    const AbortCheckResult result = CheckAborts(study);
    known.reset();
    if (result.aborts.empty()) return Interrupted();
    Print(arguments, result);
    return ExitStatus::kDone;
  }
  const AbortResult result = FindAborts(study);
  known.reset();
  if (result.parts.empty()) return Interrupted();
  Print(arguments, result);
  if (!arguments.write) return ExitStatus::kDone;
  WriteAborts(result);
  fmt::print(arguments.json == "-" ? stderr : stdout, "wrote the table into {}\n", study.primitive);
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler abort", argc, argv, tumbler::Main);
}
