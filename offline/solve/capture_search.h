#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "offline/solve/robust_ranking.h"

namespace tumbler {

/// Whether the divergence of robots that arrive tells what comes of them.
enum class Telling : std::uint8_t {
  kYes,     ///< Robots that a motion carries have little of it.
  kNo,      ///< They have as much as others: they rock, or are still on their way, as in a roll.
  kUnknown  ///< The motion carries too few.
};
[[nodiscard]] Telling DivergenceTells(const RobustRanking& ranking, const std::vector<double>& x,
                                      const Ensemble& robots);

/// The covariance with which a motion is changed in a search: standard deviations of about `reach`
/// in all directions but those that change how robots arrive (RobotLoss::Divergence), where they
/// are so small that most robots still arrive as they did. One of thirteen directions of a
/// handstand is a hundred times as stiff as the others, and a search that has to find that out
/// takes steps for it that lead nowhere.
/// @param reach  [rad]
/// @returns none where fewer than a tenth of the robots arrive near the target, or the motion
///          cannot be played.
[[nodiscard]] std::optional<Eigen::MatrixXd> ArrivalCovariance(const RobustRanking& ranking,
                                                               const std::vector<double>& x,
                                                               const Ensemble& robots,
                                                               double reach);

/// How motions are led to where robots arrive at rest.
struct CaptureSettings {
  std::size_t started = 10;  ///< Of all motions, those whose robots arrive nearest to rest are led.
  std::size_t wanted = 1;    ///< Of those half are led further each time, until so many are left.
  int generations = 60;      ///< Of one that is left to the end.
  double reach_rad = 0.2;    ///< See ArrivalCovariance.
};

/// A motion that was led.
struct CapturedMotion {
  std::vector<double> x;
  /// The mean over robots of 0 for one that arrives at rest to 1 for one that does not, and
  /// penalties for limits.
  double loss = 0;
};

/// Leads motions to where robots arrive so that they come to rest at the target by themselves. Each
/// generation of CMA-ES meets other robots than the one before, where there are more than 64, which
/// are played until 0.25 s after the end: by then their divergence tells who falls, at less than
/// half the price of looking whether they stand, and it tells of one that falls by how much.
///
/// It ends where no robot of a generation has anything left to gain (RobotLoss::kPerfect).
///
/// @param robots  at least 64.
/// @param tell    gets the number of a start and its loss, after each generation.
/// @param ended   asked before each generation.
/// @returns the best first, at most `settings.wanted`.
[[nodiscard]] std::vector<CapturedMotion> Capture(
    const RobustRanking& ranking, const std::vector<std::vector<double>>& from,
    const Ensemble& robots, const CaptureSettings& settings, std::uint64_t seed,
    const std::function<void(int start, int motions, double loss)>& tell,
    const std::function<bool()>& ended);

}  // namespace tumbler
