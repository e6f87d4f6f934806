#include "offline/solve/ranked_motion.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tumbler {
namespace {

double Rank(const Problem& problem, const RolloutResult& result) {
  if (!result.finite) return std::numeric_limits<double>::infinity();
  double rank = result.cost;
  for (const double excess : result.torque_excess) {
    const double above = std::max(0.0, excess);
    rank += problem.search.torque_penalty * above * above;
  }
  rank += problem.search.core_penalty *
          std::max(0.0, result.peak_penetration_m / problem.contact().d_on_m - 1);
  rank += problem.search.clearance_penalty * std::max(0.0, result.clearance_excess);
  return rank;
}

}  // namespace

void RankedMotion::SetRank(const Problem& problem, const RolloutResult& result) {
  rank = confirmed ? std::max(rank, Rank(problem, result)) : Rank(problem, result);
  misses_target = result.target_error_rad > problem.search.basin_rad;
}

double PromisingRank(std::span<const RankedMotion> motions) {
  if (motions.empty()) return -std::numeric_limits<double>::infinity();
  std::vector<double> sorted(motions.size());
  std::transform(motions.begin(), motions.end(), sorted.begin(),
                 [](const RankedMotion& motion) { return motion.rank; });
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  if (!std::isfinite(*middle)) return -std::numeric_limits<double>::infinity();
  const double best = *std::min_element(sorted.begin(), middle + 1);
  return std::min(*middle - 0.5 * std::abs(*middle), 0.5 * (best + *middle));
}

int CountPromising(std::span<const RankedMotion> motions) {
  const double limit = PromisingRank(motions);
  return static_cast<int>(
      std::count_if(motions.begin(), motions.end(),
                    [limit](const RankedMotion& motion) { return motion.IsPromising(limit); }));
}

}  // namespace tumbler
