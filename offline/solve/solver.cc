#include "offline/solve/solver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/solve/guess.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/ranked_motion.h"
#include "offline/solve/solve_near.h"

namespace tumbler {

const char* ToString(SolveEnd end) {
  switch (end) {
    case SolveEnd::kConverged:
      return "converged";
    case SolveEnd::kConvergedCoarsely:
      return "converged, but not by finer steps";
    case SolveEnd::kStalled:
      return "stopped making progress";
    case SolveEnd::kEnough:
      return "good as asked; the next step would lower the cost by less than a tenth";
    case SolveEnd::kEvaluations:
      return "evaluation budget used up";
    case SolveEnd::kGenerations:
      return "the search is over; more generations may find better";
    case SolveEnd::kTaken:
      return "taken from the guess as it is";
    case SolveEnd::kInfeasible:
      return "constraints contradict each other";
    case SolveEnd::kInterrupted:
      return "interrupted";
    case SolveEnd::kFailed:
      return "the rollout fails at the start";
  }
  return "unknown";
}

namespace {

/// When a refinement ends: first, as soon as a step promises less than a tenth of the cost; if
/// that is not good enough, a thousandth; if that is not either, when it has converged.
constexpr std::array kEnoughOfGuess = {0.1, 1e-3, 0.0};

/// So many further starts are tried where none has converged, though motions are good otherwise.
constexpr int kMoreStarts = 2;

/// The order of solutions, best first. One that has converged comes before one that has not, unless
/// its cost is more than twice as high.
bool Better(const Solution& a, const Solution& b) {
  if (a.finished != b.finished) return a.finished;
  if (a.feasible() != b.feasible()) return a.feasible();
  if (a.refused != b.refused) return b.refused;
  if (!a.feasible()) return a.constraint_violation < b.constraint_violation;
  const bool a_ended = a.end == SolveEnd::kConverged, b_ended = b.end == SolveEnd::kConverged;
  if (a_ended == b_ended) return a.rollout.cost < b.rollout.cost;
  const Solution &minimum = a_ended ? a : b, &other = a_ended ? b : a;
  const bool far_above = minimum.rollout.cost > other.rollout.cost + std::abs(other.rollout.cost);
  return far_above != a_ended;
}

/// The stages of Solve, and what it keeps between them. The result depends on the problem and its
/// seed alone: threads share the work of a stage, and never decide what comes next.
class Campaign {
 public:
  Campaign(const Problem& problem, const SolveOptions& options)
      : problem_(problem), options_(options), starts_(problem) {}

  SolveOutcome Run() {
    // A screened motion can still turn out to lie in one of the flat basins, or fall back into one
    // when its limits are met. Then the search goes on, as long as there are samples.
    int promising = 0;
    do {
      promising = std::max(promising, CountPromising(samples_)) + problem_.search.promising;
      Draw(promising);
      Screen();
      Finish(Candidates::kPromising);
    } while (missing() > 0 && static_cast<int>(samples_.size()) < problem_.search.max_samples &&
             tries_left() > 0 && !interrupted());
    if (missing() > 0) Finish(Candidates::kAll);
    std::stable_sort(solutions_.begin(), solutions_.end(), Better);
    return CollectOutcome();
  }

 private:
  [[nodiscard]] bool interrupted() const {
    return options_.interrupt != nullptr && *options_.interrupt;
  }
  [[nodiscard]] std::vector<Rollout> MakeRollouts(double step_s) const {
    std::vector<Rollout> rollouts;
    for (int t = 0; t < std::max(1, options_.threads); ++t) {
      rollouts.emplace_back(problem_, step_s, options_.contact ? options_.contact() : nullptr);
    }
    return rollouts;
  }

  /// Draws samples until this many are promising.
  void Draw(int promising) {
    std::vector<Rollout> estimates = MakeRollouts(problem_.search.step_s);
    std::vector<Rollout> rollouts = MakeRollouts(problem_.solver.screen_step_s);
    while (static_cast<int>(samples_.size()) < problem_.search.max_samples && !interrupted() &&
           CountPromising(samples_) < promising) {
      const int first = static_cast<int>(samples_.size());
      const int count = std::min(problem_.search.batch, problem_.search.max_samples - first);
      samples_.resize(samples_.size() + Index(count));
      ParallelFor(count, options_.threads, [&](int k, int thread) {
        if (interrupted()) return;
        const auto i = Index(first + k);
        const std::vector<double> x = starts_.Draw(i);
        samples_[i].SetRank(problem_, estimates[Index(thread)].Estimate(x));
        const std::lock_guard<std::mutex> lock(mutex_);
        best_rank_ = std::min(best_rank_, samples_[i].rank);
        if (options_.progress) options_.progress({true, 0, ++sampled_, best_rank_, 0});
      });
      // Samples that the estimate finds good are ranked again by the local solver's own method.
      std::vector<std::size_t> good;
      const double limit = PromisingRank(samples_);
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        if (samples_[i].IsPromising(limit) && !samples_[i].confirmed) good.push_back(i);
      }
      for (const std::size_t i : good) samples_[i].confirmed = true;
      ParallelFor(static_cast<int>(good.size()), options_.threads, [&](int k, int thread) {
        if (interrupted()) return;
        const std::size_t i = good[Index(k)];
        const std::vector<double> x = starts_.Draw(i);
        samples_[i].SetRank(problem_, rollouts[Index(thread)].Run(x));
      });
    }
  }

  /// Runs a short local solve from each of the best samples that have had none. Most show early
  /// whether they lead to a solution.
  void Screen() {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      if (!samples_[i].screened) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      const RankedMotion &left = samples_[a], &right = samples_[b];
      return left.misses_target != right.misses_target ? right.misses_target
                                                       : left.rank < right.rank;
    });
    order.resize(std::min(order.size(), Index(problem_.search.refine)));
    const std::size_t first = solutions_.size();
    solutions_.resize(first + order.size());
    histories_.resize(solutions_.size());
    std::vector<Rollout> rollouts = MakeRollouts(problem_.solver.screen_step_s);
    const int budget =
        std::min(problem_.solver.screen_evaluations, problem_.solver.max_evaluations);
    ParallelFor(static_cast<int>(order.size()), options_.threads, [&](int k, int thread) {
      Solution& solution = solutions_[first + Index(k)];
      solution.start = static_cast<int>(first) + k;
      solution.x = starts_.Draw(order[Index(k)]);
      SolveOn(solution, [&](const SolveOptions& local, std::vector<Evaluation>* history) {
        return SolveFrom(problem_, solution.x, budget, rollouts[Index(thread)], local, history,
                         Digits::kThatRoundingSpares);
      });
    });
    for (const std::size_t i : order) samples_[i].screened = true;
  }

  enum class Candidates { kPromising, kAll };

  /// Solves the best motions with the final step and the rest of their budget, until enough of them
  /// keep all limits and stand out.
  void Finish(Candidates candidates) {
    std::vector<NearRollouts> rollouts;
    for (int t = 0; t < std::max(1, options_.threads); ++t)
      rollouts.emplace_back(problem_, options_);
    while (missing() > 0 && tries_left() > 0 && !interrupted()) {
      const double limit = PromisingRank(samples_);
      std::vector<Solution*> next;
      for (Solution& solution : solutions_) {
        if (solution.finished) continue;
        if (candidates == Candidates::kAll || IsPromising(solution, limit))
          next.push_back(&solution);
      }
      if (next.empty()) return;
      std::stable_sort(next.begin(), next.end(),
                       [](const Solution* a, const Solution* b) { return Better(*a, *b); });
      next.resize(std::min({next.size(), Index(missing()), Index(tries_left())}));
      ParallelFor(static_cast<int>(next.size()), options_.threads, [&](int k, int thread) {
        Solution& solution = *next[Index(k)];
        const int budget = std::max(1, problem_.solver.max_evaluations - solution.evaluations);
        SolveOn(solution, [&](const SolveOptions& local, std::vector<Evaluation>* history) {
          return SolveNear(problem_, solution.x, budget, 0, rollouts[Index(thread)], local,
                           history);
        });
        solution.finished = true;
        const bool counts = candidates == Candidates::kAll || IsPromising(solution, limit);
        if (options_.accept && solution.feasible() && counts && !interrupted())
          solution.refused = !options_.accept(solution);
      });
    }
  }

  /// Number of finished motions that are still wanted: those that have converged count, and all
  /// good ones when there are more of them by kMoreStarts than wanted.
  [[nodiscard]] int missing() const {
    const double limit = PromisingRank(samples_);
    int good = 0, converged = 0;
    for (const Solution& solution : solutions_) {
      if (!solution.finished || !solution.feasible() || solution.refused) continue;
      if (!IsPromising(solution, limit)) continue;
      ++good;
      if (solution.end == SolveEnd::kConverged) ++converged;
    }
    const int wanted = problem_.solver.finalists;
    return good >= wanted + kMoreStarts ? 0 : std::max(0, wanted - converged);
  }
  /// Number of motions that may still be finished. It bounds the time that a hopeless task takes.
  [[nodiscard]] int tries_left() const {
    const auto tried = std::count_if(solutions_.begin(), solutions_.end(),
                                     [](const Solution& solution) { return solution.finished; });
    return problem_.solver.finalists + problem_.search.refine - static_cast<int>(tried);
  }

  SolveOutcome CollectOutcome() {
    SolveOutcome outcome;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      outcome.history.push_back({true, 0, static_cast<std::int64_t>(i) + 1, samples_[i].rank, 0});
    }
    for (const std::vector<Evaluation>& history : histories_) {
      outcome.history.insert(outcome.history.end(), history.begin(), history.end());
    }
    outcome.evaluations = static_cast<std::int64_t>(samples_.size());
    for (const Solution& solution : solutions_) outcome.evaluations += solution.evaluations;
    outcome.solutions = std::move(solutions_);
    outcome.interrupted = interrupted();
    return outcome;
  }

  /// Whether a motion is better than the flat basins, and near enough to its limits.
  [[nodiscard]] bool IsPromising(const Solution& solution, double promising_rank) const {
    constexpr double kNear = 0.2;
    return solution.evaluations > 0 && solution.rollout.finite &&
           solution.constraint_violation < kNear && solution.rollout.cost < promising_rank &&
           solution.rollout.target_error_rad <= problem_.search.basin_rad;
  }

  /// Continues the local solve from where the solution is.
  /// @param solve  takes options and a history, and returns what comes of it.
  template <class LocalSolver>
  void SolveOn(Solution& solution, LocalSolver&& solve) {
    const int start = solution.start;
    const int before = solution.evaluations;
    const double start_cost = solution.start_cost;
    SolveOptions local = options_;
    if (options_.progress) {
      local.progress = [&, start, before](const Evaluation& evaluation) {
        Evaluation named = evaluation;
        named.start = start;
        named.count += before;
        const std::lock_guard<std::mutex> lock(mutex_);
        options_.progress(named);
      };
    }
    std::vector<Evaluation> history;
    Solution found = solve(local, &history);
    for (Evaluation evaluation : history) {
      evaluation.start = start;
      evaluation.count += before;
      histories_[Index(start)].push_back(evaluation);
    }
    found.start = start;
    found.evaluations += before;
    if (before > 0) found.start_cost = start_cost;
    solution = std::move(found);
  }

  const Problem& problem_;
  const SolveOptions& options_;
  RandomStarts starts_;
  std::mutex mutex_;
  std::vector<RankedMotion> samples_;
  double best_rank_ = std::numeric_limits<double>::infinity();
  std::int64_t sampled_ = 0;
  std::vector<Solution> solutions_;
  std::vector<std::vector<Evaluation>> histories_;  // by start
};

/// Solves on from a motion that is nearly good, in one stage or two, until it is good enough.
class Refinement {
 public:
  Refinement(const Problem& problem, const SolveOptions& options)
      : problem_(problem), options_(options), rollouts_(problem, options) {
    options_.progress = nullptr;  // Several may run at a time, each for a moment.
  }

  Solution Run(std::span<const double> guess, int start) {
    Solution solution;
    solution.x.assign(guess.begin(), guess.end());
    solution.start = start;
    for (const double enough : kEnoughOfGuess) {
      SolveOn(solution, enough);
      if (interrupted() || (solution.feasible() && !solution.refused)) break;
    }
    return solution;
  }

  /// Solves a motion on with what is left of its budget.
  /// @param enough  as SolveNear's.
  void SolveOn(Solution& solution, double enough) {
    const int before = solution.evaluations;
    const int budget = problem_.solver.max_evaluations - before;
    if (budget <= 0) return;
    std::vector<Evaluation> history;
    Solution found = SolveNear(problem_, solution.x, budget, enough, rollouts_, options_, &history);
    for (Evaluation& evaluation : history) {
      evaluation.start = solution.start;
      evaluation.count += before;
      history_.push_back(evaluation);
    }
    if (before > 0) found.start_cost = solution.start_cost;
    found.evaluations += before;
    found.start = solution.start;
    found.finished = true;
    if (options_.accept && found.feasible() && !interrupted())
      found.refused = !options_.accept(found);
    solution = std::move(found);
  }
  [[nodiscard]] std::vector<Evaluation>& history() { return history_; }

 private:
  [[nodiscard]] bool interrupted() const {
    return options_.interrupt != nullptr && *options_.interrupt;
  }

  const Problem& problem_;
  SolveOptions options_;
  NearRollouts rollouts_;
  std::vector<Evaluation> history_;
};

/// The number of control points with which motions are searched for. The settings of the search
/// were chosen for it.
constexpr int kSearchPoints = 12;

Problem WithFewPoints(Problem problem) {
  for (ActuatedJoint& joint : problem.joints)
    joint.control_points = std::min(joint.control_points, kSearchPoints);
  return problem;
}

/// Solves the best motion on until it has converged, unless it is worse then.
void Converge(const Problem& problem, const SolveOptions& options, SolveOutcome& outcome) {
  Solution& best = outcome.solutions.front();
  if (outcome.interrupted || !best.feasible() || best.refused) return;
  Refinement refinement(problem, options);
  Solution further = best;
  refinement.SolveOn(further, 0);
  outcome.evaluations += further.evaluations - best.evaluations;
  outcome.history.insert(outcome.history.end(), refinement.history().begin(),
                         refinement.history().end());
  outcome.interrupted = options.interrupt != nullptr && *options.interrupt;
  if (further.feasible() && !further.refused && further.rollout.cost <= best.rollout.cost)
    best = std::move(further);
}

/// Finds a motion with few control points, and refines what is good enough of it.
SolveOutcome SolveWithManyPoints(const Problem& problem, const SolveOptions& options) {
  const Problem coarse = WithFewPoints(problem);
  std::mutex mutex;
  std::map<int, std::pair<Solution, std::vector<Evaluation>>> refined;  // by start
  const auto refine = [&](const Solution& solution) {
    Refinement refinement(problem, options);
    Solution fine =
        refinement.Run(WithControlPointsOf(problem, coarse, solution.x), solution.start);
    const bool good = fine.feasible() && !fine.refused;
    const std::lock_guard<std::mutex> lock(mutex);
    refined[solution.start] = {std::move(fine), std::move(refinement.history())};
    return good;
  };
  SolveOptions searching = options;
  searching.accept = refine;
  SolveOutcome outcome = Campaign(coarse, searching).Run();
  // What keeps its limits was refined to be judged. When nothing did, the best one shows why.
  if (refined.empty() && !outcome.solutions.empty()) refine(outcome.solutions.front());
  outcome.solutions.clear();
  for (auto& [start, fine] : refined) {
    outcome.evaluations += fine.first.evaluations;
    outcome.history.insert(outcome.history.end(), fine.second.begin(), fine.second.end());
    outcome.solutions.push_back(std::move(fine.first));
  }
  std::stable_sort(outcome.solutions.begin(), outcome.solutions.end(), Better);
  if (!outcome.solutions.empty()) Converge(problem, options, outcome);
  return outcome;
}

}  // namespace

SolveOutcome Solve(const Problem& problem, const SolveOptions& options) {
  const bool few = std::ranges::all_of(problem.joints, [](const ActuatedJoint& joint) {
    return joint.control_points <= kSearchPoints;
  });
  if (few) return Campaign(problem, options).Run();
  return SolveWithManyPoints(problem, options);
}

SolveOutcome SolveFromGuess(const Problem& problem, std::span<const double> guess,
                            const SolveOptions& options) {
  Refinement refinement(problem, options);
  SolveOutcome outcome;
  outcome.solutions.push_back(refinement.Run(guess, 0));
  outcome.evaluations = outcome.solutions.front().evaluations;
  outcome.history = std::move(refinement.history());
  outcome.interrupted = options.interrupt != nullptr && *options.interrupt;
  return outcome;
}

}  // namespace tumbler
