// tumbler-export: writes a primitive or a sequence as a C++ header, for a runtime without files.

#include <fmt/format.h>

#include <cstdio>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/command_line.h"
#include "common/motion_header.h"
#include "common/program.h"
#include "common/result_file.h"
#include "common/sequence_toml.h"
#include "common/toml_reader.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  written
  1  wrong usage, or a file that cannot be used or written: nothing was written)";

void Export(const std::string& motion, const std::string& header, const std::string& name) {
  // The header's hash has to be that of the text that was proved: each file is read once.
  std::map<std::string, std::string> texts;
  const SequenceFile file = LoadMotion(motion, [&texts](const std::string& path) {
    const auto known = texts.find(path);
    return known != texts.end() ? known->second
                                : texts.emplace(path, ReadTextFile(path)).first->second;
  });
  std::vector<std::string> inputs;
  inputs.reserve(texts.size());
  for (const auto& [path, text] : texts) inputs.push_back(path);
  CheckDistinct(inputs, {header});
  std::string out;
  try {
    out = ToHeader(file, texts.at(motion), name);
  } catch (const std::invalid_argument& problem) {
    throw FileError(motion, 0, "", problem.what());
  }
  WriteResult(header, out);
}

ExitStatus Main(int argc, char** argv) {
  std::string motion;
  std::string header;
  std::string name;
  CommandLine line(
      "Writes a primitive or a sequence as a C++ header for the runtime on a microcontroller.",
      "tumbler-export");
  line.SetFooter(kExitCodes);
  line.Option("MOTION", motion, "Primitive or sequence file (TOML)").Required();
  line.Option("--header", header, "Write to this file, or to standard output for -").Required();
  line.Option("--namespace", name, "Of the constants; default: motion_ and the motion's name");
  line.Parse(argc, argv);
  Export(motion, header, name);
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) { return tumbler::RunProgram("error", argc, argv, tumbler::Main); }
