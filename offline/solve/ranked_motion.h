#pragma once

#include <limits>
#include <span>

#include "offline/problem/problem.h"
#include "offline/solve/rollout_result.h"

namespace tumbler {

/// A random motion of the global search, as Solve keeps it: everything but the motion itself, which
/// its number draws again (RandomStarts).
struct RankedMotion {
  /// The motion's cost, and penalties for limits that it exceeds, as the solver would have to bend
  /// it far to keep them (SearchSettings).
  double rank = std::numeric_limits<double>::infinity();
  bool misses_target = false;  ///< Whether it ends far from its target pitch.
  bool confirmed = false;      ///< Whether its rank was computed by the local solver's own method.
  bool screened = false;       ///< Whether it has had its local solve.

  /// Ranks it by a rollout of it; by the worse of all rollouts, once it is to be confirmed.
  void SetRank(const Problem& problem, const RolloutResult& result);
  /// @param limit  PromisingRank.
  [[nodiscard]] bool IsPromising(double limit) const { return rank < limit && !misses_target; }
};

/// Motions with a rank below this are promising: they are below the median by more than half of its
/// size, and nearer to the best than to the median. Most motions end in one of the flat basins (the
/// robot at rest on its feet, or fallen), and the median lies there.
/// @returns minus infinity, which no motion is below, where most motions have no finite rank.
double PromisingRank(std::span<const RankedMotion> motions);

/// How many motions are promising.
int CountPromising(std::span<const RankedMotion> motions);

}  // namespace tumbler
