#pragma once

namespace tumbler {

/// How a program ends: the same in all of them. Each says in its help which of these it has, and
/// what they mean of its own work.
enum class ExitStatus : int {
  kDone = 0,
  /// Wrong usage, or a file, interface or peer that cannot be used: nothing was changed.
  kUnusable = 1,
  /// What was asked for was not done, though nothing was wrong with how it was asked: a check
  /// failed, or no solution was found.
  kRefused = 2,
  /// A fault of drives or bus ended it, or is latched.
  kFault = 3,
  /// It was done, and what came out is not as it should be: the robot fell, parts of a record are
  /// damaged or missing, runs differ.
  kAmiss = 4,
  /// Ended by Ctrl-C or by an operator; 128 and the number of SIGINT, as shells have it.
  kInterrupted = 130,
};

}  // namespace tumbler
