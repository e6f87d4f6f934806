#pragma once

namespace tumbler {

/// The exit statuses of all programs. The help of each program lists those that it has, with their
/// meaning there.
enum class ExitStatus : int {
  kDone = 0,
  /// Wrong usage, or a file, interface or peer that cannot be used. Nothing was changed.
  kUnusable = 1,
  /// The usage was right, but the work was not done: a check failed, or no solution was found.
  kRefused = 2,
  /// A fault of drives or bus ended the work, or is latched.
  kFault = 3,
  /// The work was done, but its result is not as it should be: the robot fell, parts of a record
  /// are damaged or missing, a file of a run could not be written whole, runs differ.
  kAmiss = 4,
  /// Ctrl-C or an operator ended the work. The number is 128 and that of SIGINT, as in shells.
  kInterrupted = 130,
};

}  // namespace tumbler
