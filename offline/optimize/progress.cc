#include "offline/optimize/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

namespace tumbler {
namespace {

/// What a stage still takes is not judged by its first moments.
constexpr double kJudgeAfter_s = 0.5;

}  // namespace

Progress::Progress(const Problem& problem)
    : problem_(problem), terminal_(isatty(STDERR_FILENO) == 1) {}

void Progress::operator()(const Evaluation& e) {
  // A search that needs further candidates goes back to its first stage; each has its own time.
  const std::size_t stage = e.global ? 0 : 1;
  const auto now = Clock::now();
  spent_[stage] += now - last_;
  last_ = now;
  if (!seen_[stage]) {
    Finish();
    seen_[stage] = true;
    shown_ = {};
  }
  if (!e.global) ++local_;
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
  const double elapsed = std::chrono::duration<double>(spent_[stage]).count();
  // The counts are those of a search that needs no other candidate; one that does goes on beyond,
  // and nothing is known of how long.
  const bool planned = done < total && (e.global || e.start < problem_.search.refine);
  const std::string left =
      planned && elapsed >= kJudgeAfter_s
          ? fmt::format("  at most {:.1f} s left", elapsed / done * (total - done))
          : "";
  const std::string start = e.start < problem_.search.refine
                                ? fmt::format("start {} of {}", e.start + 1, problem_.search.refine)
                                : fmt::format("start {}, in place of another", e.start + 1);
  const std::string text =
      e.global ? fmt::format("search  {:6d}/{} evaluations  best rank {:.5g}{}", e.count,
                             problem_.search.max_samples, e.cost, left)
               : fmt::format("solve   {}  evaluation {:4d}  cost {:.6g}  violation {:.1e}{}", start,
                             e.count, e.cost, e.violation, left);
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
