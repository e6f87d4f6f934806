#pragma once

#include <vector>

#include "offline/rollout/forward_sensitivity.h"

namespace tumbler::testing {

/// The cost that the solver reports for a motion.
inline double CostOf(const Problem& problem, const std::vector<double>& x) {
  ForwardSensitivity rollout(problem, AdaptiveSteps(problem));
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> gradient(
      rollout.output_count(), rollout.parameter_count());
  return rollout.Run(x, gradient).cost;
}

}  // namespace tumbler::testing
