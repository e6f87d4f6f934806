#include "common/files/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <system_error>

#include "common/files/command_text.h"
#include "common/files/printable.h"

namespace tumbler {
namespace {

// A signal handler can only reach what is static.
std::atomic<bool> end_requested = false;
constexpr std::array kOutputs = {STDOUT_FILENO, STDERR_FILENO};
std::array<std::atomic<bool>, 2> to_terminal = {false, false};  // each output

/// The terminal is gone: what would still be written to it goes nowhere, instead of failing.
void OnHangUp(int /*signal*/) {
  const int before = errno;
  end_requested = true;
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  for (std::size_t i = 0; i < kOutputs.size(); ++i) {
    if (to_terminal[i] && nowhere >= 0) dup2(nowhere, kOutputs[i]);
  }
  errno = before;
}

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

std::size_t WidthOfHelp() {
  constexpr std::size_t kNarrowest = 60;
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kHelpWidth;
  return std::clamp<std::size_t>(size.ws_col, kNarrowest, kHelpWidth);
}

int RunProgram(const std::string& speaker, int argc, char** argv,
               ExitStatus (*run)(int argc, char** argv)) {
  // For lists of processes: the file is only called `run`. The kernel keeps 15 characters.
  const bool by_tumbler = argc > 0 && std::string_view(argv[0]).starts_with("tumbler ");
  prctl(PR_SET_NAME, by_tumbler ? argv[0] : speaker.c_str());
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
  for (std::size_t i = 0; i < kOutputs.size(); ++i) to_terminal[i] = isatty(kOutputs[i]) == 1;
  struct sigaction hang_up {};
  sigaction(SIGHUP, nullptr, &hang_up);
  if (hang_up.sa_handler == SIG_IGN) return end_requested;  // nohup
  action.sa_handler = OnHangUp;
  sigaction(SIGHUP, &action, nullptr);
  return end_requested;
}

void IgnoreEndSignals() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_IGN);
  struct sigaction hang_up {};
  sigaction(SIGHUP, nullptr, &hang_up);
  // A terminal that goes only now still has to be left alone.
  if (hang_up.sa_handler != OnHangUp) std::signal(SIGHUP, SIG_IGN);
}

}  // namespace tumbler
