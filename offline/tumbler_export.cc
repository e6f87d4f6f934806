// tumbler-export: writes a primitive or a sequence as a C++ header, for a runtime without files.

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>

#include "common/command_line.h"
#include "common/motion_header.h"
#include "common/program.h"
#include "common/sequence_toml.h"
#include "common/toml_reader.h"

namespace tumbler {
namespace {

/// Writes a file, which appears under its name only when it is whole.
void WriteWhole(const std::string& path, const std::string& text) {
  const std::string temporary = fmt::format("{}.{}.tmp", path, getpid());
  std::error_code error;
  {
    std::ofstream stream(temporary, std::ios::binary);
    stream << text << std::flush;
    if (!stream) error = std::make_error_code(std::errc::io_error);
  }
  if (!error) std::filesystem::rename(temporary, path, error);
  if (!error) return;
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  throw FileError(path, 0, "", "cannot be written: name a file in a folder that can");
}

void Export(const std::string& motion, const std::string& header, const std::string& name) {
  // The hash has to be that of the text that was proved. The file is read before and after, so that
  // another text cannot take its place in between.
  const std::string text = ReadTextFile(motion);
  const SequenceFile file = LoadMotion(motion);
  if (ReadTextFile(motion) != text) {
    throw FileError(motion, 0, "", "changed while it was read: try again");
  }
  std::error_code error;
  if (std::filesystem::equivalent(motion, header, error))
    throw FileError(header, 0, "", "is the input; the header needs a file of its own");
  std::string out;
  try {
    out = ToHeader(file, text, name);
  } catch (const std::invalid_argument& problem) {
    throw FileError(motion, 0, "", problem.what());
  }
  if (header == "-") {
    fmt::print("{}", out);
  } else {
    WriteWhole(header, out);
  }
}

ExitStatus Main(int argc, char** argv) {
  std::string motion;
  std::string header;
  std::string name;
  CommandLine line(
      "Writes a primitive or a sequence as a C++ header for the runtime on a microcontroller.\n"
      "Exit status: 0 written; 1 bad input, and nothing written.");
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
