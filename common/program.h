#pragma once

#include <stdexcept>
#include <string>

#include "common/exit_status.h"

namespace tumbler {

/// A command line that cannot be used. The message names the option: `--speed: what is wrong`.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
  UsageError(const std::string& option, const std::string& problem)
      : std::runtime_error(option + ": " + problem) {}
};

/// What was asked for, e.g. a run, may not be done. The message says why, and what to do.
class Refused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// No error: somebody asked for help instead of work. The message is the help's text.
class HelpWanted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The body of every `main`: runs a program and turns what it throws into a message and an exit
/// status. UsageError and any other exception are kUnusable, Refused is kRefused.
/// @param speaker  what messages on standard error begin with, e.g. the program's name.
/// @param run      the program, of the arguments that `main` was given.
int RunProgram(const std::string& speaker, int argc, char** argv,
               ExitStatus (*run)(int argc, char** argv));

}  // namespace tumbler
