// tumbler export: writes a primitive or a sequence for others: as a C++ header, for a runtime
// without files; as MJCF and as a table of setpoints, for simulators.

#include <fmt/format.h>

#include <cstdio>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/files/command_line.h"
#include "common/files/motion_header.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/programs/mjcf.h"
#include "offline/programs/setpoints.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  written
  1  wrong usage, or a file that cannot be used or written: nothing was written)";

struct Outputs {
  std::string header, mjcf, setpoints_csv;
};

/// A file that was read whole, and with it all that it names.
struct Input {
  std::map<std::string, std::string> texts;  ///< By path.
  SequenceFile file;
};

Input Read(const std::string& motion) {
  Input input;
  // The header's hash has to be that of the text that was proved: each file is read once.
  input.file = LoadMotion(motion, [&input](const std::string& path) {
    const auto known = input.texts.find(path);
    return known != input.texts.end() ? known->second
                                      : input.texts.emplace(path, ReadTextFile(path)).first->second;
  });
  return input;
}

/// Makes all outputs before it writes any.
void Export(const std::string& motion, const Outputs& outputs, const std::string& name,
            const SetpointOptions& options) {
  const Input input = Read(motion);
  std::vector<std::string> inputs;
  inputs.reserve(input.texts.size());
  for (const auto& [path, text] : input.texts) inputs.push_back(path);
  std::vector<std::pair<std::string, std::string>> written;
  std::vector<std::string> paths;
  const auto write = [&](const std::string& path, const auto& make) {
    if (path.empty()) return;
    paths.push_back(path);
    written.emplace_back(path, make());
  };
  try {
    write(outputs.header, [&] { return ToHeader(input.file, input.texts.at(motion), name); });
    if (!outputs.mjcf.empty() || !outputs.setpoints_csv.empty()) {
      const SimulatedMotion simulated(input.file, TaskSpaces::kPlaneAndSpace);
      RequireSameGround(simulated);
      RequireOneRobot(simulated);
      const DriveGains gains = simulated.ProblemAt(input.file.graph.start).drive_gains();
      write(outputs.mjcf, [&] { return ToMjcf(simulated, gains); });
      write(outputs.setpoints_csv, [&] { return SetpointsCsv(input.file, gains, options); });
    }
  } catch (const std::invalid_argument& problem) {
    throw FileError(motion, 0, "", problem.what());
  }
  CheckDistinct(inputs, paths);
  for (const auto& [path, text] : written) WriteResult(path, text);
}

ExitStatus Main(int argc, char** argv) {
  std::string motion;
  Outputs outputs;
  std::string name;
  SetpointOptions options;
  CommandLine line(
      "Writes a primitive or a sequence for others: as a C++ header for the runtime on a "
      "microcontroller; as a model and setpoints for simulators.",
      "tumbler export");
  line.SetFooter(kExitCodes);
  line.Option("MOTION", motion, "Primitive or sequence file (TOML)").Required();
  line.Option("--header", outputs.header,
              "Write the C++ header to this file, or to standard output for -");
  line.Option(
      "--mjcf", outputs.mjcf,
      "Write robot, ground and start to this file, for MuJoCo, or to standard output for -");
  line.Option(
      "--setpoints-csv", outputs.setpoints_csv,
      "Write setpoints, with holds and exchanged roles, to this file, or to standard output "
      "for -");
  line.Option("--namespace", name, "Of the constants; default: motion_ and the motion's name");
  line.Option("--rate-hz", options.rate_hz, "Setpoints a second").Within(1.0, 1e6).ShowDefault();
  line.Option("--lead-s", options.lead_s, "How long the start is held first")
      .Within(0.0, 1e3)
      .ShowDefault();
  line.Option("--cycles", options.cycles, "Of a sequence, before it ends")
      .Within(0, 1000000)
      .ShowDefault();
  line.Option("--branch", options.branch, "Go on after the cycles until this branch is taken");
  line.Parse(argc, argv);
  if (outputs.header.empty() && outputs.mjcf.empty() && outputs.setpoints_csv.empty())
    throw UsageError("nothing to write: give --header, --mjcf or --setpoints-csv");
  Export(motion, outputs, name, options);
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler export", argc, argv, tumbler::Main);
}
