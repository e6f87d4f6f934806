#pragma once

#include <algorithm>
#include <vector>

#include "offline/problem/free_start.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// Makes what is free of a motion besides its paths, the root's velocities at the start and the
/// duration, that of the problem, as far as bounds allow where rounding took it beyond them, and
/// the motion's parameters those in that problem. A velocity that rounding keeps from its bound is
/// put there: a bound of 0 is for motions that begin at rest. Nothing changes where neither is
/// free.
inline void TakeFree(Problem& problem, std::vector<double>& x) {
  constexpr double kRounding = 1e-9;
  for (int i = problem.first_start_rate(); i < problem.parameter_count(); ++i) {
    if (problem.is_duration(i)) continue;
    const Interval<double> bounds = problem.bounds_of_parameter(i);
    double& value = x[static_cast<std::size_t>(i)];
    if (value < bounds.min + kRounding) {
      value = bounds.min;
    } else if (value > bounds.max - kRounding) {
      value = bounds.max;
    }
  }
  FreeStart(problem).Set(problem, x);
  if (!problem.free_duration) return;
  const auto& [min_s, max_s] = *problem.free_duration;
  problem.duration_s = std::clamp(problem.duration_of(x), min_s, max_s);
  x.back() = 1;
}

}  // namespace tumbler
