#include "offline/solve/search_in_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/solve/cma_es.h"
#include "offline/solve/constraints.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/ranked_motion.h"

namespace tumbler {
namespace in_space {
namespace {

class Campaign {
 public:
  Campaign(const Problem& problem, const SolveOptions& options, const SpaceSearch& search)
      : problem_(problem),
        options_(options),
        search_(search),
        rows_(DerivativeLimitRows(problem)),
        starts_(problem) {
    for (int t = 0; t < std::max(1, options.threads); ++t)
      coarse_.emplace_back(problem, problem.search.step_s);
  }

  SolveOutcome Run() {
    for (int attempt = 0; attempt < search_.attempts && !interrupted(); ++attempt) {
      const std::vector<double> found = Search(attempt);
      if (interrupted()) break;
      if (Solve(found, attempt)) break;
    }
    return Collect();
  }

  SolveOutcome RunFrom(std::span<const double> guess) {
    Solve({guess.begin(), guess.end()}, 0);
    return Collect();
  }

 private:
  [[nodiscard]] bool interrupted() const {
    return options_.interrupt != nullptr && *options_.interrupt;
  }

  /// The rank of a motion: its cost, and penalties for limits that it exceeds.
  double RankOf(const std::vector<double>& x, Rollout& rollout) const {
    std::vector<double> inside = x;
    double penalty = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Interval<double> bounds = problem_.bounds_of_parameter(static_cast<int>(i));
      inside[i] = std::clamp(x[i], bounds.min, bounds.max);
      penalty += (x[i] - inside[i]) * (x[i] - inside[i]);
    }
    for (const LinearRow& row : rows_) {
      const double above = std::max(0.0, row.Excess(inside));
      penalty += search_.limit_penalty * above * above;
    }
    RankedMotion ranked;
    ranked.SetRank(problem_, rollout.Estimate(inside));
    const double rank = ranked.rank + penalty;
    return std::isfinite(rank) ? rank : std::numeric_limits<double>::max();
  }

  /// The best motion that CMA-ES finds from a start of its own.
  std::vector<double> Search(int attempt) {
    const std::uint64_t seed = problem_.search.seed * 1000 + static_cast<std::uint64_t>(attempt);
    // The first attempt begins with the straight line from start to end.
    Problem calm = problem_;
    if (attempt == 0) calm.search.spread_rad = 0;
    const std::vector<double> start = attempt == 0
                                          ? RandomStarts(calm).Draw(0)
                                          : starts_.Draw(static_cast<std::uint64_t>(attempt));
    CmaEs cma(start, search_.sigma_rad, search_.population, seed);
    std::vector<double> best = start;
    double least = RankOf(start, coarse_.front());
    double before = least;
    for (int g = 0; g < search_.generations && !interrupted(); ++g) {
      const std::vector<std::vector<double>> candidates = cma.Ask();
      std::vector<double> ranks(candidates.size());
      ParallelFor(static_cast<int>(candidates.size()), options_.threads, [&](int i, int thread) {
        ranks[Index(i)] = RankOf(candidates[Index(i)], coarse_[Index(thread)]);
      });
      cma.Tell(ranks);
      searched_ += static_cast<std::int64_t>(ranks.size());
      const auto lowest = std::ranges::min_element(ranks);
      if (*lowest < least) {
        least = *lowest;
        best = candidates[static_cast<std::size_t>(lowest - ranks.begin())];
      }
      Tell({true, attempt, searched_, least, 0});
      if (g % search_.patience == search_.patience - 1) {
        if (!(least < 0.99 * before)) break;
        before = least;
      }
    }
    for (std::size_t i = 0; i < best.size(); ++i) {
      const Interval<double> bounds = problem_.bounds_of_parameter(static_cast<int>(i));
      best[i] = std::clamp(best[i], bounds.min, bounds.max);
    }
    return best;
  }

  /// Solves a motion on with the solver's steps. @returns whether it is as asked.
  bool Solve(const std::vector<double>& from, int attempt) {
    SolveOptions local = options_;
    local.progress = [&](const Evaluation& evaluation) {
      Evaluation named = evaluation;
      named.start = attempt;
      Tell(named);
    };
    Problem problem = problem_;
    const bool prove = problem.solver.prove;
    if (!prove) problem.solver.relative_tolerance = search_.enough;
    std::vector<Evaluation> history;
    Rollout screen(problem, problem.solver.screen_step_s);
    Solution solution =
        SolveFrom(problem, from, search_.screen_evaluations, screen, local, &history);
    const int before = solution.evaluations;
    if (!interrupted() && solution.rollout.finite) {
      Rollout fine(problem, problem.solver.step_s);
      const double start_cost = solution.start_cost;
      const int left = std::max(1, problem.solver.max_evaluations - before);
      solution =
          SolveFrom(problem, solution.x, prove ? left : std::min(left, search_.finish_evaluations),
                    fine, local, &history);
      const bool unproved = solution.end == SolveEnd::kEvaluations ||
                            solution.end == SolveEnd::kStalled ||
                            solution.kkt.relative.value_or(1) > problem.solver.kkt_residual;
      if (!prove && unproved && solution.feasible()) solution.end = SolveEnd::kUnproved;
      solution.evaluations += before;
      solution.start_cost = start_cost;
      solution.finished = true;
    }
    solution.start = attempt;
    if (solution.finished && solution.feasible() && options_.accept && !interrupted())
      solution.refused = !options_.accept(solution);
    const bool good = solution.finished && solution.feasible() && !solution.refused;
    solutions_.push_back(std::move(solution));
    return good;
  }

  void Tell(const Evaluation& evaluation) {
    history_.push_back(evaluation);
    if (options_.progress) options_.progress(evaluation);
  }

  SolveOutcome Collect() {
    SolveOutcome outcome;
    outcome.history = std::move(history_);
    outcome.evaluations = searched_;
    for (const Solution& solution : solutions_) outcome.evaluations += solution.evaluations;
    std::stable_sort(solutions_.begin(), solutions_.end(),
                     [](const Solution& a, const Solution& b) {
                       if (a.feasible() != b.feasible()) return a.feasible();
                       if (a.refused != b.refused) return b.refused;
                       if (!a.feasible()) return a.constraint_violation < b.constraint_violation;
                       return a.rollout.cost < b.rollout.cost;
                     });
    outcome.solutions = std::move(solutions_);
    outcome.interrupted = interrupted();
    return outcome;
  }

  const Problem& problem_;
  const SolveOptions& options_;
  SpaceSearch search_;
  std::vector<LinearRow> rows_;
  RandomStarts starts_;
  std::vector<Rollout> coarse_;  // by thread
  std::int64_t searched_ = 0;
  std::vector<Solution> solutions_;
  std::vector<Evaluation> history_;
};

}  // namespace
}  // namespace in_space

SolveOutcome SolveInSpace(const Problem& problem, const SolveOptions& options,
                          const SpaceSearch& search) {
  return in_space::Campaign(problem, options, search).Run();
}

SolveOutcome SolveInSpaceFrom(const Problem& problem, std::span<const double> guess,
                              const SolveOptions& options) {
  return in_space::Campaign(problem, options, {}).RunFrom(guess);
}

}  // namespace tumbler
