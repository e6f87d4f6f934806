#include "offline/solve/search_in_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/solve/cma_es.h"
#include "offline/solve/constraints.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/lane_rollout.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/ranked_motion.h"

namespace tumbler {
namespace in_space {
namespace {

/// The chord between two directions at a right angle, and a little more.
constexpr double kBeyondRightAngle = 1.5;

/// The cost of what cannot be simulated; more would be added to it.
constexpr double kWorst = std::numeric_limits<double>::max() / 4;

/// Attempts that lower the rank by less end.
constexpr double kGain = 0.01;

/// Penalties below this are those of no limit.
constexpr double kNoPenalty = 1e-9;

/// Whether a term asks for an axis that starts more than a right angle from where it is to point.
bool BeginsBehind(const CostTerm& term, const Problem& problem) {
  const bool of_axis =
      term.quantity.present() && term.quantity.of == SpaceQuantity::Of::kMisalignment;
  if (!of_axis || !term.draws() || term.when == CostTerm::When::kTime) return false;
  const std::vector<double> at_rest(problem.start_q.size());
  return term.quantity.Value(problem.start_q, at_rest, problem.space->start_orientation) >
         kBeyondRightAngle;
}

/// Coarse simulations by which candidates are ranked, eight at once in lanes where lanes cover the
/// problem: of one whose axes that start far from where they are to point are asked for at instants
/// of the motion, too (SpaceSearch::waypoints).
class Ranking {
 public:
  Ranking(const Problem& problem, int waypoints, int threads) : problem_(problem) {
    const std::size_t own_terms = problem.cost.size();
    for (std::size_t i = 0; i < own_terms; ++i) {
      if (!BeginsBehind(problem.cost[i], problem)) continue;
      for (int k = 1; k <= waypoints; ++k) {
        CostTerm& waypoint = problem_.cost.emplace_back(problem.cost[i]);
        waypoint.when = CostTerm::When::kTime;
        waypoint.time_s = problem.duration_s * k / (waypoints + 1.0);
      }
    }
    // Half of the settle phase tells as much about a candidate, where no term looks at the rest.
    double latest_s = 0;
    for (const CostTerm& term : problem.cost)
      if (term.when == CostTerm::When::kTime) latest_s = std::max(latest_s, term.time_s);
    problem_.settle_s =
        std::max(problem.settle_s / 2, std::min(problem.settle_s, latest_s - problem.duration_s));
    for (const CostInstant& instant : problem_.instants()) {
      for (std::size_t i = 0; i < problem_.cost.size(); ++i) {
        const CostTerm& term = problem_.cost[i];
        if (!term.draws() || !instant.Has(term)) continue;
        const double within = std::sqrt(term.weight) * term.tolerance;
        within_.push_back(i >= own_terms ? std::nullopt : std::optional(within));
      }
    }
    const bool in_lanes = !LaneRollout::WhyNot(problem_);
    for (int t = 0; t < std::max(1, threads); ++t) {
      if (in_lanes) {
        lanes_.emplace_back(problem_, problem_.search.step_s, LanePlan::Scheme::kSemiImplicitEuler);
      } else {
        coarse_.emplace_back(problem_, problem_.search.step_s);
      }
    }
  }

  [[nodiscard]] bool has_waypoints() const {
    return std::ranges::any_of(within_, [](const auto& within) { return !within; });
  }

  /// What a candidate costs.
  struct Costs {
    double own = 0;         ///< Of the problem.
    double missed = 0;      ///< Of that, by what it misses its targets.
    double waypoints = 0;   ///< What the waypoints add.
    double penalty = 0;     ///< For limits that it exceeds.
    bool on_target = true;  ///< Whether it meets the problem's targets.
  };
  /// @param x  parameters within their bounds, of at most Packet::kLanes candidates.
  std::vector<Costs> Of(std::span<const std::vector<double>> x, int thread) {
    std::vector<RolloutResult> results;
    if (lanes_.empty()) {
      for (const std::vector<double>& of : x)
        results.push_back(coarse_[Index(thread)].Estimate(of));
    } else {
      results = lanes_[Index(thread)].Run(x);
    }
    std::vector<Costs> costs;
    for (const RolloutResult& result : results) costs.push_back(CostsOf(result));
    return costs;
  }

 private:
  [[nodiscard]] Costs CostsOf(const RolloutResult& result) const {
    RankedMotion ranked;
    ranked.SetRank(problem_, result);
    if (!std::isfinite(ranked.rank)) return {kWorst};
    Costs costs;
    costs.penalty = ranked.rank - result.cost;
    for (std::size_t i = 0; i < result.residuals.size(); ++i) {
      const double residual = result.residuals[i];
      (within_[i] ? costs.missed : costs.waypoints) += residual * residual;
      if (within_[i] && !(std::abs(residual) <= *within_[i])) costs.on_target = false;
    }
    costs.own = result.cost - costs.waypoints;
    return costs;
  }

  Problem problem_;
  std::vector<std::optional<double>> within_;  // by residual, on target; none: of a waypoint
  std::vector<LaneRollout> lanes_;             // by thread; none: lanes do not cover the problem
  std::vector<Rollout> coarse_;                // else these
};

class Campaign {
 public:
  Campaign(const Problem& problem, const SolveOptions& options, const SpaceSearch& search)
      : problem_(problem),
        options_(options),
        search_(search),
        paths_(problem),
        rows_(paths_.Reduce(DerivativeLimitRows(problem))),
        starts_(problem),
        ranking_(problem, search.waypoints, options.threads) {}

  SolveOutcome Run() {
    const int attempts = ranking_.has_waypoints() ? search_.led_attempts : search_.attempts;
    for (int attempt = 0; attempt < attempts && !interrupted(); ++attempt) {
      Attempt search = Begin(attempt);
      SearchOn(search, search_.worth);
      if (interrupted()) {
        // Who keeps the best motion has this one at least, as it is.
        if (solutions_.empty()) Solve(paths_.Expand(search.motion), attempt);
        break;
      }
      // Something has to be said of what was found at last.
      if (search.led && attempt + 1 < attempts) continue;
      if (Solve(paths_.Expand(search.motion), attempt)) break;
      // What was on target and yet is not as asked may be so a little further on.
      if (!search.good() || interrupted()) continue;
      SearchOn(search, kGain);
      if (!interrupted() && Solve(paths_.Expand(search.motion), attempt)) break;
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

  /// What candidates cost.
  /// @param candidates  what is free of their paths.
  std::vector<Ranking::Costs> CostsOf(std::span<const std::vector<double>> candidates) {
    constexpr auto kPacket = Packet::kLanes;
    std::vector<Ranking::Costs> costs(candidates.size());
    const auto packets = static_cast<int>((candidates.size() + kPacket - 1) / kPacket);
    ParallelFor(packets, options_.threads, [&](int i, int thread) {
      const std::size_t first = Index(i) * kPacket;
      const std::size_t count = std::min(kPacket, candidates.size() - first);
      std::vector<std::vector<double>> motions;
      for (const std::vector<double>& y : candidates.subspan(first, count))
        motions.push_back(paths_.Expand(paths_.Inside(y)));
      std::ranges::copy(ranking_.Of(motions, thread), &costs[first]);
    });
    for (std::size_t i = 0; i < costs.size(); ++i) costs[i].penalty += BoundPenalty(candidates[i]);
    searched_ += static_cast<std::int64_t>(costs.size());
    return costs;
  }

  /// For bounds that a candidate exceeds.
  [[nodiscard]] double BoundPenalty(const std::vector<double>& y) const {
    const std::vector<double> inside = paths_.Inside(y);
    double penalty = 0;
    for (std::size_t i = 0; i < y.size(); ++i) penalty += (y[i] - inside[i]) * (y[i] - inside[i]);
    for (const LinearRow& row : rows_) {
      const double above = std::max(0.0, row.Excess(inside));
      penalty += search_.limit_penalty * above * above;
    }
    return penalty;
  }

  /// @param led  whether waypoints count.
  [[nodiscard]] double RankOf(const Ranking::Costs& costs, bool led) const {
    if (led || !ranking_.has_waypoints()) return costs.own + costs.waypoints + costs.penalty;
    // The targets weigh as much as they did together with their waypoints, so that motions which
    // came through these still rank far before the others.
    return costs.own + search_.waypoints * costs.missed + costs.penalty;
  }

  /// Where an attempt begins: the first one with the straight line from start to end, and each one
  /// that waypoints lead with the best of many random motions.
  std::vector<double> StartOf(int attempt) {
    const auto draw = [this](int sample) {
      return paths_.Reduce(starts_.Draw(static_cast<std::uint64_t>(sample)));
    };
    if (ranking_.has_waypoints()) {
      std::vector<std::vector<double>> draws;
      for (int i = 0; i < search_.draws; ++i) draws.push_back(draw(attempt * search_.draws + i));
      std::vector<double> ranks;
      for (const Ranking::Costs& costs : CostsOf(draws)) ranks.push_back(RankOf(costs, true));
      const auto lowest = std::ranges::min_element(ranks);
      return std::move(draws[static_cast<std::size_t>(lowest - ranks.begin())]);
    }
    if (attempt > 0) return draw(attempt);
    Problem calm = problem_;
    calm.search.spread_rad = 0;
    return paths_.Reduce(RandomStarts(calm).Draw(0));
  }

  /// A search from one start, as far as it has come.
  struct Attempt {
    int number = 0;
    CmaEs cma;
    bool led = false;            ///< Whether waypoints still count.
    std::vector<double> motion;  ///< The best, by what is free of its paths, within bounds.
    Ranking::Costs best;         ///< Of that motion.
    double enough = 0;           ///< What a motion near its targets misses them by, at most.
    int generation = 0;

    /// Whether it is on target and keeps its limits, by the coarse simulation.
    [[nodiscard]] bool good() const { return best.on_target && best.penalty < kNoPenalty; }
  };

  Attempt Begin(int number) {
    std::vector<double> start = StartOf(number);
    const std::uint64_t seed = problem_.search.seed * 1000 + static_cast<std::uint64_t>(number);
    const int population =
        std::clamp(3 * static_cast<int>(start.size()) / 4, 8, std::max(8, search_.population));
    CmaEs cma(start, search_.sigma_rad, population, seed);
    const Ranking::Costs costs = CostsOf({&start, 1}).front();
    return {number,
            std::move(cma),
            ranking_.has_waypoints(),
            paths_.Inside(std::move(start)),
            costs,
            search_.near * costs.missed};
  }

  /// Goes on by CMA-ES until nothing is gained any more.
  /// @param worth  the part by which half of the patience has to lower the rank of a motion that is
  /// good already.
  void SearchOn(Attempt& at, double worth) {
    double before = RankOf(at.best, at.led);
    int generations = 0;  // since then
    for (; at.generation < search_.generations && !interrupted(); ++at.generation) {
      const std::vector<std::vector<double>> candidates = at.cma.Ask();
      const std::vector<Ranking::Costs> costs = CostsOf(candidates);
      const auto near = std::ranges::count_if(
          costs, [&at](const Ranking::Costs& of) { return of.missed < at.enough; });
      // One that comes near may be alone among many that fall back.
      if (at.led && static_cast<double>(near) >= search_.most * static_cast<double>(costs.size())) {
        at.led = false;
        at.best = {kWorst};
        before = RankOf(at.best, at.led);
        generations = 0;
      }
      std::vector<double> ranks;
      for (const Ranking::Costs& of : costs) ranks.push_back(RankOf(of, at.led));
      at.cma.Tell(ranks);
      const auto lowest = std::ranges::min_element(ranks);
      if (*lowest < RankOf(at.best, at.led)) {
        at.best = costs[static_cast<std::size_t>(lowest - ranks.begin())];
        at.motion = paths_.Inside(candidates[static_cast<std::size_t>(lowest - ranks.begin())]);
      }
      Tell({true, at.number, searched_, RankOf(at.best, at.led), 0});
      // What is as asked is solved on faster than it is searched on.
      if (++generations < (at.good() || at.led ? search_.patience / 2 : search_.patience)) continue;
      const double least = at.led ? search_.led : at.good() ? worth : kGain;
      if (!(RankOf(at.best, at.led) < (1 - least) * before)) break;
      before = RankOf(at.best, at.led);
      generations = 0;
    }
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
    // A motion that had to be led to its targets is one among cliffs.
    const double box_rad =
        ranking_.has_waypoints() ? search_.box_rad : std::numeric_limits<double>::infinity();
    Solution solution = SolveFrom(problem, from, search_.screen_evaluations, screen, local,
                                  &history, Digits::kAll, box_rad);
    const double start_cost = solution.start_cost;
    int evaluations = solution.evaluations;
    if (!interrupted() && solution.rollout.finite) {
      Rollout fine(problem, problem.solver.step_s);
      const auto solve_on = [&](double box) {
        const int left = std::max(1, problem.solver.max_evaluations - evaluations);
        solution = SolveFrom(problem, solution.x,
                             prove ? left : std::min(left, search_.finish_evaluations), fine, local,
                             &history, Digits::kAll, box);
        evaluations += solution.evaluations;
      };
      solve_on(box_rad);
      // SLSQP may find no way on from a motion that breaks a limit by little.
      if (!solution.feasible() && solution.constraint_violation < search_.little && !interrupted())
        solve_on(search_.box_rad);
      const bool unproved = solution.end == SolveEnd::kEvaluations ||
                            solution.end == SolveEnd::kStalled ||
                            solution.kkt.relative.value_or(1) > problem.solver.kkt_residual;
      if (!prove && unproved && solution.feasible()) solution.end = SolveEnd::kUnproved;
      solution.start_cost = start_cost;
      solution.finished = true;
    }
    solution.evaluations = evaluations;
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
  FreePaths paths_;
  std::vector<LinearRow> rows_;  // by what is free of the paths
  RandomStarts starts_;
  Ranking ranking_;
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
