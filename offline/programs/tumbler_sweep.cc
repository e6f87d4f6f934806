// tumbler sweep: makes a library of primitives from a task, one for each point of a grid of its
// numbers.

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/held_results.h"
#include "common/files/program.h"
#include "common/files/progress_line.h"
#include "common/files/result_file.h"
#include "offline/solve/guess.h"
#include "offline/studies/task_sweep.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0    every point was worked on, and one or more have a motion
  1    wrong usage, or a file that cannot be used or written
  2    no point has a motion
  130  interrupted: the same command goes on with the points that are not known yet)";

struct Arguments {
  std::string task;
  std::vector<std::string> over;
  std::string guess;
  std::optional<std::uint64_t> seed;
  std::string out;
  int threads = 1;
  std::string json;
  bool quiet = false;
};

void Declare(CommandLine& line, Arguments& arguments) {
  line.SetFooter(kExitCodes);
  line.Option("TASK", arguments.task, "Task file (TOML)").Required();
  line.Option("--over", arguments.over,
              "KEY=VALUE,VALUE,... or KEY=FROM:TO:COUNT, once for each quantity that varies: any "
              "number of the task file, such as contact.mu or slope_rad; mass or mass.LINK, a "
              "factor")
      .Required()
      .TakesOneValueEachTime();
  line.Option("--out", arguments.out,
              "Folder of the library. A work that was ended goes on from what is in it")
      .Required();
  line.Option(
      "--guess", arguments.guess,
      "Solve every point from the paths of this primitive, and near them, without a search");
  line.Seed(arguments.seed, "Seed of every search, instead of the task's");
  line.Option("--threads", arguments.threads, "Points at a time; 0: one for each core")
      .Within(0, 1024)
      .ShowDefault();
  line.Option("--json", arguments.json,
              "Write what library.json says to this file, too, or to standard output for -");
  line.Flag("--quiet", arguments.quiet, "No progress: only what was found");
}

SweepStudy StudyOf(const Arguments& arguments) {
  if (!arguments.guess.empty() && arguments.seed) {
    throw UsageError("--guess",
                     "takes the place of the search that --seed is about; leave one out");
  }
  std::optional<PrimitiveFile> guess;
  if (!arguments.guess.empty()) guess = LoadPrimitive(arguments.guess);
  std::vector<GridAxis> axes;
  try {
    for (const std::string& text : arguments.over) axes.push_back(ReadAxis(text));
    return {TaskGrid(arguments.task, axes), std::move(guess), arguments.guess, arguments.seed};
  } catch (const std::invalid_argument& error) {
    throw UsageError("--over", error.what());
  }
}

/// Checks the files before the work. @returns a hold on them.
HeldResults Check(const Arguments& arguments, const SweepStudy& study, const SweepPlan& plan) {
  if (!study.guess) CheckGuess(study.grid.TaskAt(0));
  CheckFolderWritable(plan.folder);
  CheckResult(arguments.json);
  std::vector<std::string> files = FilesOf(study, plan);
  files.push_back(arguments.json);
  CheckDistinct({arguments.task, study.grid.base().robot_file, arguments.guess}, files);
  return HeldResults({plan.folder, arguments.json});
}

ExitStatus Sweep(const Arguments& arguments, const Processes& processes) {
  const SweepStudy study = StudyOf(arguments);
  SweepPlan plan;
  plan.folder = arguments.out;
  plan.threads = arguments.threads > 0
                     ? arguments.threads
                     : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  HeldResults held;
  if (processes.rank() == 0) held = Check(arguments, study, plan);
  if (processes.count() == 1) {
    // Of several processes none may end before the others; mpirun ends them all.
    plan.interrupt = &EndOnSignals();
  }
  SweepDone sweep;
  {
    CountProgress known(study.grid.size(), "points");
    if (!arguments.quiet && processes.rank() == 0)
      plan.progress = [&known](int count) { known(count); };
    sweep = RunSweep(study, plan, processes);
  }
  if (processes.rank() > 0) return ExitStatus::kDone;
  if (sweep.points.empty()) {
    fmt::print(stderr, "interrupted: {} of {} points are known; the same command goes on\n",
               sweep.known, study.grid.size());
    return ExitStatus::kInterrupted;
  }
  fmt::print(arguments.json == "-" ? stderr : stdout, "{}", ToText(study, sweep.points));
  if (!arguments.json.empty())
    WriteResult(arguments.json, ToJson(study, sweep.points).Dump(2) + "\n");
  const bool any = std::any_of(sweep.points.begin(), sweep.points.end(),
                               [](const SweepPoint& point) { return point.found; });
  return any ? ExitStatus::kDone : ExitStatus::kRefused;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line(
      "Makes a library of primitives: solves a task again for every combination of some of its "
      "numbers, such as friction, slope and mass. A point's primitive is the same whatever the "
      "number of threads, processes (mpirun) and interruptions.",
      "tumbler sweep");
  Declare(line, arguments);
  line.Parse(argc, argv);
  return RunTogether("tumbler sweep", [&arguments](const Processes& processes) {
    return Sweep(arguments, processes);
  });
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler sweep", argc, argv, tumbler::Main);
}
