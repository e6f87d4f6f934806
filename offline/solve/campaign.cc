#include "offline/solve/campaign.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/solve/lane_rollout.h"
#include "offline/solve/lane_sensitivity.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/ranked_motion.h"
#include "offline/solve/solve_near.h"

namespace tumbler {
namespace {

/// So many further starts are tried where none has converged, though motions are good otherwise.
constexpr int kMoreStarts = 2;

/// Without a proof that is asked for, a solve goes on to the minimum for as long as the search took
/// that led to it, and from then on until a step promises less than this part of the cost.
constexpr double kEnoughWithoutProof = 1e-3;
/// The price of an evaluation of the dynamics with sensitivities, in those of a packet of motions.
constexpr double kPriceOfSensitivities = 3;
/// A screening in lanes takes as many evaluations more than one with SLSQP, each of which is
/// cheaper.
constexpr int kLaneEvaluations = 2;
/// What was screened in lanes goes on in them with the adaptive steps of where it is. These are
/// chosen anew so many times, and a few times more while it gets somewhere, with so many
/// evaluations each, and to this many times the residual that is wanted.
constexpr int kFirstGridRounds = 3, kGridRounds = 8, kGridEvaluations = 32;
constexpr double kNearlyOnGrid = 2;
/// A round after which the cost is larger by more than this part of it leads nowhere.
constexpr double kAstray = 0.5;
/// After so many evaluations with the final steps it is looked whether a motion is as asked.
constexpr int kFirstLook = 24;
/// So much work is never too dear for a proof: evaluations of the dynamics of packets, half a
/// second to one.
constexpr double kWorkOfAProof = 1.5e6;
/// At least so many batches of samples are drawn at a time in lanes, unless so many samples are
/// promising for each that is screened.
constexpr int kLaneBatches = 4, kManyPromising = 2;
/// What lanes leave this far beyond a limit is given up.
constexpr double kBeyondLimits = 0.02;
/// Fewer evaluations than this change nothing.
constexpr int kFewest = 5;
/// What is not good enough after so many evaluations beyond those that are affordable is given up.
constexpr int kMostWithoutProof = 40;

/// A motion that is away from cliffs may cost more than another that is not, by this part.
constexpr double kDearerForCalm = 0.5;

/// The stages, and what is kept between them.
class Campaign {
 public:
  Campaign(const Problem& problem, const SolveOptions& options, Asks asks)
      : problem_(problem), options_(options), asks_(asks), starts_(problem) {
    if (options.contact || LaneRollout::WhyNot(problem)) return;
    for (int t = 0; t < std::max(1, options.threads); ++t) lanes_.emplace_back(problem);
  }

  SolveOutcome Run() {
    // A screened motion can still turn out to lie in one of the flat basins, or fall back into one
    // when its limits are met. Then the search goes on, as long as there are samples.
    int promising = 0;
    do {
      promising = std::max(promising, CountPromising(samples_)) + problem_.search.promising;
      Draw(promising);
      Screen();
      if (options_.to == SolveTo::kMinimum) Finish(Candidates::kPromising);
    } while (missing() > 0 && static_cast<int>(samples_.size()) < problem_.search.max_samples &&
             tries_left() > 0 && !interrupted());
    if (missing() > 0) Finish(Candidates::kAll);
    std::stable_sort(solutions_.begin(), solutions_.end(), IsBetter);
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

  /// What ranks and improves motions in lanes.
  struct Lanes {
    explicit Lanes(const Problem& problem)
        : estimate(problem, problem.search.step_s, LanePlan::Scheme::kSemiImplicitEuler),
          solver(problem, problem.solver.screen_step_s, LanePlan::Scheme::kRungeKutta),
          sensitivity(problem, problem.solver.screen_step_s) {}

    LaneRollout estimate, solver;
    LaneSensitivity sensitivity;
  };

  enum class Accuracy { kEstimate, kSolver };

  /// Ranks samples by simulating them.
  void Rank(std::span<const std::size_t> samples, Accuracy accuracy) {
    const bool estimates = accuracy == Accuracy::kEstimate;
    const auto take = [&](std::size_t i, const RolloutResult& result) {
      samples_[i].SetRank(problem_, result);
      if (!estimates) return;
      const std::lock_guard<std::mutex> lock(mutex_);
      best_rank_ = std::min(best_rank_, samples_[i].rank);
      if (options_.progress) options_.progress({true, 0, ++sampled_, best_rank_, 0});
    };
    if (lanes_.empty()) {
      std::vector<Rollout> rollouts =
          MakeRollouts(estimates ? problem_.search.step_s : problem_.solver.screen_step_s);
      ParallelFor(static_cast<int>(samples.size()), options_.threads, [&](int k, int thread) {
        if (interrupted()) return;
        const std::size_t i = samples[Index(k)];
        Rollout& rollout = rollouts[Index(thread)];
        const std::vector<double> x = starts_.Draw(i);
        take(i, estimates ? rollout.Estimate(x) : rollout.Run(x));
      });
      return;
    }
    const std::size_t packets = (samples.size() + Packet::kLanes - 1) / Packet::kLanes;
    ParallelFor(static_cast<int>(packets), options_.threads, [&](int k, int thread) {
      if (interrupted()) return;
      const std::span<const std::size_t> packet =
          samples.subspan(Packet::kLanes * Index(k),
                          std::min(Packet::kLanes, samples.size() - Packet::kLanes * Index(k)));
      std::vector<std::vector<double>> x;
      for (const std::size_t i : packet) x.push_back(starts_.Draw(i));
      Lanes& lanes = lanes_[Index(thread)];
      const std::vector<RolloutResult> results = (estimates ? lanes.estimate : lanes.solver).Run(x);
      for (std::size_t lane = 0; lane < packet.size(); ++lane) take(packet[lane], results[lane]);
    });
    const Lanes& any = lanes_.front();
    work_ += static_cast<double>(packets) *
             static_cast<double>((estimates ? any.estimate : any.solver).evaluations());
  }

  /// Draws samples until this many are promising.
  void Draw(int promising) {
    // In lanes, many samples cost as much as a screening of one, which the best of many need not.
    const std::size_t first_sample = samples_.size();
    const auto enough = [&] {
      const int found = CountPromising(samples_);
      const auto drawn = static_cast<int>(samples_.size() - first_sample);
      return found >= promising &&
             (lanes_.empty() || drawn >= kLaneBatches * problem_.search.batch ||
              found >= kManyPromising * problem_.search.refine);
    };
    while (static_cast<int>(samples_.size()) < problem_.search.max_samples && !interrupted() &&
           !enough()) {
      const int first = static_cast<int>(samples_.size());
      const int count = std::min(problem_.search.batch, problem_.search.max_samples - first);
      samples_.resize(samples_.size() + Index(count));
      std::vector<std::size_t> batch(Index(count));
      std::iota(batch.begin(), batch.end(), Index(first));
      Rank(batch, Accuracy::kEstimate);
      // Samples that the estimate finds good are ranked again by the local solver's own method.
      std::vector<std::size_t> good;
      const double limit = PromisingRank(samples_);
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        if (samples_[i].IsPromising(limit) && !samples_[i].confirmed) good.push_back(i);
      }
      for (const std::size_t i : good) samples_[i].confirmed = true;
      Rank(good, Accuracy::kSolver);
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
    progress_.resize(solutions_.size());
    for (std::size_t k = 0; k < order.size(); ++k) {
      solutions_[first + k].start = static_cast<int>(first + k);
      solutions_[first + k].x = starts_.Draw(order[k]);
    }
    if (lanes_.empty()) {
      ScreenEach(first);
    } else {
      ScreenInLanes(first);
    }
    for (const std::size_t i : order) samples_[i].screened = true;
  }

  /// Screens the solutions from `first` on by SLSQP.
  void ScreenEach(std::size_t first) {
    std::vector<Rollout> rollouts = MakeRollouts(problem_.solver.screen_step_s);
    const int budget =
        std::min(problem_.solver.screen_evaluations, problem_.solver.max_evaluations);
    ParallelFor(
        static_cast<int>(solutions_.size() - first), options_.threads, [&](int k, int thread) {
          Solution& solution = solutions_[first + Index(k)];
          SolveOn(solution, [&](const SolveOptions& local, std::vector<Evaluation>* history) {
            return SolveFrom(problem_, solution.x, budget, rollouts[Index(thread)], local, history,
                             Digits::kThatRoundingSpares);
          });
        });
  }

  /// The same in lanes, as a race: after half of the evaluations the better half goes on, and of
  /// these after as many again, with twice as many.
  void ScreenInLanes(std::size_t first) {
    std::vector<std::size_t> racing(solutions_.size() - first);
    std::iota(racing.begin(), racing.end(), first);
    std::vector<NearMemory> memory(racing.size());
    std::vector<RankedMotion> ranks(racing.size());
    const int budget =
        std::min(problem_.solver.screen_evaluations, problem_.solver.max_evaluations);
    for (const int evaluations : {(budget + 1) / 2, (budget + 1) / 2, budget}) {
      ParallelFor(static_cast<int>(racing.size()), options_.threads, [&](int k, int thread) {
        const std::size_t i = racing[Index(k)];
        Solution& solution = solutions_[i];
        SolveOn(solution, [&](const SolveOptions& local, std::vector<Evaluation>* history) {
          return SolveNear(problem_, solution.x, NearLimits{evaluations},
                           lanes_[Index(thread)].sensitivity, local, history, &memory[i - first]);
        });
        ranks[i - first].SetRank(problem_, solution.rollout);
      });
      work_ += static_cast<double>(racing.size()) * evaluations *
               static_cast<double>(lanes_.front().sensitivity.packet_evaluations());
      std::stable_sort(racing.begin(), racing.end(), [&](std::size_t a, std::size_t b) {
        return ranks[a - first].rank < ranks[b - first].rank;
      });
      if (racing.empty() || interrupted()) return;
      const Solution& leader = solutions_[racing.front()];
      if (leader.end == SolveEnd::kConverged && leader.constraint_violation <= kNoViolation) break;
      racing.resize((racing.size() + 1) / 2);
    }
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
      std::stable_sort(next.begin(), next.end(), [this](const Solution* a, const Solution* b) {
        const bool a_later = progress_[Index(a->start)].put_off;
        return a_later != progress_[Index(b->start)].put_off ? !a_later : IsBetter(*a, *b);
      });
      const int before = tried();
      next.resize(std::min({next.size(), Index(missing()), Index(tries_left())}));
      ParallelFor(static_cast<int>(next.size()), options_.threads, [&](int k, int thread) {
        Solution& solution = *next[Index(k)];
        if (!SolveToEnd(solution, rollouts[Index(thread)], before)) return;
        solution.finished = true;
        const bool counts = candidates == Candidates::kAll || IsPromising(solution, limit);
        if (options_.accept && solution.feasible() && counts && !interrupted())
          solution.refused = !options_.accept(solution);
        const std::optional<Solution>& as_asked = progress_[Index(solution.start)].as_asked;
        if (as_asked && (!solution.feasible() || solution.refused) && !interrupted())
          GoBack(*as_asked, solution);
        if (options_.calm && solution.feasible() && !solution.refused && counts && !interrupted())
          solution.beside_cliff = !options_.calm(solution);
      });
      if (missing() == 0) return;
      for (const Solution* solution : next) {
        if (solution->finished && solution->feasible() && !solution->refused) Tell(*solution);
      }
    }
  }

  /// Takes a motion as it was before it was solved on, with the evaluations of what followed.
  static void GoBack(const Solution& known, Solution& solution) {
    const int evaluations = solution.evaluations;
    solution = known;
    solution.evaluations = evaluations;
    solution.finished = true;
  }

  /// What is known of a start besides its Solution, where lanes cover the problem.
  struct Progress {
    bool in_lanes = false;  ///< Whether it was solved on in lanes.
    bool put_off = false;   ///< Whether what came of the first evaluations is not as asked.
    int evaluations = 0;    ///< That it may still take with the final steps.
    double left = 0;        ///< Evaluations of the dynamics that it may still take for a proof.
    NearMemory memory;      ///< Of the solve with the final steps.
    /// What came of the first evaluations, where it is as asked.
    std::optional<Solution> as_asked;
  };

  /// Solves a screened motion to a minimum, or as far as it is worth while. After some evaluations
  /// with the final steps it looks whether the motion is as asked. If it is not, it may be so in
  /// the end, but it is put off: the next motion is there sooner.
  /// @param before  how many were solved to their end before it.
  /// @returns whether it was.
  bool SolveToEnd(Solution& solution, NearRollouts& rollouts, int before) {
    Progress& progress = progress_[Index(solution.start)];
    NearLimits limits;
    if (progress.evaluations == 0)
      progress.evaluations = std::max(1, problem_.solver.max_evaluations - screened(solution));
    limits.max_evaluations = progress.evaluations;
    limits.confirm = problem_.solver.prove;
    const double price = kPriceOfSensitivities * PacketEvaluations(problem_.solver.step_s);
    if (!lanes_.empty()) {
      if (!progress.in_lanes) SolveInLanes(solution, rollouts, before, progress);
      if (solution.constraint_violation > kBeyondLimits) return true;
      if (!problem_.solver.prove) {
        limits.enough = kEnoughWithoutProof;
        limits.enough_after = static_cast<int>(std::clamp(progress.left / price, 0.0, 1e6));
        limits.max_evaluations =
            std::min(limits.max_evaluations, limits.enough_after + kMostWithoutProof);
      }
    }
    const bool looks = asks_ == Asks::kEarly && options_.accept && !lanes_.empty();
    if (looks && !progress.put_off && limits.max_evaluations > 2 * kFirstLook) {
      NearLimits first = limits;
      first.max_evaluations = kFirstLook;
      first.enough = 0;
      SolveFinely(solution, first, rollouts, progress.memory);
      if (solution.end != SolveEnd::kEvaluations) return true;
      if (interrupted()) return true;
      limits.max_evaluations -= kFirstLook;
      limits.enough_after = std::max(0, limits.enough_after - kFirstLook);
      progress.evaluations -= kFirstLook;
      progress.left -= kFirstLook * price;
      if (solution.feasible()) {
        progress.put_off = !options_.accept(solution);
        if (progress.put_off) return false;
        progress.as_asked = solution;
        progress.as_asked->end = SolveEnd::kUnproved;
        Tell(solution);
      }
    }
    SolveFinely(solution, limits, rollouts, progress.memory);
    const bool out_of_work =
        solution.end == SolveEnd::kEnough || solution.end == SolveEnd::kEvaluations;
    if (limits.enough > 0 && out_of_work && solution.feasible()) solution.end = SolveEnd::kUnproved;
    return true;
  }

  /// Solves a screened motion on in lanes, as far as they lead it.
  void SolveInLanes(Solution& solution, NearRollouts& rollouts, int before, Progress& progress) {
    progress.in_lanes = true;
    progress.left = problem_.solver.prove ? std::numeric_limits<double>::infinity()
                                          : std::max(work_ / (1 + before), kWorkOfAProof);
    NearMemory memory;
    for (int round = 0; round < kGridRounds && progress.left > 0 && !interrupted(); ++round) {
      const double before_round = solution.rollout.cost;
      if (!SolveOnGrid(solution, rollouts, memory, progress.left)) break;
      // Where the steps of a motion do not do for the next one, lanes lead astray.
      if (solution.rollout.cost - before_round > kAstray * std::abs(before_round)) break;
      // After the first rounds, only what still gets somewhere goes on.
      const bool stalls =
          solution.end != SolveEnd::kConverged && solution.end != SolveEnd::kEvaluations;
      if (round + 1 >= kFirstGridRounds && stalls) break;
    }
  }

  /// Solves a motion on with the final steps.
  void SolveFinely(Solution& solution, const NearLimits& limits, NearRollouts& rollouts,
                   NearMemory& memory) {
    SolveOn(solution, [&](const SolveOptions& local, std::vector<Evaluation>* history) {
      return SolveNear(problem_, solution.x, limits, rollouts, local, history, &memory);
    });
  }

  /// Hands out a motion that is as asked, though the search goes on.
  void Tell(const Solution& solution) {
    if (!options_.interim || interrupted()) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    options_.interim(solution);
  }

  /// Solves a motion on in lanes, with the adaptive steps of where it is now, so that derivatives
  /// are nearly those of the solve that follows.
  /// @param memory  of the rounds before.
  /// @param left    evaluations of the dynamics that it may take; gets what is left.
  /// @returns whether that changed the motion.
  bool SolveOnGrid(Solution& solution, NearRollouts& rollouts, NearMemory& memory, double& left) {
    OutputGradients gradients = OutputGradients::Of(rollouts.coarse);
    if (!rollouts.coarse.Run(solution.x, gradients).finite) return false;
    left -= kPriceOfSensitivities * static_cast<double>(rollouts.coarse.statistics().evaluations);
    LaneSensitivity lanes(problem_, rollouts.coarse.grid());
    const double each = static_cast<double>(lanes.packet_evaluations());
    NearLimits limits;
    limits.max_evaluations =
        static_cast<int>(std::min(left / each, static_cast<double>(kGridEvaluations)));
    limits.nearly = kNearlyOnGrid;
    if (limits.max_evaluations < kFewest) return false;
    const int before = solution.evaluations;
    SolveOn(solution, [&](const SolveOptions& local, std::vector<Evaluation>* history) {
      return SolveNear(problem_, solution.x, limits, lanes, local, history, &memory);
    });
    const int taken = solution.evaluations - before;
    left -= each * taken;
    return solution.end != SolveEnd::kConverged || taken > kFewest;
  }

  /// Evaluations of the dynamics of a rollout with equal steps by the classical method.
  [[nodiscard]] double PacketEvaluations(double step_s) const {
    return 4 * (problem_.duration_s + problem_.settle_s) / step_s;
  }

  /// The evaluations of its budget that the screening of a motion took.
  [[nodiscard]] int screened(const Solution& solution) const {
    return lanes_.empty() ? solution.evaluations
                          : (solution.evaluations + kLaneEvaluations - 1) / kLaneEvaluations;
  }
  /// Number of finished motions that are still wanted: those that have converged away from cliffs
  /// count, and all good ones when there are more of them by kMoreStarts than wanted.
  [[nodiscard]] int missing() const {
    if (options_.to == SolveTo::kScreened) return 0;
    const double limit = PromisingRank(samples_);
    int good = 0, calm = 0, converged = 0;
    for (const Solution& solution : solutions_) {
      if (!solution.finished || !solution.feasible() || solution.refused) continue;
      if (!IsPromising(solution, limit)) continue;
      ++good;
      if (solution.beside_cliff) continue;
      ++calm;
      if (solution.end == SolveEnd::kConverged) ++converged;
    }
    // The best of those that were screened is enough where no proof is asked for.
    if (!problem_.solver.prove && !lanes_.empty()) return calm > 0 || good > kMoreStarts ? 0 : 1;
    const int wanted = problem_.solver.finalists;
    return good >= wanted + kMoreStarts ? 0 : std::max(0, wanted - converged);
  }
  /// Number of motions that may still be finished. It bounds the time that a hopeless task takes.
  [[nodiscard]] int tries_left() const {
    return problem_.solver.finalists + problem_.search.refine - tried();
  }
  [[nodiscard]] int tried() const {
    return static_cast<int>(std::ranges::count_if(solutions_, &Solution::finished));
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
  Asks asks_;
  RandomStarts starts_;
  std::mutex mutex_;
  std::vector<Lanes> lanes_;  // by thread; none where lanes do not cover the problem
  double work_ = 0;           // of the search, in evaluations of the dynamics of packets
  std::vector<RankedMotion> samples_;
  double best_rank_ = std::numeric_limits<double>::infinity();
  std::int64_t sampled_ = 0;
  std::vector<Solution> solutions_;
  std::vector<std::vector<Evaluation>> histories_;  // by start
  std::vector<Progress> progress_;                  // likewise
};

}  // namespace

SolveOutcome RunCampaign(const Problem& problem, const SolveOptions& options, Asks asks) {
  return Campaign(problem, options, asks).Run();
}

bool IsBetter(const Solution& a, const Solution& b) {
  if (a.finished != b.finished) return a.finished;
  if (a.feasible() != b.feasible()) return a.feasible();
  if (a.refused != b.refused) return b.refused;
  if (!a.feasible()) return a.constraint_violation < b.constraint_violation;
  if (a.beside_cliff != b.beside_cliff) {
    const Solution &calm = a.beside_cliff ? b : a, &other = a.beside_cliff ? a : b;
    const double more = kDearerForCalm * std::abs(other.rollout.cost);
    return (calm.rollout.cost <= other.rollout.cost + more) == b.beside_cliff;
  }
  const bool a_ended = a.end == SolveEnd::kConverged, b_ended = b.end == SolveEnd::kConverged;
  if (a_ended == b_ended) return a.rollout.cost < b.rollout.cost;
  const Solution &minimum = a_ended ? a : b, &other = a_ended ? b : a;
  const bool far_above = minimum.rollout.cost > other.rollout.cost + std::abs(other.rollout.cost);
  return far_above != a_ended;
}

}  // namespace tumbler
