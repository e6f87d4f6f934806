#pragma once

#include <atomic>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "common/core/exit_status.h"

namespace tumbler {

/// Thrown when a command line cannot be used. The message names the option: `--speed: what is
/// wrong`.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
  UsageError(const std::string& option, const std::string& problem)
      : std::runtime_error(option + ": " + problem) {}
};

/// Thrown when a request, e.g. for a run, may not be carried out. The message has the reason and
/// the remedy.
class Refused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Thrown when the command line asks for a text, such as help or version, which is no error. The
/// message is the help's text.
class HelpWanted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// How wide help may be: as wide as the terminal that standard output is, so that it does not break
/// lines once more; at most kHelpWidth, and that where it is no terminal [characters].
std::size_t WidthOfHelp();

/// The body of every `main`: runs a program, and turns what it throws into a message and an exit
/// status. Refused becomes kRefused; UsageError and any other exception become kUnusable, and so
/// does an output that could not be written whole to standard output, e.g. since a disk is full.
/// @param speaker  the beginning of messages on standard error, such as `tumbler run`, and the name
///                 in lists of processes where `tumbler` has not given one.
/// @param run      the program, called with the arguments of `main`.
int RunProgram(const std::string& speaker, int argc, char** argv,
               ExitStatus (*run)(int argc, char** argv));

/// Makes the first SIGINT, SIGTERM or SIGHUP request an end of the program's work, and the same
/// signal once more end the program at once. With SIGHUP, which says that the terminal is gone,
/// what would be written to it goes nowhere; a program that was started to outlive it (nohup) does.
/// @returns whether an end was requested.
std::atomic<bool>& EndOnSignals();

/// Lets none of these signals do anything from here on, e.g. so that files are written whole.
void IgnoreEndSignals();

}  // namespace tumbler
