#pragma once

#include <array>
#include <chrono>
#include <cstdint>

#include "common/files/progress_line.h"
#include "offline/problem/problem.h"
#include "offline/solve/solver.h"

namespace tumbler {

/// Progress on standard error: one line that rewrites itself on a terminal, plain lines in a pipe,
/// the first of each stage and the first without a violation at once, and then one every 10 s.
class Progress {
 public:
  /// @param problem  must outlive this object.
  explicit Progress(const Problem& problem);

  void operator()(const Evaluation& evaluation);
  /// Ends the line that rewrites itself.
  void Finish() { line_.Finish(); }

 private:
  using Clock = std::chrono::steady_clock;

  const Problem& problem_;
  bool feasible_ = false;  // whether a motion without a violation was shown
  std::int64_t local_ = 0;
  ProgressLine line_;
  Clock::time_point last_ = Clock::now();
  // Of the search, and of the solves from its starts.
  std::array<Clock::duration, 2> spent_{};
  std::array<bool, 2> seen_{};
};

}  // namespace tumbler
