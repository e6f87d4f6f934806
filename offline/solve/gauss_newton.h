#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "offline/problem/problem.h"

namespace tumbler {

/// What Gauss and Newton's method knows of a cost's second derivatives.
struct GaussNewton {
  /// Those of the cost's squares, effort included, without those of what is squared. Integrals are
  /// summed over the ends of steps.
  Eigen::MatrixXd matrix;
  /// The derivatives of RolloutResult::residuals, one row for each.
  Eigen::MatrixXd residual_slopes;
  /// The part of the cost that is made of those squares.
  double squares = 0;
  /// The derivatives of the rest of it.
  Eigen::VectorXd linear;
};

/// Sums up a GaussNewton along a motion, if it is asked for.
class GaussNewtonSum {
 public:
  explicit GaussNewtonSum(const Problem& problem);

  /// @param wanted  gets that of the motion that begins; null: it is not asked for.
  void Begin(GaussNewton* wanted);
  [[nodiscard]] bool wanted() const { return wanted_ != nullptr; }

  /// Adds the effort of a joint at one end of a step, half of its integral over the step.
  /// @param growth  derivative of the step by the last parameter, divided by the step; 0 where that
  ///                is not the duration.
  /// @param slope   the derivatives of the torque.
  void AddEffort(double step_s, double growth, double torque, const double* slope);
  /// Adds the square of a residual.
  void AddResidual(double residual, std::span<const double> slope);
  /// Adds an integral of squares, without its derivatives.
  void AddSquares(double integral) { wanted_->squares += integral; }
  /// Where the derivatives of what is no square are added.
  [[nodiscard]] double* linear() { return wanted_->linear.data(); }
  /// Makes the matrix whole.
  void End();

 private:
  void AddSquare(double weight, const double* slope);

  int parameters_;
  double effort_weight_ = 0;  // of all terms together
  std::vector<double> slope_;
  GaussNewton* wanted_ = nullptr;
};

}  // namespace tumbler
