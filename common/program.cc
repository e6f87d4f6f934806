#include "common/program.h"

#include <fmt/format.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <system_error>

#include "common/printable.h"

namespace tumbler {
namespace {

// A signal handler can only reach what is static.
std::atomic<bool> end_requested = false;

void Say(const std::string& message) {
  std::fflush(stdout);  // So the message comes last where both streams go to one file.
  std::fputs((Printable(message) + '\n').c_str(), stderr);
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
  // A file that grows beyond a limit is an error like a full disk, and no reason to leave a part of
  // it behind.
  std::signal(SIGXFSZ, SIG_IGN);
  const ExitStatus status = RunOrExplain(speaker, argc, argv, run);
  errno = 0;
  const bool flushed = std::fflush(stdout) == 0;
  const int why = errno;
  if (flushed && std::ferror(stdout) == 0) return static_cast<int>(status);
  // Who reads the output must not take a part for the whole.
  Say(fmt::format("{}: standard output could not be written whole{}{}", speaker,
                  why == 0 ? "" : ": ", why == 0 ? "" : std::generic_category().message(why)));
  return static_cast<int>(status == ExitStatus::kDone ? ExitStatus::kUnusable : status);
}

std::atomic<bool>& EndOnSignals() {
  struct sigaction action {};
  action.sa_handler = [](int /*signal*/) { end_requested = true; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
  return end_requested;
}

void IgnoreEndSignals() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_IGN);
}

}  // namespace tumbler
