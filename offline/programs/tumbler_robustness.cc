// tumbler robustness: how many robots that are not the model survive a motion, each played through
// the runtime, simulated drives and twin.

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "common/core/index.h"
#include "common/files/command_line.h"
#include "common/files/planned_passages.h"
#include "common/files/program.h"
#include "common/files/progress_line.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "offline/pages/page_file.h"
#include "offline/studies/certify.h"
#include "offline/studies/robustness_page.h"
#include "offline/studies/space_study.h"
#include "offline/studies/spread_options.h"
#include "offline/studies/study.h"
#include "offline/studies/window.h"
#include "offline/twin/twin_toml.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  done: every robot was judged, however many stand; with --window: the model is as asked
  1  wrong usage, or a file that cannot be used or written
  2  refused: the motion, its drives or the hold do not suit what is asked for
  4  robots were not judged: they are in no share, and nothing is certified; with --window: the
     model is not as asked, or was not judged
  130  interrupted: with --checkpoint, what was found is kept)";

struct Arguments {
  RobustnessStudy study;
  WorkPlan plan;
  std::optional<std::uint64_t> seed;
  bool compare_lanes = false;
  bool window = false;
  bool certify = false;
  bool quiet = false;
  double period_s = SpaceStudy{}.period_s;  ///< In space.
  std::string branch;
  std::string shard;
  std::string json;
  std::string report;
};

void Declare(CommandLine& line, Arguments& arguments) {
  RobustnessStudy& study = arguments.study;
  WorkPlan& plan = arguments.plan;
  line.Option("MOTION", study.motion, "Primitive or sequence file (TOML)").Required();
  line.Option("--robots", plan.robots, "How many").Within(1, 10000000).ShowDefault();
  line.Option("--cycles", study.run.cycles, "Of a sequence").Within(0, 100000).ShowDefault();
  line.Option("--hold-s", study.run.hold_s, "Hold after the last motion has settled [s]")
      .Within(0.0, 3600.0)
      .ShowDefault();
  line.Option("--get-ups", study.run.get_ups,
              "How often a robot that has fallen gets up and goes on, by its sensor's pitch")
      .Within(0, 1000)
      .ShowDefault();
  line.Option("--branch", arguments.branch, "Take this branch once the cycles are done");
  line.Seed(arguments.seed, "Of the robots; 1 if left out");
  line.Option("--scale", study.scale, "Multiplies every spread").Within(0.0, 10.0).ShowDefault();
  DeclareSpreads(line, study.spreads);
  line.Option(
      "--drives", study.drives,
      "Drives file; without it, that which the twin file names, or the default drives with the "
      "gains that the motion's file says");
  line.Option("--period-s", arguments.period_s,
              "In space: with which setpoints change; eight motors share a bus at 400 Hz [s]")
      .Within(1e-4, 0.1)
      .ShowDefault();
  line.Option("--twin", study.twin, "Twin file, for what all robots share");
  line.Option("--push", study.push_n,
              "Push each robot for 0.1 s, to either side, at a random time in the hold [N]")
      .Within(0.0, 1000.0)
      .ShowDefault();
  line.Flag("--sensor-faults", study.sensor_faults,
            "Let each robot's sensor fail from a random time on: silent, frozen, offset, swapped "
            "axes or late, one after the other");
  const auto lanes = line.Flag("--lanes", study.lanes,
                               "Play robots in lanes, some fifty times as fast as in the twin");
  line.Flag("--drops", study.drops,
            "First drop each robot without torque, in a random pose: it has to get up from where "
            "it lies, by its sensor's pitch where the motion has several beginnings")
      .Excludes(lanes);
  line.Flag("--compare-lanes", arguments.compare_lanes,
            "Play them both ways, and tell on how many the verdicts agree")
      .Excludes(lanes);
  line.Option("--threads", plan.threads, "0: one for each core").Within(0, 1024).ShowDefault();
  line.Option("--checkpoint", plan.checkpoint,
              "Keep outcomes in this file, and go on from those that are in it");
  line.Option("--shard", arguments.shard,
              "I/N: of N parts of the robots, play the I-th, for --checkpoint");
  line.Option("--merge", plan.merged, "Take outcomes from this checkpoint, too; may be repeated")
      .TakesOneValueEachTime();
  line.Flag(
      "--window", arguments.window,
      "Find in which values of friction, stiffness and damping of the ground the model itself "
      "is as asked, in lanes where they have the motion, else in the twin; no robots are "
      "played");
  line.Flag(
      "--certify", arguments.certify,
      "Write the share into the primitive's file, or into those that the sequence plays; with "
      "--window, the windows into the primitive's");
  line.Option("--report", arguments.report,
              "Write a page to this file, *.html, or into this folder");
  line.Option("--json", arguments.json,
              "Write figures as JSON to this file, or to standard output for -");
  line.Flag("--quiet", arguments.quiet, "No progress: only what was found");
}

void ReadShard(const Arguments& arguments, WorkPlan& plan) {
  if (arguments.shard.empty()) return;
  const std::string& text = arguments.shard;
  const char* const end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, plan.shard);
  const bool slash = first.ec == std::errc() && first.ptr != end && *first.ptr == '/';
  const auto second = slash ? std::from_chars(first.ptr + 1, end, plan.shards) : first;
  if (!slash || second.ec != std::errc() || second.ptr != end || plan.shard < 1 ||
      plan.shards < plan.shard) {
    throw UsageError("--shard", fmt::format("'{}' is not I/N with 1 <= I <= N, such as 2/4", text));
  }
  if (plan.checkpoint.empty())
    throw UsageError("--shard", "what is found has to be kept: name a file with --checkpoint");
}

/// Windows are of the model alone, and found in a few seconds.
void CheckWindow(const CommandLine& line) {
  std::vector<std::string> others = {
      "--robots", "--seed",          "--scale", "--push",    "--sensor-faults",
      "--lanes",  "--compare-lanes", "--drops", "--get-ups", "--checkpoint",
      "--shard",  "--merge",         "--report"};
  for (const SpreadName& spread : kSpreadNames) others.emplace_back(spread.option);
  for (const std::string& other : others) {
    if (!line.Given(other)) continue;
    throw UsageError("--window",
                     fmt::format("is about the model, and no robots are played; leave out "
                                 "{}",
                                 other));
  }
}

/// Checks how far a sequence is to be played.
void CheckWay(const Arguments& arguments, const SequenceFile& motion) {
  const std::string& name = arguments.study.motion;
  if (!arguments.branch.empty()) {
    if (!motion.graph.HasBranch(arguments.branch))
      throw UsageError("--branch", fmt::format("{} has no branch '{}'", name, arguments.branch));
  } else if (motion.graph.edge_count == 0 && arguments.study.run.cycles != 0) {
    throw UsageError("--cycles",
                     fmt::format("is for sequences that go round; {} ends by itself", name));
  } else if (motion.graph.edge_count > 0 && arguments.study.run.cycles == 0) {
    throw UsageError("--cycles", fmt::format("{} goes on for ever; say how many", name));
  }
  RequireEnd(motion, arguments.study.run.cycles, arguments.branch);
}

/// Checks what is asked for against the motion and the files.
void Check(Arguments& arguments) {
  RobustnessStudy& study = arguments.study;
  ReadShard(arguments, arguments.plan);
  if (arguments.seed) study.seed = *arguments.seed;
  std::vector<std::string> inputs = arguments.plan.merged;
  if (const std::string drives = DrivesFileOf(study); !drives.empty()) inputs.push_back(drives);
  for (const std::string& file : FilesOfTwin(study.twin)) inputs.push_back(file);
  std::vector<std::string> motions;
  const SequenceFile motion = LoadMotion(study.motion, NotingReader(motions));
  fmt::print(stderr, "{}", EditNotes(study.motion, motion.primitives));
  inputs.insert(inputs.end(), motions.begin(), motions.end());
  const std::string page = arguments.report.empty() ? "" : PagePath(arguments.report);
  std::vector<std::string> outputs = {arguments.json, arguments.plan.checkpoint, page};
  CheckDistinct(inputs, outputs);
  if (!arguments.branch.empty()) study.run.branch = motion.graph.FindBranch(arguments.branch);
  CheckWay(arguments, motion);
  if (study.drops && (study.disturbs() || arguments.compare_lanes)) {
    throw UsageError("--drops",
                     "is played in the twin, and nothing else happens to robots that are dropped; "
                     "leave out --push, --sensor-faults and --compare-lanes");
  }
  if ((study.lanes || arguments.compare_lanes) && study.run.get_ups > 0)
    throw UsageError("--get-ups", "is played in the twin; leave out --lanes and --compare-lanes");
  if (study.push_n != 0 && study.run.get_ups > 0) {
    throw UsageError("--push",
                     "comes at a time in the model's hold, where a robot that got up is elsewhere "
                     "in its run; leave out --get-ups");
  }
  if (arguments.certify) {
    if (study.drops)
      throw UsageError("--certify", "a certificate has no place for drops; leave out --drops");
    if (!study.twin.empty())
      throw UsageError("--certify", "a certificate is about the plain twin; leave out --twin");
    if (study.disturbs()) {
      throw UsageError("--certify",
                       "a certificate is about the plain twin; leave out --push and "
                       "--sensor-faults");
    }
    if (study.run.get_ups > 0) {
      throw UsageError("--certify",
                       "a certificate is about robots that stand; leave out --get-ups");
    }
    if (!arguments.branch.empty())
      throw UsageError("--certify", "a certificate has no place for a branch; leave out --branch");
    if (arguments.window && motions.size() > 1) {
      throw UsageError(
          "--certify",
          "a window is written into a primitive, of that motion alone; name one of the "
          "sequence's primitives, or leave out --certify");
    }
    for (const std::string& path : motions) CheckWritable(path);
  }
  if (!arguments.report.empty()) CheckFolderWritable(PageFolder(arguments.report));
  if (!arguments.json.empty() && arguments.json != "-") CheckTextFile(arguments.json);
}

void WriteJson(const std::string& path, const Json& json) {
  if (path.empty()) return;
  if (path == "-") {
    fmt::print("{}\n", json.Dump(2));
    return;
  }
  PendingFile file(path, json.Dump(2) + "\n");
  file.Commit();
}

void WriteResults(const Arguments& arguments, const RobustnessResult& result,
                  const std::optional<Agreement>& agreement) {
  std::FILE* const text_to = arguments.json == "-" ? stderr : stdout;
  fmt::print(text_to, "{}", ToText(result));
  if (agreement) fmt::print(text_to, "{}", ToText(*agreement));
  if (!arguments.report.empty())
    fmt::print(text_to, "wrote {}\n", WritePage(RobustnessPage(result), arguments.report));
  const bool all_judged = Index(result.Judged()) == result.trials.size();
  if (arguments.certify && !all_judged)
    fmt::print(stderr, "nothing was certified: {}\n", NotJudgedText(result));
  if (arguments.certify && all_judged) {
    for (const std::string& path : Certify(result))
      fmt::print(text_to, "wrote the share into {}\n", path);
  }
  if (arguments.json.empty()) return;
  Json json = ToJson(result);
  if (agreement) json["lanes_agree"] = ToJson(*agreement);
  WriteJson(arguments.json, json);
}

ExitStatus PlayWindow(const Arguments& arguments) {
  const WindowResult result = FindWindows(arguments.study, arguments.plan.threads);
  std::FILE* const text_to = arguments.json == "-" ? stderr : stdout;
  fmt::print(text_to, "{}", ToText(result));
  const bool found = !result.windows.empty();
  if (arguments.certify && found)
    fmt::print(text_to, "wrote the windows into {}\n", CertifyWindow(result));
  if (arguments.certify && !found) fmt::print(stderr, "nothing was certified\n");
  WriteJson(arguments.json, ToJson(result));
  return found ? ExitStatus::kDone : ExitStatus::kAmiss;
}

ExitStatus Play(Arguments& arguments, const Processes& processes) {
  Check(arguments);
  WorkPlan& plan = arguments.plan;
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  if (plan.threads == 0) plan.threads = cores;
  if (arguments.window) return processes.rank() == 0 ? PlayWindow(arguments) : ExitStatus::kDone;
  const bool alone = processes.count() == 1;
  if (alone) {
    // Of several processes none may end before the others; mpirun ends them all.
    plan.interrupt = &EndOnSignals();
  }
  WorkDone work;
  {
    CountProgress known(plan.robots, "robots");
    if (!arguments.quiet && processes.rank() == 0)
      plan.progress = [&known](int count) { known(count); };
    work = RunStudy(arguments.study, plan, processes);
    plan.progress = nullptr;
  }
  if (plan.interrupt != nullptr && *plan.interrupt && !work.result) {
    fmt::print(stderr, "interrupted: {} of {} robots are known; {}\n", work.known, plan.robots,
               plan.checkpoint.empty() ? "nothing was written" : plan.checkpoint + " has them");
    return ExitStatus::kInterrupted;
  }
  std::optional<Agreement> agreement;
  if (arguments.compare_lanes) {
    RobustnessStudy in_lanes = arguments.study;
    in_lanes.lanes = true;
    WorkPlan all;
    all.robots = plan.robots;
    all.threads = plan.threads;
    const WorkDone lanes = RunStudy(in_lanes, all, processes);
    if (work.result && lanes.result) agreement = Compare(*work.result, *lanes.result);
  }
  if (work.result) {
    WriteResults(arguments, *work.result, agreement);
    if (Index(work.result->Judged()) != work.result->trials.size()) return ExitStatus::kAmiss;
  } else if (processes.rank() == 0) {
    fmt::print("{} of {} robots are known; {} has them\n", work.known, plan.robots,
               plan.checkpoint);
  }
  return ExitStatus::kDone;
}

/// What a study of a motion in space has.
constexpr const char* kInSpace =
    "--robots, --seed, --scale, --cycles, --branch, --hold-s (0 where it is left out), --push, "
    "--period-s, --threads, --json, --quiet and the spreads of links and ground";

/// What it does not have.
void CheckSpaceOptions(const CommandLine& line) {
  for (const char* option :
       {"--get-ups", "--twin", "--sensor-faults", "--lanes", "--compare-lanes", "--drops",
        "--checkpoint", "--shard", "--merge", "--report", "--window", "--certify", "--drives"}) {
    if (!line.Given(option)) continue;
    throw UsageError(option, fmt::format("is for motions in the plane so far; this one is of a "
                                         "robot in space, for which there are {}",
                                         kInSpace));
  }
}

ExitStatus PlayInSpace(const CommandLine& line, const Arguments& arguments) {
  CheckSpaceOptions(line);
  const SequenceFile motion = LoadMotion(arguments.study.motion);
  fmt::print(stderr, "{}", EditNotes(arguments.study.motion, motion.primitives));
  CheckWay(arguments, motion);
  SpaceStudy study;
  study.motion = arguments.study.motion;
  study.cycles = arguments.study.run.cycles;
  study.branch = arguments.branch;
  study.robots = arguments.plan.robots;
  study.seed = arguments.seed.value_or(study.seed);
  study.scale = arguments.study.scale;
  study.spreads = arguments.study.spreads;
  study.period_s = arguments.period_s;
  if (line.Given("--hold-s")) study.hold_s = arguments.study.run.hold_s;
  study.push_n = arguments.study.push_n;
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  study.threads = arguments.plan.threads == 0 ? cores : arguments.plan.threads;
  study.interrupt = &EndOnSignals();
  if (!arguments.json.empty() && arguments.json != "-") CheckTextFile(arguments.json);
  std::optional<SpaceStudyResult> result;
  {
    CountProgress known(study.robots, "robots");
    if (!arguments.quiet) study.progress = [&known](int count) { known(count); };
    result = RunSpaceStudy(study);
    result->study.progress = nullptr;
  }
  if (static_cast<int>(result->trials.size()) < study.robots) {
    fmt::print(stderr, "interrupted: {} of {} robots are known; nothing was written\n",
               result->trials.size(), study.robots);
    return ExitStatus::kInterrupted;
  }
  fmt::print(arguments.json == "-" ? stderr : stdout, "{}", ToText(*result));
  WriteJson(arguments.json, ToJson(*result));
  return result->Unjudged() > 0 ? ExitStatus::kAmiss : ExitStatus::kDone;
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line(
      fmt::format("Plays a motion on robots that differ from the model, each through the runtime, "
                  "simulated drives and the twin, and tells how many are as asked after every "
                  "motion. Robot number i of a seed is the same whatever the number of robots, "
                  "threads, processes (mpirun) and shards. With --window: on which ground the "
                  "model itself is as asked. A motion in space takes {}; what else there is, is "
                  "for motions in the plane.",
                  kInSpace),
      "tumbler robustness");
  line.SetFooter(kExitCodes);
  Declare(line, arguments);
  line.Parse(argc, argv);
  const std::string& motion = arguments.study.motion;
  if (IsMotionInSpace(motion)) return PlayInSpace(line, arguments);
  if (line.Given("--period-s"))
    throw UsageError("--period-s", "is for motions of robots in space; this one is in the plane");
  if (arguments.window) CheckWindow(line);
  return RunTogether("tumbler robustness", [&arguments](const Processes& processes) {
    return Play(arguments, processes);
  });
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler robustness", argc, argv, tumbler::Main);
}
