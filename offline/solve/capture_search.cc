#include "offline/solve/capture_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/model/dense_eigen.h"
#include "offline/solve/cma_es.h"

namespace tumbler {
namespace {

/// Of the differences by which it is found how a motion's variables change arrivals.
constexpr double kStep_rad = 3e-3;
/// A change of a divergence that most robots bear, and one beyond which it tells nothing of what
/// robots near the target would do [rad/s].
constexpr double kBorne_rad_s = 0.5, kNear_rad_s = 2;

constexpr int kPopulation = 16;
/// In which a motion is led before it is compared with others.
constexpr int kRound = 15;
/// Packets of robots that a generation meets where several motions are led, and where one is.
constexpr std::size_t kPacketsAtFirst = 4, kPackets = 8;
/// By how much a candidate is better than the mean that has lost it, and how far the seeds of
/// searches that begin anew are apart.
constexpr double kLost = 0.2;
constexpr std::uint64_t kSeedsOfRestart = 100'000;
/// Packets that motions are compared by.
constexpr std::size_t kJudges = 8;
/// Divergences with which a robot counts half [rad/s]: at first, when few robots arrive, and from
/// this part of the generations on.
constexpr double kWide_rad_s = 1.5, kNarrow_rad_s = 0.5, kNarrowFrom = 0.6;

/// Of so many robots a motion has to carry one for them to say whether the divergence tells.
constexpr std::size_t kFewRobots = 10;

/// @param half_rad_s  the divergence with which a robot counts half.
double Counts(double divergence, double half_rad_s) {
  return divergence * divergence / (divergence * divergence + half_rad_s * half_rad_s);
}
double LossOf(const RobustRanking::Arrival& arrival, double half_rad_s) {
  if (arrival.divergences.empty()) return arrival.penalty;
  double sum = 0;
  for (const double divergence : arrival.divergences) sum += Counts(divergence, half_rad_s);
  return arrival.penalty + sum / static_cast<double>(arrival.divergences.size());
}

/// A motion on its way.
struct Led {
  int number;  ///< Among the starts.
  CmaEs search;
  int generation = 0;
  bool nothing_to_gain = false;  ///< By the robots of its last generation.
  double loss = 0;               ///< Of `x`, by the judges.
  std::vector<double> x = {};    ///< The mean of its search, or a candidate that is better.
  /// The best candidate since that was looked at, by robots of its generation.
  std::vector<double> best = {};
  double least = 0;
};

/// The search of Capture.
class CaptureSearch {
 public:
  using Tell = std::function<void(int start, int motions, double loss)>;
  CaptureSearch(const RobustRanking& ranking, const Ensemble& robots,
                const CaptureSettings& settings, std::uint64_t seed, const Tell& tell,
                const std::function<bool()>& ended)
      : ranking_(ranking),
        robots_(robots),
        settings_(settings),
        seed_(seed),
        tell_(tell),
        ended_(ended) {}

  std::vector<CapturedMotion> Run(const std::vector<std::vector<double>>& from) {
    std::vector<Led> led = Begin(from);
    while (!ended_() && !led.empty()) {
      const bool last = led.size() <= settings_.wanted;
      for (Led& one : led) {
        do {
          GoOn(one, last ? kPackets : kPacketsAtFirst);
          Judge(one);
        } while (last && one.generation < settings_.generations && !one.nothing_to_gain &&
                 !ended_());
      }
      std::ranges::stable_sort(led, {}, &Led::loss);
      if (last || led.front().loss < RobotLoss::kPerfect) break;
      led.erase(led.begin() +
                    static_cast<std::ptrdiff_t>(std::max(settings_.wanted, (led.size() + 1) / 2)),
                led.end());
    }
    std::vector<CapturedMotion> captured;
    for (const Led& one : led) captured.push_back({one.x, one.loss});
    if (captured.size() > settings_.wanted) captured.resize(settings_.wanted);
    return captured;
  }

 private:
  [[nodiscard]] std::vector<double> LossesOf(const std::vector<std::vector<double>>& motions,
                                             const Ensemble& some, double half_rad_s) const {
    std::vector<double> losses;
    for (const RobustRanking::Arrival& arrival : ranking_.Arrivals(motions, some))
      losses.push_back(LossOf(arrival, half_rad_s));
    return losses;
  }
  /// A search around a motion.
  [[nodiscard]] CmaEs Around(const std::vector<double>& x, double reach, std::uint64_t own) const {
    const auto covariance = ArrivalCovariance(ranking_, x, judges_, settings_.reach_rad);
    return covariance ? CmaEs(x, *covariance, kPopulation, own) : CmaEs(x, reach, kPopulation, own);
  }

  /// The motions whose robots arrive nearest to rest.
  std::vector<Led> Begin(const std::vector<std::vector<double>>& from) const {
    std::vector<std::size_t> order(from.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    if (order.size() > settings_.started && !ended_()) {
      const std::vector<double> losses = LossesOf(from, judges_, kWide_rad_s);
      std::ranges::stable_sort(order, {}, [&](std::size_t i) { return losses[i]; });
      order.resize(settings_.started);
    }
    std::vector<Led> led;
    for (const std::size_t i : order) {
      if (ended_()) break;
      led.push_back(
          {static_cast<int>(i), Around(from[i], settings_.reach_rad, seed_ + led.size())});
      led.back().x = from[i];
    }
    return led;
  }

  /// Leads a motion through a round.
  void GoOn(Led& one, std::size_t packets) const {
    const int end = std::min(one.generation + kRound, settings_.generations);
    for (; one.generation < end && !ended_(); ++one.generation) {
      const double part = std::min(1.0, one.generation / (kNarrowFrom * settings_.generations));
      const double half_rad_s =
          kWide_rad_s * portable::Exp(part * portable::Log(kNarrow_rad_s / kWide_rad_s));
      const std::vector<std::vector<double>> candidates = one.search.Ask();
      const std::vector<double> losses = LossesOf(
          candidates, PartOf(robots_, Index(one.generation) * kPackets, packets), half_rad_s);
      one.search.Tell(losses);
      const auto least = std::ranges::min_element(losses);
      if (one.best.empty() || *least < one.least) {
        one.best = candidates[static_cast<std::size_t>(least - losses.begin())];
        one.least = *least;
      }
      tell_(one.number, kPopulation, *least);
      one.nothing_to_gain = *least < RobotLoss::kPerfect;
      if (one.nothing_to_gain) break;
    }
  }

  /// Gives a motion its loss. Among motions whose robots all fall, one that does not is soon lost
  /// again: a mean hardly follows it. Then the search begins anew from there.
  void Judge(Led& one) const {
    one.x = one.search.mean();
    one.loss = LossesOf({one.x}, judges_, kNarrow_rad_s).front();
    if (one.best.empty()) return;
    const double of_best = LossesOf({one.best}, judges_, kNarrow_rad_s).front();
    if (of_best < one.loss - kLost) {
      one.x = one.best;
      one.loss = of_best;
      one.search = Around(one.x, settings_.reach_rad / 2,
                          seed_ + Index(one.generation) * kSeedsOfRestart + Index(one.number));
    }
    one.best.clear();
  }

  const RobustRanking& ranking_;
  const Ensemble& robots_;
  const CaptureSettings& settings_;
  std::uint64_t seed_;
  const Tell& tell_;
  const std::function<bool()>& ended_;
  Ensemble judges_ = PartOf(robots_, 0, kJudges);
};

}  // namespace

Telling DivergenceTells(const RobustRanking& ranking, const std::vector<double>& x,
                        const Ensemble& robots) {
  const std::vector<double> losses = ranking.LossesOfRobots(x, robots);
  const std::vector<double> divergences = ranking.Arrivals({x}, robots).front().divergences;
  double sum = 0;
  std::size_t carried = 0;
  for (std::size_t robot = 0; robot < losses.size(); ++robot) {
    if (losses[robot] >= RobotLoss::kCarried) continue;
    ++carried;
    sum += Counts(divergences[2 * robot], kNarrow_rad_s) / 2 +
           Counts(divergences[2 * robot + 1], kNarrow_rad_s) / 2;
  }
  if (kFewRobots * carried < losses.size() || carried == 0) return Telling::kUnknown;
  return sum < static_cast<double>(carried) / 2 ? Telling::kYes : Telling::kNo;
}

std::optional<Eigen::MatrixXd> ArrivalCovariance(const RobustRanking& ranking,
                                                 const std::vector<double>& x,
                                                 const Ensemble& robots, double reach) {
  const auto n = static_cast<Eigen::Index>(x.size());
  std::vector<std::vector<double>> motions(x.size() + 1, x);
  for (std::size_t i = 0; i < x.size(); ++i) motions[i + 1][i] += kStep_rad;
  std::vector<RobustRanking::Arrival> arrivals = ranking.Arrivals(motions, robots);
  const std::vector<double>& here = arrivals.front().divergences;
  const auto near = static_cast<std::size_t>(std::ranges::count_if(
      here, [](double divergence) { return std::abs(divergence) <= kNear_rad_s; }));
  if (here.empty() || kFewRobots * near < here.size()) return std::nullopt;
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(here.size()), n);
  for (std::size_t i = 0; i < x.size(); ++i) {
    double step = kStep_rad;
    if (arrivals[i + 1].divergences.empty()) {  // there is a limit
      step = -step;
      motions[i + 1][i] += 2 * step;
      arrivals[i + 1] = ranking.Arrivals({motions[i + 1]}, robots).front();
    }
    const std::vector<double>& there = arrivals[i + 1].divergences;
    for (std::size_t r = 0; r < std::min(here.size(), there.size()); ++r) {
      if (std::abs(here[r]) > kNear_rad_s) continue;
      slopes(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(i)) =
          (there[r] - here[r]) / step;
    }
  }
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n) / (reach * reach);
  information += slopes.transpose() * slopes /
                 (static_cast<double>(here.size()) * kBorne_rad_s * kBorne_rad_s);
  const DenseEigen eigen = DecomposeSymmetric(information);
  return eigen.vectors * eigen.values.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
}

std::vector<CapturedMotion> Capture(
    const RobustRanking& ranking, const std::vector<std::vector<double>>& from,
    const Ensemble& robots, const CaptureSettings& settings, std::uint64_t seed,
    const std::function<void(int start, int motions, double loss)>& tell,
    const std::function<bool()>& ended) {
  return CaptureSearch(ranking, robots, settings, seed, tell, ended).Run(from);
}

}  // namespace tumbler
