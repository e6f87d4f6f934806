#include "offline/solve/minima.h"

#include <algorithm>
#include <cmath>

namespace tumbler {

std::vector<LocalMinimum> DistinctMinima(std::span<const Solution> solutions,
                                         double tolerance_rad) {
  std::vector<LocalMinimum> minima;
  for (std::size_t i = 0; i < solutions.size(); ++i) {
    const Solution& solution = solutions[i];
    if (!solution.finished || solution.evaluations == 0 || !solution.rollout.finite) continue;
    const auto same = std::find_if(minima.begin(), minima.end(), [&](const LocalMinimum& minimum) {
      const std::vector<double>& other = solutions[minimum.solution].x;
      return std::equal(solution.x.begin(), solution.x.end(), other.begin(), other.end(),
                        [&](double a, double b) { return std::abs(a - b) <= tolerance_rad; });
    });
    if (same == minima.end()) {
      minima.push_back({i, {solution.start}});
    } else {
      same->starts.push_back(solution.start);
    }
  }
  return minima;
}

}  // namespace tumbler
