#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "offline/solve/solver.h"

namespace tumbler {

/// Two motions count as the same when no parameter differs by more than this [rad]. A person does
/// not see that much, a drive does not follow it exactly, and the solver's last steps move less.
inline constexpr double kSameMotionRad = 0.02;

/// A motion in which one or several local solves ended.
struct LocalMinimum {
  std::size_t solution = 0;  ///< Index of the best solution that ended here.
  std::vector<int> starts;   ///< `Solution::start` of all solutions that ended here, best first.
};

/// The different motions among the solutions, in their order, which is best first after Solve.
/// Solutions that were screened only, or left every plausible range, do not count.
///
/// Each solution joins the first minimum whose best is within `tolerance_rad` in every parameter.
std::vector<LocalMinimum> DistinctMinima(std::span<const Solution> solutions,
                                         double tolerance_rad = kSameMotionRad);

}  // namespace tumbler
