#include "offline/solve/robust_ranking.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <numeric>
#include <type_traits>
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

template <class Setpoints>
struct RobustRanking::Runner {
  std::size_t motion = 0;
  MotionPlan plan;
  Setpoints setpoints;
  int ticks = 0;
  double sum = 0;
  std::size_t robots = 0;   ///< Whose losses `sum` is of,
  std::size_t packets = 0;  ///< in so many packets.
  [[nodiscard]] double loss() const {
    return sum / static_cast<double>(robots) + PenaltyOf(plan.excess);
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

template <class Setpoints>
std::vector<RobustRanking::Runner<Setpoints>> RobustRanking::RunnersOf(
    const std::vector<std::vector<double>>& motions, std::size_t first, SelfDistances& distances,
    std::vector<double>& losses) const {
  std::vector<Runner<Setpoints>> runners;
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
    if constexpr (std::is_same_v<Setpoints, RankingSetpoints>) {
      runners[m].setpoints = planner_.RankingSetpointsOf(playable[m], plans[m]);
    } else {
      runners[m].setpoints = planner_.SetpointsOf(playable[m], plans[m]);
    }
    runners[m].plan = std::move(plans[m]);
    runners[m].ticks = motion_.Ticks(playable[m]);
  }
  return runners;
}

std::array<double, Packet::kLanes> RobustRanking::LossesIn(const Runner<PacketSetpoints>& runner,
                                                           const Ensemble& ensemble,
                                                           std::size_t packet,
                                                           LaneDistances& distances) const {
  return RobotLosses(task_, ensemble, packet,
                     {runner.setpoints, runner.ticks, hold_ ? &runner.plan.feedback : nullptr},
                     distances);
}

double RobustRanking::Judge(const Runner<PacketSetpoints>& runner, const Ensemble& ensemble,
                            LaneDistances& distances) const {
  double sum = 0;
  for (std::size_t p = 0; p < ensemble.robots.size(); ++p) {
    const auto losses = LossesIn(runner, ensemble, p, distances);
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
    for (const auto& runner : RunnersOf<PacketSetpoints>(motions, Index(p) * Packet::kLanes,
                                                         distances.front(), losses)) {
      double& loss = losses[runner.motion];
      loss += Judge(runner, ensemble, distances) + PenaltyOf(runner.plan.excess);
      if (task_.beside_model())
        AddModel(loss, [&] { return Judge(runner, fine_model_, distances); });
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
    for (auto& runner : RunnersOf<RankingSetpoints>(motions, Index(p) * Packet::kLanes,
                                                    distances.front(), losses)) {
      for (; runner.packets < robots.robots.size(); ++runner.packets) {
        const auto of_packet =
            RobotLosses(task_, robots, runner.packets, {runner.setpoints, runner.ticks});
        runner.sum += std::accumulate(of_packet.begin(), of_packet.end(), 0.0);
        runner.robots += of_packet.size();
        if (runner.packets == 0 && AllFall(runner.sum, runner.robots)) break;
      }
      double& loss = losses[runner.motion];
      loss += runner.loss();
      if (!task_.beside_model() || model == Model::kIsLeftOut) continue;
      AddModel(loss, [&] {
        const Runner<PacketSetpoints> exact{
            .plan = runner.plan,
            .setpoints = planner_.SetpointsOf(motions[runner.motion], runner.plan),
            .ticks = runner.ticks};
        return Judge(exact, fine_model_, distances);
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
  const std::size_t count = 2 * ensemble.robots.size() * Packet::kLanes;  // of divergences
  ParallelFor(PacketsOf(motions), task_.options.threads, [&](int p, int /*thread*/) {
    SelfDistances distances(task_.problem.scene.robot, task_.problem.scene.self_contact.pairs);
    for (const auto& runner :
         RunnersOf<RankingSetpoints>(motions, Index(p) * Packet::kLanes, distances, penalties)) {
      Arrival& arrival = arrivals[runner.motion];
      arrival.penalty = PenaltyOf(runner.plan.excess);
      const RankingMotion motion{runner.setpoints, runner.ticks};
      for (std::size_t packet = 0; packet < robots.robots.size(); ++packet) {
        const auto [soon, later] = RobotDivergences(task_, robots, packet, motion);
        for (std::size_t lane = 0; lane < soon.size(); ++lane) {
          arrival.divergences.push_back(soon[lane]);
          arrival.divergences.push_back(later[lane]);
        }
      }
      arrival.divergences.resize(count);  // without those of whom the last packet is filled up
    }
  });
  for (std::size_t i = 0; i < motions.size(); ++i) arrivals[i].penalty += penalties[i];
  return arrivals;
}

std::vector<double> RobustRanking::LossesOfRobots(const std::vector<double>& x,
                                                  const Ensemble& ensemble) const {
  std::vector<double> losses, penalties(1);
  LaneDistances distances = DistancesOf(task_);
  for (const auto& runner : RunnersOf<PacketSetpoints>({x}, 0, distances.front(), penalties)) {
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
  const PacketSetpoints setpoints = planner_.SetpointsOf(x, plan);
  const PacketMotion motion{setpoints, motion_.Ticks(x)};
  LaneDistances distances;  // without a feedback nothing is looked at
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
    return RaceOn<RankingSetpoints>(
        motions, robots.robots.size(), generation, [&](const auto& runner, std::size_t packet) {
          return RobotLosses(task_, robots, packet, {runner.setpoints, runner.ticks});
        });
  }
  return RaceOn<PacketSetpoints>(motions, ensemble.robots.size(), generation,
                                 [&](const auto& runner, std::size_t packet) {
                                   LaneDistances distances = DistancesOf(task_);
                                   return LossesIn(runner, ensemble, packet, distances);
                                 });
}

template <class Setpoints, class Losses>
std::vector<double> RobustRanking::RaceOn(const std::vector<std::vector<double>>& motions,
                                          std::size_t packets, int generation,
                                          const Losses& losses_of) const {
  const std::size_t first = Index(generation) * (packets >> (kRungs - 1));
  std::vector<double> losses(motions.size());
  std::vector<std::vector<Runner<Setpoints>>> ready(Index(PacketsOf(motions)));
  ParallelFor(PacketsOf(motions), task_.options.threads, [&](int p, int /*thread*/) {
    SelfDistances distances(task_.problem.scene.robot, task_.problem.scene.self_contact.pairs);
    ready[Index(p)] = RunnersOf<Setpoints>(motions, Index(p) * Packet::kLanes, distances, losses);
  });
  std::vector<Runner<Setpoints>> runners;
  for (auto& some : ready) std::move(some.begin(), some.end(), std::back_inserter(runners));
  const std::vector<double> penalties = losses;
  for (double& loss : losses)
    if (loss >= RobustMotion::kUnplayable) loss += kDropped * kRungs;
  const auto loss_of = [&](const auto& runner) { return penalties[runner.motion] + runner.loss(); };
  for (int rung = 0; rung < kRungs; ++rung) {
    const std::size_t goal = packets >> (kRungs - 1 - rung);
    ParallelFor(static_cast<int>(runners.size()), task_.options.threads,
                [&](int i, int /*thread*/) {
                  auto& runner = runners[Index(i)];
                  for (; runner.packets < goal; ++runner.packets) {
                    const auto robots = losses_of(runner, (first + runner.packets) % packets);
                    runner.sum += std::accumulate(robots.begin(), robots.end(), 0.0);
                    runner.robots += robots.size();
                  }
                });
    std::ranges::stable_sort(runners, {}, loss_of);
    const int dropped = kRungs - 1 - rung;
    for (const auto& runner : runners) losses[runner.motion] = loss_of(runner) + kDropped * dropped;
    if (dropped > 0) runners.resize((runners.size() + 1) / 2);
  }
  return losses;
}

}  // namespace tumbler
