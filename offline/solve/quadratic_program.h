#pragma once

#include <Eigen/Core>

namespace tumbler {

/// A convex quadratic program whose limits in `soft` may be exceeded at a price:
///
///   min_p  g . p + p . B p / 2 + price sum_i max(0, soft_i . p + soft_value_i)
///   so that  hard p + hard_value <= 0  and  lower <= p <= upper.
///
/// As the subproblem of an SQP step, p is the step, and `soft` are the linearised constraints: some
/// p always keeps the hard limits, so the program always has a solution. Bounds are finite.
struct QuadraticProgram {
  Eigen::VectorXd g;
  Eigen::MatrixXd B;  ///< Symmetric, without negative eigenvalues.
  Eigen::MatrixXd hard;
  Eigen::VectorXd hard_value;
  Eigen::MatrixXd soft;
  Eigen::VectorXd soft_value;
  double price = 1;
  Eigen::VectorXd lower, upper;
};

struct QuadraticSolution {
  Eigen::VectorXd p;
  /// Multipliers of the soft limits, from 0 to the price.
  Eigen::VectorXd soft_multiplier;
  /// False when the method did not reach its tolerance. p may be of use anyway.
  bool converged = false;
};

/// Solves it by a primal-dual interior-point method with Mehrotra's predictor and corrector
/// [Mehrotra 1992; Nocedal and Wright, Numerical Optimization, chapter 16.6], in 17 factorisations
/// as a rule of a matrix with a row for each variable and soft limit. Deterministic.
QuadraticSolution Solve(const QuadraticProgram& program);

}  // namespace tumbler
