#pragma once

#include <algorithm>
#include <cmath>

namespace tumbler {

/// A time span cut into equal steps. There are as few as possible without a step longer than
/// `longest_s` (but for rounding).
struct EvenSteps {
  /// @param fewest  least number of steps, even when the span is empty.
  EvenSteps(double span_s, double longest_s, int fewest = 0)
      : count(std::max(fewest, static_cast<int>(std::ceil(span_s / longest_s - 1e-9)))),
        step_s(count > 0 ? span_s / count : longest_s) {}

  int count;
  /// Length of a step; `longest_s` when there are none.
  double step_s;
};

}  // namespace tumbler
