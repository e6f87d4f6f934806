#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "offline/solver/solver.h"

namespace tumbler {

/// Two motions count as the same when no parameter differs by more [rad]: less than a person sees
/// or a drive follows, and more than the solver's last steps still move.
inline constexpr double kSameMotionRad = 0.02;

/// A motion that local solves ended in.
struct LocalMinimum {
  std::size_t solution = 0;  ///< The best of those that ended here, an index of the solutions.
  std::vector<int> starts;   ///< From where (`Solution::start`), the best first.
};

/// The different motions among those that were solved to the end; what was screened only, or left
/// every plausible range, is none. In the order of the solutions, which Solve gives best first.
///
/// Each solution joins the first minimum whose best is within `tolerance_rad` in every parameter.
std::vector<LocalMinimum> DistinctMinima(std::span<const Solution> solutions,
                                         double tolerance_rad = kSameMotionRad);

}  // namespace tumbler
