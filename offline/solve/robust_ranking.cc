#include "offline/solve/robust_ranking.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <numeric>
#include <span>
#include <utility>

#include "common/core/index.h"
#include "common/files/parallel_for.h"

namespace tumbler {
namespace {

/// Parts of the ensemble in a race, one after the other: 1/8, 1/4, 1/2, 1.
constexpr int kRungs = 4;
/// What a motion's loss is above that of one that went a rung further.
constexpr double kDropped = 100;
/// Slopes of the ground on which the model has to stay where a motion is tuned [rad]: one for each
/// lane. The second look asks for 2 mrad.
constexpr std::array<double, Packet::kLanes> kSlopes_rad = {0,     1e-3, -1e-3, 2e-3,
                                                            -2e-3, 3e-3, -3e-3, 0};
/// The largest excess of a plan with which a motion nearly keeps its limits.
constexpr double kLittleExcess = 0.3;

/// What the excess of a plan adds to a motion's loss: twice the excess, and less and less of more
/// than 1, so that a motion that can be played is no worse than one that cannot
/// (RobustMotion::kUnplayable). A search that fled from a large excess to paths beyond their limits
/// would stay there.
double PenaltyOf(double excess) { return excess <= 1 ? 2 * excess : 2.5 - 0.5 / excess; }

int PacketsOf(const std::vector<std::vector<double>>& motions) {
  return static_cast<int>((motions.size() + Packet::kLanes - 1) / Packet::kLanes);
}

}  // namespace

template <class N>
struct RobustRanking::Runner {
  std::size_t motion = 0;
  MotionPlan plan;
  std::vector<LaneSetpoint<N>> setpoints;
  int ticks = 0;
  double sum = 0;
  std::size_t robots = 0;   ///< Whose losses `sum` is of,
  std::size_t packets = 0;  ///< in so many packets.
  [[nodiscard]] double loss() const {
    return sum / static_cast<double>(robots) + PenaltyOf(plan.excess);
  }
  /// @param losses  of the next packet, of which so many count.
  void Add(std::span<const double> losses, std::size_t count) {
    sum = std::accumulate(losses.begin(), losses.begin() + static_cast<std::ptrdiff_t>(count), sum);
    robots += count;
    ++packets;
  }
};

RobustRanking::RobustRanking(const RobustTask& task, const RobustMotion& motion,
                             const MotionPlanner& planner, const MotionFeedback& feedback)
    : task_(task), motion_(motion), planner_(planner), feedback_(feedback) {
  if (task.tunes()) {
    fine_model_ = ModelOnSlopes(task, kSlopes_rad, RobustTask::kFine);
  } else if (task.beside_model()) {
    fine_model_ = ModelEnsemble(task, RobustTask::kFine);
  }
}

void RobustRanking::SetHold(const Feedback<double>& hold) {
  hold_ = hold;
  if (task_.beside_model()) fine_model_ = ModelEnsemble(task_, RobustTask::kFine, true);
}

std::vector<MotionPlan> RobustRanking::Plans(
    const std::vector<std::vector<double>>& motions) const {
  std::vector<MotionPlan> plans = planner_.Plans(motions);
  if (hold_) feedback_.Add(motions, *hold_, plans);
  return plans;
}

bool RobustRanking::IsPlayable(const std::vector<double>& x) const {
  LaneDistances distances = DistancesOf(task_);
  return motion_.Excess(x, distances.front()) < RobustMotion::kUnplayable &&
         Plans({x}).front().excess < kLittleExcess;
}

template <class N>
std::vector<RobustRanking::Runner<N>> RobustRanking::RunnersOf(
    const std::vector<std::vector<double>>& motions, std::size_t first, SelfDistances& distances,
    std::vector<double>& losses) const {
  std::vector<Runner<N>> runners;
  std::vector<std::vector<double>> playable;
  const std::size_t end = std::min(motions.size(), first + Packet::kLanes);
  for (std::size_t i = first; i < end; ++i) {
    losses[i] = motion_.Excess(motions[i], distances);
    if (losses[i] >= RobustMotion::kUnplayable) continue;
    playable.push_back(motions[i]);
    runners.emplace_back().motion = i;
  }
  if (playable.empty()) return {};
  std::vector<MotionPlan> plans = Plans(playable);
  for (std::size_t m = 0; m < playable.size(); ++m) {
    runners[m].setpoints = planner_.SetpointsOf<N>(playable[m], plans[m]);
    runners[m].plan = std::move(plans[m]);
    runners[m].ticks = motion_.Ticks(playable[m]);
  }
  return runners;
}

PacketMotion RobustRanking::MotionOf(const Runner<Packet>& runner) const {
  return {runner.setpoints, runner.ticks, hold_ ? &runner.plan.feedback : nullptr};
}

double RobustRanking::Judge(const PacketMotion& motion, const Ensemble& ensemble,
                            LaneDistances& distances) const {
  double sum = 0;
  for (std::size_t p = 0; p < ensemble.robots.size(); ++p) {
    const auto losses = RobotLosses(task_, ensemble, p, motion, distances);
    const double packet = std::accumulate(losses.begin(), losses.end(), 0.0);
    if (p == 0 && AllFall(packet, Packet::kLanes)) return packet / Packet::kLanes;
    sum += packet;
  }
  return sum / static_cast<double>(ensemble.robots.size() * Packet::kLanes);
}

std::vector<double> RobustRanking::Evaluate(const std::vector<std::vector<double>>& motions,
                                            const Ensemble& ensemble) const {
  std::vector<double> losses(motions.size());
  ParallelFor(PacketsOf(motions), task_.options.threads, [&](int p, int /*thread*/) {
    LaneDistances distances = DistancesOf(task_);
    for (const auto& runner :
         RunnersOf<Packet>(motions, Index(p) * Packet::kLanes, distances.front(), losses)) {
      const PacketMotion motion = MotionOf(runner);
      double& loss = losses[runner.motion];
      loss += Judge(motion, ensemble, distances) + PenaltyOf(runner.plan.excess);
      if (task_.beside_model())
        AddModel(loss, [&] { return Judge(motion, fine_model_, distances); });
    }
  });
  return losses;
}

std::vector<double> RobustRanking::Rank(const std::vector<std::vector<double>>& motions,
                                        const Ensemble& ensemble, Model model) const {
  std::vector<double> losses(motions.size());
  const RankingEnsemble robots = ForRanking(ensemble);
  ParallelFor(PacketsOf(motions), task_.options.threads, [&](int p, int /*thread*/) {
    LaneDistances distances = DistancesOf(task_);
    for (auto& runner :
         RunnersOf<float>(motions, Index(p) * Packet::kLanes, distances.front(), losses)) {
      while (runner.packets < robots.robots.size()) {
        const std::size_t packet = runner.packets;
        runner.Add(RobotLosses(task_, robots, packet, {runner.setpoints, runner.ticks}),
                   robots.CountIn(packet));
        if (packet == 0 && AllFall(runner.sum, runner.robots)) break;
      }
      double& loss = losses[runner.motion];
      loss += runner.loss();
      if (!task_.beside_model() || model == Model::kIsLeftOut) continue;
      AddModel(loss, [&] {
        const auto setpoints = planner_.SetpointsOf<Packet>(motions[runner.motion], runner.plan);
        return Judge({setpoints, runner.ticks}, fine_model_, distances);
      });
    }
  });
  return losses;
}

bool RobustRanking::AllFall(double sum, std::size_t robots) const {
  // Of robots that other motions do not carry, a packet may well fall with a good one.
  return sum >= static_cast<double>(robots) && task_.complement.empty();
}

void RobustRanking::AddModel(double& loss, const std::function<double()>& of_model) const {
  if (task_.tunes() && loss > RobotLoss::kHopeless) {
    loss += 1;  // as if it fell: a motion that far off is not looked at more closely
  } else {
    loss += std::max(0.0, of_model() - RobotLoss::kCalm);
  }
}

std::vector<RobustRanking::Arrival> RobustRanking::Arrivals(
    const std::vector<std::vector<double>>& motions, const Ensemble& ensemble) const {
  std::vector<Arrival> arrivals(motions.size());
  std::vector<double> penalties(motions.size());
  const RankingEnsemble robots = ForRanking(ensemble);
  ParallelFor(PacketsOf(motions), task_.options.threads, [&](int p, int /*thread*/) {
    SelfDistances distances(task_.problem.scene.robot, task_.problem.scene.self_contact.pairs);
    for (const auto& runner :
         RunnersOf<float>(motions, Index(p) * Packet::kLanes, distances, penalties)) {
      Arrival& arrival = arrivals[runner.motion];
      arrival.penalty = PenaltyOf(runner.plan.excess);
      const RankingMotion motion{runner.setpoints, runner.ticks};
      for (std::size_t packet = 0; packet < robots.robots.size(); ++packet) {
        const auto [soon, later] = RobotDivergences(task_, robots, packet, motion);
        for (std::size_t lane = 0; lane < robots.CountIn(packet); ++lane) {
          arrival.divergences.push_back(soon[lane]);
          arrival.divergences.push_back(later[lane]);
        }
      }
    }
  });
  for (std::size_t i = 0; i < motions.size(); ++i) arrivals[i].penalty += penalties[i];
  return arrivals;
}

std::vector<double> RobustRanking::LossesOfRobots(const std::vector<double>& x,
                                                  const Ensemble& ensemble) const {
  std::vector<double> losses, penalties(1);
  LaneDistances distances = DistancesOf(task_);
  for (const auto& runner : RunnersOf<Packet>({x}, 0, distances.front(), penalties)) {
    for (std::size_t packet = 0; packet < ensemble.robots.size(); ++packet) {
      const auto of_packet =
          RobotLosses(task_, ensemble, packet, {runner.setpoints, runner.ticks}, distances);
      losses.insert(losses.end(), of_packet.begin(), of_packet.end());
    }
  }
  return losses;
}

std::vector<double> RobustRanking::RankHalf(const std::vector<std::vector<double>>& motions,
                                            const Ensemble& ensemble, int generation) const {
  constexpr std::size_t kSome = WidePacket::kLanes / Packet::kLanes;
  const Ensemble some = PartOf(ensemble, Index(generation) * kSome, kSome);
  std::vector<double> losses = Rank(motions, some, Model::kIsLeftOut);
  std::vector<std::size_t> order(motions.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return losses[i]; });
  order.resize((order.size() + 1) / 2);
  std::vector<std::vector<double>> better;
  better.reserve(order.size());
  for (const std::size_t i : order) better.push_back(motions[i]);
  for (double& loss : losses) loss += kDropped;
  const std::vector<double> of_better = Rank(better, ensemble);
  for (std::size_t i = 0; i < order.size(); ++i) losses[order[i]] = of_better[i];
  return losses;
}

double RobustRanking::WorstLoss(const std::vector<double>& x, const Ensemble& ensemble) const {
  const MotionPlan plan = Plans({x}).front();
  if (plan.excess > 0) return 1 + plan.excess;
  const PacketSetpoints setpoints = planner_.SetpointsOf<Packet>(x, plan);
  const PacketMotion motion{setpoints, motion_.Ticks(x)};
  LaneDistances distances = DistancesOf(task_);
  double worst = 0;
  const auto look = [&](const Ensemble& robots) {
    for (std::size_t p = 0; p < robots.robots.size(); ++p)
      worst = std::max(worst, std::ranges::max(RobotLosses(task_, robots, p, motion, distances)));
  };
  look(fine_model_);
  if (worst < RobotLoss::kCarried) look(ensemble);
  return worst;
}

std::vector<double> RobustRanking::Race(const std::vector<std::vector<double>>& motions,
                                        const Ensemble& ensemble, int generation) const {
  if (!hold_) {
    const RankingEnsemble robots = ForRanking(ensemble);
    return RaceOn<float>(
        motions, robots.robots.size(), generation,
        [&](std::size_t packet, LaneDistances& /*distances*/, Runner<float>& runner) {
          runner.Add(RobotLosses(task_, robots, packet, {runner.setpoints, runner.ticks}),
                     robots.CountIn(packet));
        });
  }
  return RaceOn<Packet>(motions, ensemble.robots.size(), generation,
                        [&](std::size_t packet, LaneDistances& distances, Runner<Packet>& runner) {
                          runner.Add(
                              RobotLosses(task_, ensemble, packet, MotionOf(runner), distances),
                              Packet::kLanes);
                        });
}

template <class N, class Play>
std::vector<double> RobustRanking::RaceOn(const std::vector<std::vector<double>>& motions,
                                          std::size_t packets, int generation,
                                          const Play& play) const {
  const std::size_t first = Index(generation) * (packets >> (kRungs - 1));
  std::vector<double> losses(motions.size());
  std::vector<std::vector<Runner<N>>> ready(Index(PacketsOf(motions)));
  ParallelFor(PacketsOf(motions), task_.options.threads, [&](int p, int /*thread*/) {
    SelfDistances distances(task_.problem.scene.robot, task_.problem.scene.self_contact.pairs);
    ready[Index(p)] = RunnersOf<N>(motions, Index(p) * Packet::kLanes, distances, losses);
  });
  std::vector<Runner<N>> runners;
  for (auto& some : ready) std::move(some.begin(), some.end(), std::back_inserter(runners));
  const std::vector<double> penalties = losses;
  for (double& loss : losses)
    if (loss >= RobustMotion::kUnplayable) loss += kDropped * kRungs;
  const auto loss_of = [&](const Runner<N>& runner) {
    return penalties[runner.motion] + runner.loss();
  };
  for (int rung = 0; rung < kRungs; ++rung) {
    const std::size_t goal = packets >> (kRungs - 1 - rung);
    ParallelFor(static_cast<int>(runners.size()), task_.options.threads,
                [&](int i, int /*thread*/) {
                  Runner<N>& runner = runners[Index(i)];
                  // Robots that motions are only ranked by are not looked at.
                  LaneDistances distances = hold_ ? DistancesOf(task_) : LaneDistances{};
                  while (runner.packets < goal)
                    play((first + runner.packets) % packets, distances, runner);
                });
    std::ranges::stable_sort(runners, {}, loss_of);
    const int dropped = kRungs - 1 - rung;
    for (const Runner<N>& runner : runners)
      losses[runner.motion] = loss_of(runner) + kDropped * dropped;
    if (dropped > 0) runners.resize((runners.size() + 1) / 2);
  }
  return losses;
}

}  // namespace tumbler
