#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"

namespace tumbler::testing {

/// The largest difference, as a part of the largest number of `b`.
inline double Off(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

/// A motion a little beside x. Its steps end on the kinks of the contact law of that motion, and so
/// not on those of x. Where a step ends on a kink, second derivatives of the discrete motion jump,
/// and central differences are off by their step.
inline std::vector<double> Beside(std::vector<double> x) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += i % 2 == 0 ? 1e-4 : -2e-4;
  return x;
}

/// Checks a motion that touches something: that forward and backward gradients agree, and those of
/// the cost and of what the targets leave are central differences, at the best of three steps.
inline void ExpectTrueGradients(const Problem& problem, const std::vector<double>& x) {
  ForwardSensitivity forward(problem, AdaptiveSteps(problem));
  auto ahead = OutputGradients::Of(forward), back = ahead;
  GaussNewton model;
  ASSERT_TRUE(forward.Run(Beside(x), ahead).finite);
  const RolloutResult expected = forward.RunAgain(x, ahead, &model);
  ASSERT_TRUE(expected.finite && expected.any_contact);
  Rollout rollout(problem, 1e-3);
  rollout.Use(forward.grid());
  EXPECT_NEAR(rollout.Run(x, back).cost, expected.cost, 1e-9 * expected.cost);
  for (Eigen::Index row = 0; row + 1 < back.rows(); ++row)
    EXPECT_LT(Off(back.row(row), ahead.row(row)), 1e-7) << row;
  double best = 1e300, best_of_targets = 1e300;
  for (const double step : {1e-5, 1e-6, 1e-7}) {
    Eigen::RowVectorXd differences(back.cols());
    Eigen::MatrixXd of_targets(model.residual_slopes.rows(), back.cols());
    for (Eigen::Index k = 0; k < back.cols(); ++k) {
      std::vector<double> y = x;
      double& changed = y[static_cast<std::size_t>(k)];
      changed += step;
      const RolloutResult above = rollout.Run(y);
      changed -= 2 * step;
      const RolloutResult below = rollout.Run(y);
      differences[k] = (above.cost - below.cost) / (2 * step);
      for (Eigen::Index i = 0; i < of_targets.rows(); ++i) {
        const auto r = static_cast<std::size_t>(i);
        of_targets(i, k) = (above.residuals[r] - below.residuals[r]) / (2 * step);
      }
    }
    best = std::min(best, Off(back.row(0), differences));
    best_of_targets = std::min(best_of_targets, Off(model.residual_slopes, of_targets));
  }
  EXPECT_LT(best, 1e-6);
  EXPECT_LT(best_of_targets, 1e-6);
}

}  // namespace tumbler::testing
