#include "common/program.h"

#include <fmt/format.h>

#include <cstdio>
#include <exception>

namespace tumbler {
namespace {

void Say(const std::string& message) {
  std::fflush(stdout);  // So the message comes last where both streams go to one file.
  std::fputs((message + '\n').c_str(), stderr);
}

ExitStatus RunOrExplain(const std::string& speaker, int argc, char** argv,
                        ExitStatus (*run)(int argc, char** argv)) {
  try {
    return run(argc, argv);
  } catch (const HelpWanted& help) {
    std::fputs(help.what(), stdout);
    return ExitStatus::kDone;
  } catch (const UsageError& error) {
    Say(fmt::format("{}\nRun with --help for more information.", error.what()));
    return ExitStatus::kUnusable;
  } catch (const Refused& refused) {
    Say(fmt::format("{}: refused: {}", speaker, refused.what()));
    return ExitStatus::kRefused;
  } catch (const std::exception& error) {
    Say(fmt::format("{}: {}", speaker, error.what()));
    return ExitStatus::kUnusable;
  }
}

}  // namespace

int RunProgram(const std::string& speaker, int argc, char** argv,
               ExitStatus (*run)(int argc, char** argv)) {
  return static_cast<int>(RunOrExplain(speaker, argc, argv, run));
}

}  // namespace tumbler
