#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <vector>

namespace tumbler::testing {

/// A program that runs beside the test. Its standard output and error are collected in one text.
/// One that still runs at the end of the scope is killed.
class Program {
 public:
  /// @param given  the program's path first. Where it is a ProgramPath of a command, such as
  ///                   `.../bin/tumbler run`, the word behind the space is an argument.
  explicit Program(const std::vector<std::string>& given);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// Reads until the output has `part`. @returns false when the program ended without it, or
  /// printed nothing for 30 s.
  bool WaitFor(const std::string& part);
  void Signal(int signal) const;
  /// Waits for the end. @returns the exit status; 1000 plus the signal's number if a signal ended
  /// it.
  int Wait();
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  bool ReadSome();

  pid_t pid_ = -1;
  int output_ = -1;
  bool waited_ = false;
  int status_ = -1;
  std::string text_;
};

/// The outcome of a program.
struct Outcome {
  int exit_code = -1;  ///< As `Program::Wait` returns it.
  std::string text;    ///< Standard output and error.
};

/// The same with the command of `.../bin/tumbler run` as an argument of its own; others, such as
/// /usr/bin/env, may come before it.
std::vector<std::string> WithCommandApart(const std::vector<std::string>& given);

/// Runs a program of the build under test to its end.
/// @param arguments  the program's name first, such as `tumbler run`.
Outcome RunProgram(std::vector<std::string> arguments);
/// Runs a command line in a shell that finds the programs of the build under test.
Outcome RunInShell(const std::string& command_line);

/// Polls until the condition holds. @returns whether it did within 20 s.
bool Eventually(const std::function<bool()>& condition);

}  // namespace tumbler::testing
