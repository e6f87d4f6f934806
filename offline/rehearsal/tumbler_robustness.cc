// tumbler-robustness: how many robots that are not the model survive a motion, each played through
// the runtime, simulated drives and twin.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/command_line.h"
#include "common/program.h"
#include "common/result_file.h"
#include "offline/rehearsal/robustness/study.h"

namespace tumbler {
namespace {

struct Arguments {
  RobustnessStudy study;
  std::size_t seed = 1;
  int robots = 100;
  int threads = 1;
  std::string branch;
  std::string json;
};

/// The options that set a spread, with what they are for.
void DeclareSpreads(CommandLine& line, Spreads& spreads) {
  const std::array<std::pair<const char*, std::pair<double*, const char*>>, 10> options = {{
      {"--mass", {&spreads.mass, "Spread of each link's mass and inertia [part of it]"}},
      {"--inertia", {&spreads.inertia, "Spread of each link's inertia, besides [part of it]"}},
      {"--mass-centre", {&spreads.mass_centre_m, "Spread of each centre of mass along x [m]"}},
      {"--length", {&spreads.length, "Spread of each link's length [part of it]"}},
      {"--friction", {&spreads.friction, "Spread of the ground's friction [part of it]"}},
      {"--stiffness", {&spreads.stiffness, "Spread of the ground's stiffness [part of it]"}},
      {"--damping", {&spreads.damping, "Spread of the ground's damping [part of it]"}},
      {"--gain", {&spreads.gain, "Spread of each joint's gains [part of them]"}},
      {"--torque-limit", {&spreads.torque_limit, "Spread of each motor's limit [part of it]"}},
      {"--slope", {&spreads.slope_rad, "Spread of the ground's slope [rad]"}},
  }};
  for (const auto& [name, option] : options)
    line.Option(name, *option.first, option.second).Within(0.0, 1.0).ShowDefault();
}

ExitStatus Main(int argc, char** argv) {
  Arguments arguments;
  RobustnessStudy& study = arguments.study;
  CommandLine line(
      "Plays a motion on robots that differ from the model, each through the runtime, simulated\n"
      "drives and the twin, and tells how many are as asked after every motion. Robot number i of\n"
      "a seed is the same whatever the number of robots and threads.\n"
      "Exit status: 0 done, however many stand; 1 bad input.");
  line.Option("MOTION", study.motion, "Primitive or sequence file (TOML)").Required();
  line.Option("--robots", arguments.robots, "How many").Within(1, 10000000).ShowDefault();
  line.Option("--cycles", study.run.cycles, "Of a sequence").Within(0, 100000).ShowDefault();
  line.Option("--branch", arguments.branch, "Take this branch once the cycles are done");
  line.Option("--seed", arguments.seed, "Of the robots").ShowDefault();
  line.Option("--scale", study.scale, "Multiplies every spread").Within(0.0, 10.0).ShowDefault();
  DeclareSpreads(line, study.spreads);
  line.Option("--drives", study.drives, "Drives file; without it, the default drives");
  line.Option("--twin", study.twin, "Twin file, for what all robots share");
  line.Option("--threads", arguments.threads, "0: one for each core").Within(0, 1024).ShowDefault();
  line.Option("--json", arguments.json,
              "Write figures as JSON to this file, or to standard output for -");
  line.Parse(argc, argv);
  study.seed = arguments.seed;

  std::vector<std::string> inputs = {study.drives, study.twin};
  const SequenceFile motion = LoadMotion(study.motion, NotingReader(inputs));
  CheckDistinct(inputs, {arguments.json});
  if (!arguments.branch.empty()) {
    study.run.branch = motion.graph.FindBranch(arguments.branch);
    if (study.run.branch < 0) {
      throw UsageError("--branch",
                       fmt::format("{} has no branch '{}'", study.motion, arguments.branch));
    }
  } else if (motion.graph.edge_count > 0 && study.run.cycles == 0) {
    throw UsageError("--cycles", fmt::format("{} goes on for ever; say how many", study.motion));
  }
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const RobustnessResult result =
      RunStudy(study, arguments.robots, arguments.threads == 0 ? cores : arguments.threads);
  fmt::print(arguments.json == "-" ? stderr : stdout, "{}", ToText(result));
  if (arguments.json == "-") {
    fmt::print("{}\n", ToJson(result).Dump(2));
  } else if (!arguments.json.empty()) {
    std::FILE* const out = std::fopen(arguments.json.c_str(), "w");
    if (out == nullptr) throw FileError(arguments.json, 0, "", "cannot be written");
    fmt::print(out, "{}\n", ToJson(result).Dump(2));
    if (std::fclose(out) != 0) throw FileError(arguments.json, 0, "", "cannot be written whole");
  }
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler-robustness", argc, argv, tumbler::Main);
}
