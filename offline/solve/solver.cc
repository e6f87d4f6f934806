#include "offline/solve/solver.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <nlopt.hpp>
#include <numeric>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/solve/constraints.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/guess.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/solve_near.h"

namespace tumbler {
namespace {

/// A local solve has converged when what is left of the Kuhn-Tucker condition is below this part of
/// the cost's gradient, at its start or its end. Otherwise it only stopped making progress.
constexpr double kStationary = 1e-3;

/// Violations below this do not compete with the cost.
constexpr double kLeastViolation = 1e-7;

/// The rank of a motion in the global search: its cost, and penalties for limits that it exceeds,
/// as the solver would have to bend it far to keep them.
double Rank(const Problem& problem, const RolloutResult& result) {
  if (!result.finite) return std::numeric_limits<double>::infinity();
  double rank = result.cost;
  for (const double excess : result.torque_excess) {
    const double above = std::max(0.0, excess);
    rank += problem.search.torque_penalty * above * above;
  }
  rank += problem.search.core_penalty *
          std::max(0.0, result.peak_penetration_m / problem.scene.contact.d_on_m - 1);
  rank += problem.search.clearance_penalty * std::max(0.0, result.clearance_excess);
  return rank;
}

/// A random motion of the global search.
struct Sample {
  double rank = std::numeric_limits<double>::infinity();
  bool astray = false;     ///< Whether it ends far from its target.
  bool confirmed = false;  ///< Whether its rank was computed by the local solver's own method.
  bool screened = false;   ///< Whether it has had its local solve.

  void Look(const Problem& problem, const RolloutResult& result) {
    rank = confirmed ? std::max(rank, Rank(problem, result)) : Rank(problem, result);
    astray = result.target_error_rad > problem.search.basin_rad;
  }
  [[nodiscard]] bool StandsOut(double limit) const { return rank < limit && !astray; }
};

/// Samples with a rank below this stand out: they are below the median by more than half of its
/// size, and nearer to the best than to the median. Most samples end in one of the flat basins (the
/// robot at rest on its feet, or fallen), and the median lies there.
double PromisingRank(const std::vector<Sample>& samples) {
  if (samples.empty()) return -std::numeric_limits<double>::infinity();
  std::vector<double> sorted(samples.size());
  std::transform(samples.begin(), samples.end(), sorted.begin(),
                 [](const Sample& sample) { return sample.rank; });
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  if (!std::isfinite(*middle)) return -std::numeric_limits<double>::infinity();
  const double best = *std::min_element(sorted.begin(), middle + 1);
  return std::min(*middle - 0.5 * std::abs(*middle), 0.5 * (best + *middle));
}

int CountPromising(const std::vector<Sample>& samples) {
  const double limit = PromisingRank(samples);
  return static_cast<int>(
      std::count_if(samples.begin(), samples.end(),
                    [limit](const Sample& sample) { return sample.StandsOut(limit); }));
}

/// A value without what is below 2^-20 of a scale.
double RoundedTo(double value, double scale) {
  constexpr int kDigits = 20;
  int exponent = 0;
  if (!std::isfinite(value) || std::frexp(scale, &exponent) == 0) return value;
  return std::ldexp(std::round(std::ldexp(value, kDigits - exponent)), exponent - kDigits);
}

/// One SLSQP run, with NLopt's callbacks. Cost and constraints share one rollout for each point.
class LocalSolve {
 public:
  LocalSolve(const Problem& problem, int max_evaluations, Rollout& rollout,
             const SolveOptions& options, std::vector<Evaluation>* history, Digits digits)
      : digits_(digits),
        problem_(problem),
        max_evaluations_(max_evaluations),
        rollout_(rollout),
        options_(options),
        history_(history),
        rows_(DerivativeLimitRows(problem)),
        outputs_(OutputGradients::Zero(rollout.output_count(), rollout.parameter_count())) {}

  Solution Run(std::span<const double> start) {
    const std::size_t n = start.size();
    std::vector<double> x(start.begin(), start.end());
    Solution best;
    best.x = x;
    Evaluate(x, true);
    best.start_cost = result_.cost;
    if (!result_.finite) {
      best.rollout = result_;
      return best;
    }
    // |g| of order one half: a first step of SLSQP, which takes the Hessian for the identity, then
    // stays local.
    const double first_gradient = outputs_.row(0).lpNorm<Eigen::Infinity>();
    scale_ = 0.5 / std::max(first_gradient, 1e-3);
    best_violation_ = std::numeric_limits<double>::infinity();
    Remember();
    SolveEnd end = SolveEnd::kFailed;
    // SLSQP 2.7.1 can stop early or far from feasible: it is started again from the best point,
    // which also resets its Hessian, until that changes nothing.
    while (evaluations_ < max_evaluations_) {
      Evaluate(best_x_, true);
      best_cost_ = result_.cost;
      best_violation_ = std::max(LargestViolation(problem_, rows_, x_, result_), kLeastViolation);
      const double before = best_cost_ * scale_ + best_violation_;
      end = RunOnce(best_x_, n);
      if (end == SolveEnd::kInterrupted || end == SolveEnd::kEvaluations) break;
      const double merit = best_cost_ * scale_ + best_violation_;
      if (!(merit < before - 1e-3 * std::abs(before))) break;
    }
    best.x = best_x_;
    Evaluate(best.x, true);
    best.rollout = result_;
    const WorstConstraint worst = FindWorst(problem_, rows_, best.x, result_);
    best.constraint_violation = worst.value;
    best.worst_constraint = worst.name;
    best.core_reached = result_.peak_penetration_m >= problem_.scene.contact.d_on_m;
    if (end == SolveEnd::kConverged && best.constraint_violation > kNoViolation)
      end = SolveEnd::kInfeasible;
    best.evaluations = evaluations_;
    best.kkt = FindKktResidual(problem_, rows_, best.x, result_, outputs_);
    const double gradient = std::max(first_gradient, outputs_.row(0).lpNorm<Eigen::Infinity>());
    if (end == SolveEnd::kConverged && best.kkt.absolute > kStationary * gradient)
      end = SolveEnd::kStalled;
    best.end = end;
    return best;
  }

 private:
  SolveEnd RunOnce(std::vector<double> x, std::size_t n) {
    nlopt::opt opt(nlopt::LD_SLSQP, static_cast<unsigned>(n));
    std::vector<double> lower, upper;
    for (int i = 0; i < static_cast<int>(n); ++i) {
      const Interval<double> bounds = problem_.bounds_of_parameter(i);
      lower.push_back(bounds.min);
      upper.push_back(bounds.max);
    }
    opt.set_lower_bounds(lower);
    opt.set_upper_bounds(upper);
    // NLopt refuses a start that is outside of its bounds by a rounding, which sums come to be.
    for (std::size_t i = 0; i < n; ++i) x[i] = std::clamp(x[i], lower[i], upper[i]);
    opt.set_min_objective(&Objective, this);
    const bool own = !problem_.scene.self_contact.pairs.empty();
    const std::size_t constraints = rows_.size() + problem_.joints.size() + (own ? 2 : 1);
    opt.add_inequality_mconstraint(&Constraints, this, std::vector<double>(constraints, 1e-8));
    opt.set_ftol_rel(problem_.solver.relative_tolerance);
    opt.set_xtol_rel(1e-9);
    opt.set_maxeval(max_evaluations_ - evaluations_);
    opt_ = &opt;
    SolveEnd end = SolveEnd::kFailed;
    double value = 0;
    try {
      switch (opt.optimize(x, value)) {
        case nlopt::MAXEVAL_REACHED:
          end = SolveEnd::kEvaluations;
          break;
        default:
          end = SolveEnd::kConverged;
      }
    } catch (const nlopt::forced_stop&) {
      end = SolveEnd::kInterrupted;
    } catch (const nlopt::roundoff_limited&) {
      end = SolveEnd::kStalled;
    } catch (const std::runtime_error&) {
      // NLOPT_FAILURE: "more than iter SQP iterations" and its like mean inconsistent linearised
      // constraints.
      end = SolveEnd::kInfeasible;
    }
    opt_ = nullptr;
    if (failure_) std::rethrow_exception(failure_);
    return end;
  }

  /// SLSQP asks for the cost alone along a line, and for the gradient at the point of the line that
  /// it takes. As a rule it takes the first one: hence the first point gets its gradient at once,
  /// and the others only when it is asked for.
  void Evaluate(std::span<const double> x, bool with_gradient) {
    const bool known = x_.size() == x.size() && std::equal(x.begin(), x.end(), x_.begin());
    const bool first_of_line = settled_;
    settled_ = with_gradient;
    if (known && (has_gradient_ || !with_gradient)) return;
    x_.assign(x.begin(), x.end());
    has_gradient_ = with_gradient || first_of_line;
    result_ = has_gradient_ ? rollout_.Run(x_, outputs_) : rollout_.Run(x_);
    if (digits_ == Digits::kThatRoundingSpares) RoundOutputs();
    if (known) return;
    ++evaluations_;
    const double violation = LargestViolation(problem_, rows_, x_, result_);
    const Evaluation evaluation{false, 0, evaluations_, result_.cost, violation};
    if (history_ != nullptr) history_->push_back(evaluation);
    if (options_.progress) options_.progress(evaluation);
    if (scale_ > 0) Remember();
    if (options_.interrupt != nullptr && *options_.interrupt && opt_ != nullptr) opt_->force_stop();
  }

  void RoundOutputs() {
    const auto round = [](double& value) { value = RoundedTo(value, value); };
    round(result_.cost);
    for (double& excess : result_.torque_excess) round(excess);
    round(result_.penetration_excess);
    round(result_.clearance_excess);
    if (!has_gradient_) return;
    for (Eigen::Index row = 0; row < outputs_.rows(); ++row) {
      const double largest = outputs_.row(row).lpNorm<Eigen::Infinity>();
      for (double& slope : outputs_.row(row)) slope = RoundedTo(slope, largest);
    }
  }

  /// Keeps the best point seen: less violation first, and among feasible points the lower cost.
  void Remember() {
    if (!result_.finite) return;
    const double violation =
        std::max(LargestViolation(problem_, rows_, x_, result_), kLeastViolation);
    const bool better =
        violation < best_violation_ || (violation == best_violation_ && result_.cost < best_cost_);
    if (!better) return;
    best_x_ = x_;
    best_violation_ = violation;
    best_cost_ = result_.cost;
  }

  static double Objective(const std::vector<double>& x, std::vector<double>& gradient, void* data) {
    auto& self = *static_cast<LocalSolve*>(data);
    try {
      self.Evaluate(x, !gradient.empty());
      if (!self.result_.finite) return std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < gradient.size(); ++i) {
        gradient[i] = self.scale_ * self.outputs_(0, static_cast<Eigen::Index>(i));
      }
      return self.scale_ * self.result_.cost;
    } catch (...) {  // NLopt would lose the exception. It is kept and thrown after the run.
      self.failure_ = std::current_exception();
      self.opt_->force_stop();
      return std::numeric_limits<double>::infinity();
    }
  }

  static void Constraints(unsigned m, double* value, unsigned n, const double* x, double* gradient,
                          void* data) {
    auto& self = *static_cast<LocalSolve*>(data);
    try {
      self.Evaluate({x, n}, gradient != nullptr);
    } catch (...) {
      self.failure_ = std::current_exception();
      self.opt_->force_stop();
    }
    const std::size_t rows = self.rows_.size();
    const std::vector<double> simulated = SimulatedConstraints(self.problem_, self.result_);
    for (std::size_t i = 0; i < m; ++i) {
      if (i < rows) {
        std::optional<LinearRow> linear;
        if (self.rows_[i].of_free_duration) linear = self.rows_[i].LinearAt({x, n});
        const LinearRow& row = linear ? *linear : self.rows_[i];
        value[i] = row.b + std::inner_product(row.a.begin(), row.a.end(), x, 0.0);
        if (gradient != nullptr) std::copy(row.a.begin(), row.a.end(), gradient + i * n);
      } else {
        value[i] = self.result_.finite ? simulated[i - rows] : 1.0;
        for (std::size_t k = 0; gradient != nullptr && k < n; ++k) {
          gradient[i * n + k] =
              self.outputs_(static_cast<Eigen::Index>(i - rows + 1), static_cast<Eigen::Index>(k));
        }
      }
    }
  }

  const Digits digits_;
  const Problem& problem_;
  int max_evaluations_;
  Rollout& rollout_;
  const SolveOptions& options_;
  std::vector<Evaluation>* history_;
  std::vector<LinearRow> rows_;
  OutputGradients outputs_;
  std::vector<double> x_;
  RolloutResult result_;
  bool has_gradient_ = false;  // whether outputs_ belongs to x_
  bool settled_ = false;       // whether the last request was for a gradient
  double scale_ = 0;
  int evaluations_ = 0;
  std::vector<double> best_x_;
  double best_cost_ = 0;
  double best_violation_ = 0;
  nlopt::opt* opt_ = nullptr;
  std::exception_ptr failure_;
};

}  // namespace

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

Solution SolveFrom(const Problem& problem, std::span<const double> start, int max_evaluations,
                   Rollout& rollout, const SolveOptions& options, std::vector<Evaluation>* history,
                   Digits digits) {
  return LocalSolve(problem, max_evaluations, rollout, options, history, digits).Run(start);
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
      Finish(Candidates::kStandingOut);
    } while (missing() > 0 && static_cast<int>(samples_.size()) < problem_.search.max_samples &&
             tries_left() > 0 && !interrupted());
    if (missing() > 0) Finish(Candidates::kAll);
    std::stable_sort(solutions_.begin(), solutions_.end(), Better);
    return TakeOutcome();
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
        samples_[i].Look(problem_, estimates[Index(thread)].Estimate(x));
        const std::lock_guard<std::mutex> lock(mutex_);
        best_rank_ = std::min(best_rank_, samples_[i].rank);
        if (options_.progress) options_.progress({true, 0, ++sampled_, best_rank_, 0});
      });
      // Samples that the estimate finds good are ranked again by the local solver's own method.
      std::vector<std::size_t> good;
      const double limit = PromisingRank(samples_);
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        if (samples_[i].StandsOut(limit) && !samples_[i].confirmed) good.push_back(i);
      }
      for (const std::size_t i : good) samples_[i].confirmed = true;
      ParallelFor(static_cast<int>(good.size()), options_.threads, [&](int k, int thread) {
        if (interrupted()) return;
        const std::size_t i = good[Index(k)];
        const std::vector<double> x = starts_.Draw(i);
        samples_[i].Look(problem_, rollouts[Index(thread)].Run(x));
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
      const Sample &left = samples_[a], &right = samples_[b];
      return left.astray != right.astray ? right.astray : left.rank < right.rank;
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

  enum class Candidates { kStandingOut, kAll };

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
        if (candidates == Candidates::kAll || StandsOut(solution, limit)) next.push_back(&solution);
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
        const bool counts = candidates == Candidates::kAll || StandsOut(solution, limit);
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
      if (!StandsOut(solution, limit)) continue;
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

  SolveOutcome TakeOutcome() {
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
  [[nodiscard]] bool StandsOut(const Solution& solution, double promising_rank) const {
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
  std::vector<Sample> samples_;
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
