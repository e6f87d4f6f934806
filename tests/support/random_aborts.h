#pragma once

#include <algorithm>
#include <cstddef>
#include <random>
#include <vector>

#include "common/core/primitive.h"

namespace tumbler::testing {

/// A table of aborts for a primitive: so many spans that end at random times, each with a random
/// way, folds to random poses within the limits.
template <typename Scalar>
AbortTable<Scalar> RandomAborts(const Primitive<Scalar>& primitive, int spans,
                                std::mt19937& random) {
  std::uniform_real_distribution<double> share(0.01, 1);
  std::vector<Scalar> ends;
  while (static_cast<int>(ends.size()) < spans - 1) {
    const auto end = static_cast<Scalar>(0.99 * share(random)) * primitive.duration_s;
    if (std::ranges::find(ends, end) == ends.end()) ends.push_back(end);
  }
  std::ranges::sort(ends);
  ends.push_back(primitive.duration_s);
  AbortTable<Scalar> aborts;
  for (const Scalar end : ends) {
    AbortSpan<Scalar>& span = aborts.span_storage[static_cast<std::size_t>(aborts.span_count++)];
    span.until_s = end;
    span.way = static_cast<AbortWay>(random() % kAbortWayCount);
    if (span.way == AbortWay::kRollOut) span.late_max_s = static_cast<Scalar>(0.02 * share(random));
    if (span.way != AbortWay::kFold) continue;
    span.limits_share = static_cast<Scalar>(share(random));
    for (std::size_t j = 0; j < primitive.motions().size(); ++j) {
      const JointLimits<Scalar>& limits = primitive.joints[j].limits;
      const auto at = static_cast<Scalar>(share(random));
      span.position_rad[j] =
          limits.position_min_rad + at * (limits.position_max_rad - limits.position_min_rad);
    }
  }
  return aborts;
}

}  // namespace tumbler::testing
