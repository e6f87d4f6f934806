#include "offline/optimize/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace tumbler {

Progress::Progress(const Problem& problem)
    : problem_(problem), terminal_(isatty(STDERR_FILENO) == 1) {}

void Progress::operator()(const Evaluation& e) {
  if (e.global != global_) {
    Finish();
    global_ = e.global;
    stage_start_ = Clock::now();
    local_ = 0;
    shown_ = {};
  }
  if (!e.global) ++local_;
  const auto now = Clock::now();
  const SolverSettings& solver = problem_.solver;
  const int screened =
      problem_.search.refine * std::min(solver.screen_evaluations, solver.max_evaluations);
  const int finals =
      solver.finalists * std::max(0, solver.max_evaluations - solver.screen_evaluations);
  const double total = e.global ? problem_.search.max_samples : screened + finals;
  const double done = e.global ? static_cast<double>(e.count) : static_cast<double>(local_);
  // In a pipe every line stays.
  const bool first_feasible = !e.global && !problem_.robust && !feasible_ && e.violation == 0;
  feasible_ = feasible_ || first_feasible;
  if (!first_feasible && now - shown_ < (terminal_ ? std::chrono::milliseconds(100)
                                                   : std::chrono::milliseconds(10'000))) {
    return;
  }
  shown_ = now;
  if (problem_.robust) {
    Show(e.global ? fmt::format("search  {} random motions  best is {:.3g} off", e.count, e.cost)
                  : fmt::format("improve start {}  motion {:6d}  mean loss of its robots {:.4f}",
                                e.start + 1, e.count, e.cost));
    return;
  }
  const double elapsed = std::chrono::duration<double>(now - stage_start_).count();
  // The counts are those of a search that needs no other candidate; one that does goes on beyond.
  const std::string left =
      done < total ? fmt::format("  at most {:.1f} s left", elapsed / done * (total - done)) : "";
  const std::string text =
      e.global
          ? fmt::format("search  {:6d}/{} evaluations  best rank {:.5g}{}", e.count,
                        problem_.search.max_samples, e.cost, left)
          : fmt::format("solve   start {} of {}  evaluation {:4d}  cost {:.6g}  violation {:.1e}{}",
                        e.start + 1, problem_.search.refine, e.count, e.cost, e.violation, left);
  Show(text);
}

void Progress::Show(const std::string& text) {
  if (terminal_) {
    fmt::print(stderr, "\r\x1b[K{}", text);
    std::fflush(stderr);
    open_line_ = true;
  } else {
    fmt::print(stderr, "{}\n", text);
  }
}

void Progress::Finish() {
  if (open_line_) fmt::print(stderr, "\n");
  open_line_ = false;
}

}  // namespace tumbler
