// tumbler sign: makes a primitive that was changed by hand loadable again, and says in it that it
// was.

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

#include "common/files/command_line.h"
#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"
#include "offline/problem/simulated_motion.h"

namespace tumbler {
namespace {

constexpr const char* kExitCodes =
    R"(Exit codes:
  0  signed
  1  wrong usage, or a file that cannot be used or written, or that no program could play: nothing was changed)";

ExitStatus Main(int argc, char** argv) {
  std::string primitive;
  std::string reason;
  CommandLine line(
      "Signs a primitive that was changed by hand: margins and hashes become those of what it "
      "says now, and its key provenance.edited says why it was changed. What the certificate says "
      "of contact, torque and gradient stays that of the motion before the change.",
      "tumbler sign");
  line.SetFooter(kExitCodes);
  line.Option("PRIMITIVE", primitive, "Primitive file (TOML), which is replaced").Required();
  line.Option("--because", reason, "Why it was changed, for those who will play it").Required();
  line.Parse(argc, argv);
  CheckWritable(primitive);
  const std::string text = SignEdited(ReadTextFile(primitive), primitive, reason);
  // What would be refused wherever it is played is not signed: the texts in it are read as well.
  SequenceFile alone;
  alone.path = primitive;
  alone.primitives.push_back(ParsePrimitive(text, primitive));
  alone.primitive_names.emplace_back(alone.primitives.front().primitive.name.view());
  static_cast<void>(SimulatedMotion(std::move(alone), TaskSpaces::kPlaneAndSpace).ProblemOf(0));
  PendingFile(primitive, text).Commit();
  fmt::print("{}: signed as changed by hand: {}\n", primitive, reason);
  return ExitStatus::kDone;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** argv) {
  return tumbler::RunProgram("tumbler sign", argc, argv, tumbler::Main);
}
