#pragma once

#include <Eigen/Core>
#include <cmath>

#include "offline/linear/small_matrix.h"

namespace tumbler {

/// Eigenvalues of a symmetric matrix in increasing order, and its eigenvectors of unit length as
/// columns in the same order.
template <class Matrix>
struct SymmetricEigen {
  using Vector =
      Eigen::Matrix<double, Matrix::RowsAtCompileTime, 1, 0, Matrix::MaxRowsAtCompileTime, 1>;
  Vector values;
  Matrix vectors;

  /// The shortest of all least squares solutions x of A x = right. Eigenvalues below 1e-8 of the
  /// largest, in magnitude, count as zero.
  [[nodiscard]] Vector LeastSolution(const Vector& right) const {
    const double smallest = 1e-8 * values.cwiseAbs().maxCoeff();
    Vector sum = Vector::Zero(right.size());
    for (Eigen::Index k = 0; k < values.size(); ++k) {
      if (std::abs(values[k]) <= smallest) continue;
      const auto& v = vectors.col(k);
      sum += (v.dot(right) / values[k]) * v;
    }
    return sum;
  }
};

/// Computes the eigenvalues and eigenvectors of a symmetric matrix, which is a `SmallMatrix`, has 2
/// x 2 or 3 x 3 numbers, or has any size. Only its lower triangle is read. No heap but for any
/// size.
template <class Matrix>
SymmetricEigen<Matrix> DecomposeSymmetric(const Matrix& symmetric);
template <>
SymmetricEigen<Eigen::MatrixXd> DecomposeSymmetric(const Eigen::MatrixXd& symmetric);
template <>
SymmetricEigen<SmallMatrix> DecomposeSymmetric(const SmallMatrix& symmetric);
template <>
SymmetricEigen<Eigen::Matrix2d> DecomposeSymmetric(const Eigen::Matrix2d& symmetric);
template <>
SymmetricEigen<Eigen::Matrix3d> DecomposeSymmetric(const Eigen::Matrix3d& symmetric);

}  // namespace tumbler
