#include "offline/certify/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

namespace tumbler {
Progress::Progress(const Problem& problem) : problem_(problem) {}

void Progress::operator()(const Evaluation& e) {
  // A search that needs further candidates goes back to its first stage; each has its own time.
  const std::size_t stage = e.global ? 0 : 1;
  const auto now = Clock::now();
  spent_[stage] += now - last_;
  last_ = now;
  if (!seen_[stage]) {
    line_.Finish();
    seen_[stage] = true;
    line_.Hasten();
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
  if (!first_feasible && !line_.Due()) return;
  if (e.stage == SearchStage::kModel) {
    line_.Show(fmt::format("search  motion {} for the model  cost {:.4g}", e.start + 1, e.cost));
    return;
  }
  if (e.stage == SearchStage::kArrivals) {
    line_.Show(fmt::format("lead    start {}  motion {:6d}  {:.3f} of its robots away from rest{}",
                           e.start + 1, e.count, std::min(e.cost, 1.0),
                           e.cost > 1 ? ", or a limit is exceeded" : ""));
    return;
  }
  if (problem_.robust) {
    line_.Show(e.global
                   ? fmt::format("search  {} random motions  best is {:.3g} off", e.count, e.cost)
                   : fmt::format("improve start {}  motion {:6d}  mean loss of its robots {:.4f}{}",
                                 e.start + 1, e.count, e.cost,
                                 e.cost >= 1 ? ": they fall, or a limit is exceeded" : ""));
    return;
  }
  if (e.by_robots) {
    line_.Show(
        fmt::format("improve {:7d} robots played  the best motion misses {:.4f}", e.count, e.cost));
    return;
  }
  if (problem_.space) {  // How many attempts it takes, and how long each, is not known.
    line_.Show(e.global
                   ? fmt::format("search  attempt {}  {:6d} evaluations  best rank {:.5g}",
                                 e.start + 1, e.count, e.cost)
                   : fmt::format("solve   attempt {}  evaluation {:4d}  cost {:.6g}  violation "
                                 "{:.1e}",
                                 e.start + 1, e.count, e.cost, e.violation));
    return;
  }
  const double elapsed = std::chrono::duration<double>(spent_[stage]).count();
  // The counts are those of a search that needs no other candidate; one that does goes on beyond,
  // and nothing is known of how long.
  const bool planned = done < total && (e.global || e.start < problem_.search.refine);
  std::string left = planned ? TimeLeft(elapsed, done, total) : "";
  if (!left.empty()) left = "  " + left;
  const std::string start = e.start < problem_.search.refine
                                ? fmt::format("start {} of {}", e.start + 1, problem_.search.refine)
                                : fmt::format("start {}, in place of another", e.start + 1);
  const std::string text =
      e.global ? fmt::format("search  {:6d}/{} evaluations  best rank {:.5g}{}", e.count,
                             problem_.search.max_samples, e.cost, left)
               : fmt::format("solve   {}  evaluation {:4d}  cost {:.6g}  violation {:.1e}{}", start,
                             e.count, e.cost, e.violation, left);
  line_.Show(text);
}

}  // namespace tumbler
