#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "offline/problem/problem.h"
#include "offline/rollout/rollout.h"

namespace tumbler {

/// The part of a limit that the solver is kept within, so that its result keeps the true one
/// despite rounding.
inline constexpr double kInside = 1 - 1e-6;

/// A linear constraint a . x + b <= 0 on the parameters x [rad].
struct LinearRow {
  std::string name;
  std::vector<double> a;
  double b = 0;
  int derivative = 1;  ///< Of the path, which it bounds.
};

/// The velocity and acceleration limits for all t, by the control points: rows divided by their
/// limits. Position limits are plain bounds of the parameters, and no rows.
std::vector<LinearRow> DerivativeLimitRows(const Problem& problem);

/// The constraints that a simulation computes, as a rollout scales them: 0 or less where they are
/// kept. Their gradients are the rows of a rollout's gradient after the first, in the same order:
/// the torque of each joint, penetration, and the clearance of the robot's own shapes if any are to
/// stay apart.
std::vector<double> SimulatedConstraints(const Problem& problem, const RolloutResult& result);

/// The largest constraint, and zero or more when it is violated.
struct WorstConstraint {
  double value = 0;
  std::string name;
};
/// @param rows  those of DerivativeLimitRows.
WorstConstraint FindWorst(const Problem& problem, const std::vector<LinearRow>& rows,
                          std::span<const double> x, const RolloutResult& result);
/// Its value alone.
double LargestViolation(const Problem& problem, const std::vector<LinearRow>& rows,
                        std::span<const double> x, const RolloutResult& result);

/// Gradients of a rollout's outputs, one row for each.
using OutputGradients = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The residual of the Kuhn-Tucker condition: the largest component of g + A^T lambda, lambda >= 0,
/// where g is the cost's gradient, and the rows of A are the gradients of the constraints that are
/// active at x: those within 1e-5 of zero, and a torque that is within its margin.
double ProjectedGradient(const Problem& problem, const std::vector<LinearRow>& rows,
                         std::span<const double> x, const RolloutResult& result,
                         const Eigen::Ref<const OutputGradients>& outputs);

}  // namespace tumbler
