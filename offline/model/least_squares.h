#pragma once

#include <Eigen/Core>

namespace tumbler {

/// The x that minimises |A x - b|, by Householder reflections with column pivoting. Columns that
/// depend on others get coefficients of zero.
Eigen::VectorXd SolveLeastSquares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

}  // namespace tumbler
