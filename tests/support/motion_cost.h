#pragma once

#include <vector>

#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/output_gradients.h"

namespace tumbler::testing {

/// The cost that the solver reports for a motion.
inline double CostOf(const Problem& problem, const std::vector<double>& x) {
  ForwardSensitivity rollout(problem, AdaptiveSteps(problem));
  auto gradient = OutputGradients::Of(rollout);
  return rollout.Run(x, gradient).cost;
}

}  // namespace tumbler::testing
