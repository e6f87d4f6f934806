#pragma once

#include <span>
#include <string>
#include <vector>

#include "offline/problem/problem.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/kkt_residual.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"

namespace tumbler {

class FreePaths;

/// A constraint a . x + b <= 0 on the parameters x [rad], or a . x + b <= s^d where the duration is
/// free: with s the last parameter, the duration, and d the derivative of the path that is bounded.
struct LinearRow {
  std::string name;
  std::vector<double> a;
  double b = 0;
  int derivative = 1;             ///< Of the path, which it bounds.
  bool of_free_duration = false;  ///< Whether the right side is s^d.

  /// By how much the limit is exceeded, relative to it: negative where it is kept.
  [[nodiscard]] double Excess(std::span<const double> x) const;
  /// The linear constraint that takes its place near x: it touches the row's at the duration of x,
  /// and is nowhere weaker, as s^2 is convex. What keeps it keeps the limit.
  [[nodiscard]] LinearRow LinearAt(std::span<const double> x) const;
};

/// The velocity and acceleration limits for all t, by refined control points
/// (common/files/spline_extent.h), of which an optimum's are within 3 % of its path: rows divided
/// by their limits. Position limits are plain bounds of the parameters, and no rows.
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

/// What is squared counts as no smaller than this in `relative`: where all targets are met so well
/// and nothing else is asked for, the rest is rounding. [rad] with a weight of one.
inline constexpr double kNegligibleResidual = 1e-4;

/// @param paths   of the problem: the residual is by what is free of them, as no motion that breaks
///                a tie competes.
/// @param rows    those of DerivativeLimitRows.
/// @param slopes  of the rollout's outputs at x, by what is free (FreePaths::ReduceSlopes).
/// @param model   of the cost at x, likewise; null: `relative` is not asked for.
KktResidual FindKktResidual(const Problem& problem, const FreePaths& paths,
                            const std::vector<LinearRow>& rows, std::span<const double> x,
                            const RolloutResult& result, const OutputGradients& slopes,
                            const GaussNewton* model = nullptr);

}  // namespace tumbler
