#pragma once

#include <algorithm>
#include <vector>

#include "offline/problem/problem.h"

namespace tumbler {

/// Makes the duration of a motion that of the problem, as far as its bounds allow where rounding
/// took it beyond them, and the motion's parameters those in that problem. Nothing changes where
/// the duration is not free.
inline void TakeDuration(Problem& problem, std::vector<double>& x) {
  if (!problem.free_duration) return;
  const auto& [min_s, max_s] = *problem.free_duration;
  problem.duration_s = std::clamp(problem.duration_of(x), min_s, max_s);
  x.back() = 1;
}

}  // namespace tumbler
