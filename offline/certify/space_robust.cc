#include "offline/certify/space_robust.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"
#include "offline/certify/certificate.h"
#include "offline/scene/variation.h"
#include "offline/solve/cma_es.h"
#include "offline/solve/constraints.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/rollout.h"

namespace tumbler {
namespace in_space {
namespace {

constexpr std::uint64_t kRobotSeed = 0x51f0b0a7;  // so that robots say nothing of the motion's seed
constexpr std::uint64_t kJudgeSeed = 0x1a57f1f7, kFreshSeed = 0x7e57ab1e;
/// Parts of the solver's step in the search, where nothing but ranks is asked for.
constexpr double kFiner = 2;
/// Motions that the last judges see, besides the one that was found for the model.
constexpr int kFinalists = 6;
/// The search ends when in so many generations in a row the best candidate missed nothing.
constexpr int kGoodGenerations = 4;
/// A target counts as missed from this part of its tolerance on: what serves ten robots by a hair
/// does not serve a hundred.
constexpr double kPart = 0.6;
/// Of the square of what a limit is exceeded by.
constexpr double kLimitPenalty = 1e4;
/// What a robot loses whose motion is none.
constexpr double kWild = 1e3;

class RobustSearch {
 public:
  RobustSearch(const Problem& problem, std::span<const PurposeFigure> purpose,
               const SolveOptions& options)
      : problem_(problem),
        robust_(*problem.space->robust),
        options_(options),
        targets_(DueTargetsInSpace(problem, purpose)),
        paths_(problem),
        rows_(DerivativeLimitRows(problem)) {
    for (int t = 0; t < std::max(1, options.threads); ++t)
      rollouts_.emplace_back(problem, problem.solver.screen_step_s);
  }

  RobustInSpace Run(const std::vector<double>& found) {
    RobustInSpace result;
    std::vector<std::vector<double>> kept = {found};
    CmaEs cma(paths_.Reduce(found), robust_.sigma_rad, robust_.candidates, problem_.search.seed);
    int good = 0;
    for (int g = 0; g < robust_.generations && !interrupted() && good < kGoodGenerations; ++g) {
      const std::vector<PlayedRobot<Spatial>> robots =
          Draw(kRobotSeed + static_cast<std::uint64_t>(g), robust_.robots);
      const std::vector<std::vector<double>> free = cma.Ask();
      std::vector<std::vector<double>> candidates;
      for (const std::vector<double>& y : free) candidates.push_back(paths_.Expand(y));
      std::vector<double> losses(candidates.size());
      ParallelFor(static_cast<int>(candidates.size()), options_.threads, [&](int i, int thread) {
        if (interrupted()) return;
        losses[Index(i)] = LossOf(candidates[Index(i)], robots, thread);
      });
      if (interrupted()) break;
      cma.Tell(losses);
      played_ += static_cast<std::int64_t>(candidates.size() * robots.size());
      const auto best = std::ranges::min_element(losses);
      good = *best == 0 ? good + 1 : 0;
      // The mean is less of a lucky draw than the best of the candidates.
      if (g % 5 == 4) kept.push_back(Inside(paths_.Expand(cma.mean())));
      kept.push_back(Inside(candidates[static_cast<std::size_t>(best - losses.begin())]));
      Tell(*best);
    }
    kept.push_back(Inside(paths_.Expand(cma.mean())));
    Choose(std::move(kept), result);
    result.played = played_;
    return result;
  }

  int CountFresh(const std::vector<double>& x, int count) {
    const std::vector<PlayedRobot<Spatial>> robots = Draw(kFreshSeed, count);
    const auto feed_forward = FeedForwardOf(x, rollouts_.front());
    constexpr int kPacket = Packet::kLanes;
    std::vector<int> as_asked(Index((count + kPacket - 1) / kPacket));  // by packet
    ParallelFor(static_cast<int>(as_asked.size()), options_.threads, [&](int i, int /*thread*/) {
      if (interrupted()) return;
      const auto some = std::span(robots).subspan(Index(kPacket * i),
                                                  Index(std::min(kPacket, count - kPacket * i)));
      const std::vector<SpaceTrial> trials =
          TryInSpace(problem_, x, feed_forward, targets_, some, 0);
      as_asked[Index(i)] = static_cast<int>(std::ranges::count_if(trials, &SpaceTrial::as_asked));
    });
    return std::accumulate(as_asked.begin(), as_asked.end(), 0);
  }

 private:
  [[nodiscard]] bool interrupted() const {
    return options_.interrupt != nullptr && *options_.interrupt;
  }

  [[nodiscard]] std::vector<PlayedRobot<Spatial>> Draw(std::uint64_t seed, int count) const {
    std::vector<PlayedRobot<Spatial>> robots;
    const SpaceScene& model = problem_.space->scene;
    for (int i = 0; i < count; ++i) {
      const RobotVariation variation = DrawRobot(
          model, robust_.spreads, 1, seed + problem_.search.seed, static_cast<std::uint64_t>(i));
      PlayedRobot<Spatial> robot{Varied(model, variation), problem_.drive_gains()};
      robot.period_s = robust_.period_s;
      robot.finer = kFiner;
      robots.push_back(std::move(robot));
    }
    return robots;
  }

  /// The nearest motion within the limits of position, whose ties hold.
  [[nodiscard]] std::vector<double> Inside(const std::vector<double>& x) const {
    return paths_.Expand(paths_.Inside(paths_.Reduce(x)));
  }

  /// What the model exceeds its limits by, as the sum of squares of parts of them.
  double ExcessOf(const std::vector<double>& x, Rollout& rollout) const {
    double sum = 0;
    const auto add = [&sum](double excess) {
      sum += std::max(0.0, excess) * std::max(0.0, excess);
    };
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Interval<double> bounds = problem_.bounds_of_parameter(static_cast<int>(i));
      add(bounds.min - x[i]);
      add(x[i] - bounds.max);
    }
    for (const LinearRow& row : rows_) add(row.Excess(x));
    const RolloutResult result = rollout.Run(x);
    if (!result.finite) return std::numeric_limits<double>::infinity();
    for (const double excess : result.torque_excess) add(excess);
    add(result.peak_penetration_m / problem_.contact().d_on_m - 1);
    add(result.clearance_excess);
    return sum;
  }

  /// The feed-forward of a motion, by the search's steps.
  [[nodiscard]] std::vector<JointMotion<double>::Spline> FeedForwardOf(const std::vector<double>& x,
                                                                       Rollout& rollout) const {
    TorqueSamples samples;
    samples.torque_nm.resize(problem_.joints.size());
    rollout.VisitInSpace(x, problem_.settle_s, [&samples](const SpaceSample& sample) {
      samples.time_s.push_back(sample.time_s);
      for (std::size_t j = 0; j < samples.torque_nm.size(); ++j)
        samples.torque_nm[j].push_back(sample.torque[j]);
    });
    for (const std::vector<double>& torque : samples.torque_nm)
      samples.rest_nm.push_back(torque.back());
    std::vector<JointMotion<double>::Spline> feed_forward;
    for (std::size_t j = 0; j < problem_.joints.size(); ++j)
      feed_forward.push_back(FeedForward(problem_, samples, j));
    return feed_forward;
  }

  [[nodiscard]] static double MissOf(const SpaceTrial& trial) {
    if (!trial.finite) return kWild;
    double sum = 0;
    for (const JudgedTarget& judged : trial.purpose) {
      // What has no heading is as far from the one that is asked for as any can be.
      const double missed_by =
          judged.result ? std::abs(*judged.result - judged.target.target) : std::numbers::pi;
      const double off = missed_by / judged.target.tolerance;
      const double missed = std::max(0.0, off - kPart);
      sum += missed * missed;
    }
    return std::min(sum, kWild);
  }

  /// The mean of what robots miss, and what the model exceeds its limits by; 0: nothing.
  double LossOf(const std::vector<double>& x, std::span<const PlayedRobot<Spatial>> robots,
                int thread) {
    Rollout& rollout = rollouts_[Index(thread)];
    const double excess = ExcessOf(x, rollout);
    if (!std::isfinite(excess)) return std::numeric_limits<double>::max();
    const std::vector<double> inside = Inside(x);
    const auto feed_forward = FeedForwardOf(inside, rollout);
    double sum = 0;
    for (const SpaceTrial& trial : TryInSpace(problem_, inside, feed_forward, targets_, robots, 0))
      sum += MissOf(trial);
    return sum / static_cast<double>(robots.size()) + kLimitPenalty * excess;
  }

  struct Judged {
    std::vector<double> x;
    int as_asked = 0;
    double loss = 0;
  };
  /// Robots that do what a motion is for, and what they miss.
  void Judge(std::span<const PlayedRobot<Spatial>> robots, Judged& of, int thread) {
    Rollout& rollout = rollouts_[Index(thread)];
    const auto feed_forward = FeedForwardOf(of.x, rollout);
    of.loss = kLimitPenalty * ExcessOf(of.x, rollout);
    of.as_asked = 0;
    if (interrupted()) return;
    for (const SpaceTrial& trial : TryInSpace(problem_, of.x, feed_forward, targets_, robots, 0)) {
      of.as_asked += trial.as_asked() ? 1 : 0;
      of.loss += MissOf(trial) / static_cast<double>(robots.size());
    }
  }

  /// Judges motions by the same robots and sorts them, the best first: what serves the most robots,
  /// then what they miss least with.
  void Rank(std::span<Judged> motions, std::span<const PlayedRobot<Spatial>> robots) {
    ParallelFor(static_cast<int>(motions.size()), options_.threads,
                [&](int i, int thread) { Judge(robots, motions[Index(i)], thread); });
    played_ += static_cast<std::int64_t>(motions.size() * robots.size());
    std::ranges::stable_sort(motions, [](const Judged& a, const Judged& b) {
      return a.as_asked != b.as_asked ? a.as_asked > b.as_asked : a.loss < b.loss;
    });
  }

  /// Puts the best motions first, by robots that none of them has met. The first of `motions` is
  /// one of the finalists.
  void Choose(std::vector<std::vector<double>> motions, RobustInSpace& result) {
    std::vector<Judged> judged;
    for (std::vector<double>& x : motions) judged.push_back({std::move(x)});
    // What was found for the model stays in front: it is given up for a better one only.
    Rank(std::span(judged).subspan(1), Draw(kJudgeSeed, robust_.first_judges));
    const std::size_t finalists = std::min<std::size_t>(judged.size(), 1 + kFinalists);
    Rank(std::span(judged).first(finalists), Draw(kJudgeSeed + 1, robust_.last_judges));
    for (Judged& of : judged) result.motions.push_back(std::move(of.x));
  }

  void Tell(double loss) const {
    if (options_.progress) options_.progress({true, 0, played_, loss, 0, 0, true});
  }

  const Problem& problem_;
  const SpaceRobustSettings& robust_;
  const SolveOptions& options_;
  std::vector<DueInSpace> targets_;
  FreePaths paths_;
  std::vector<LinearRow> rows_;
  std::vector<Rollout> rollouts_;  // by thread
  std::int64_t played_ = 0;
};

}  // namespace
}  // namespace in_space

int CountAsAskedInSpace(const Problem& problem, const std::vector<double>& x,
                        std::span<const PurposeFigure> purpose, const SolveOptions& options,
                        int robots) {
  return in_space::RobustSearch(problem, purpose, options).CountFresh(x, robots);
}

RobustInSpace FindRobustInSpace(const Problem& problem, const std::vector<double>& found,
                                std::span<const PurposeFigure> purpose,
                                const SolveOptions& options) {
  return in_space::RobustSearch(problem, purpose, options).Run(found);
}

}  // namespace tumbler
