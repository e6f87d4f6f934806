#pragma once

#include <algorithm>
#include <cmath>

namespace tumbler {

/// A time span cut into equal steps: as many as it takes for none to be longer than what is asked
/// for, rounding left out of account.
struct EvenSteps {
  /// @param fewest  even of a span of no length.
  EvenSteps(double span_s, double longest_s, int fewest = 0)
      : count(std::max(fewest, static_cast<int>(std::ceil(span_s / longest_s - 1e-9)))),
        step_s(count > 0 ? span_s / count : longest_s) {}

  int count;
  double step_s;  ///< Of no steps: what was asked for.
};

}  // namespace tumbler
