#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/core/exit_status.h"

namespace tumbler {

/// The processes that do a work together, started by MPI's `mpirun`, each with a rank. Without it,
/// or in a build without MPI, there is one, of rank 0.
///
/// What is sent is text. All processes make the same calls in the same order; a process that cannot
/// go on calls Abort, which ends them all.
class Processes {
 public:
  /// Whether this build can talk to other processes.
  static bool Supported();

  /// At most one object in a program's life. @throws std::runtime_error  when `mpirun` started this
  /// process, and this build has no MPI: every process would do the whole work.
  Processes();
  ~Processes();
  Processes(const Processes&) = delete;
  Processes& operator=(const Processes&) = delete;

  [[nodiscard]] int rank() const { return rank_; }
  [[nodiscard]] int count() const { return count_; }

  /// The first process's text.
  [[nodiscard]] std::string FromFirst(std::string text) const;
  /// The texts of all, in the order of their ranks; empty in all but the first process.
  [[nodiscard]] std::vector<std::string> ToFirst(const std::string& text) const;
  /// Ends all processes with this exit status, where there are several.
  void Abort(int status) const;

 private:
  int rank_ = 0, count_ = 1;
  bool together_ = false;
};

/// The body of a program whose work processes share: with several, one that fails says why and ends
/// them all. @param speaker  the beginning of its message.
ExitStatus RunTogether(const std::string& speaker,
                       const std::function<ExitStatus(const Processes& processes)>& work);

}  // namespace tumbler
