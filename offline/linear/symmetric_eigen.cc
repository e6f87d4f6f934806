#include "offline/linear/symmetric_eigen.h"

#include <Eigen/Eigenvalues>

namespace tumbler {
namespace {

template <class Matrix>
SymmetricEigen<Matrix> Decompose(const Matrix& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace

template <>
SymmetricEigen<SmallMatrix> DecomposeSymmetric(const SmallMatrix& symmetric) {
  return Decompose(symmetric);
}

template <>
SymmetricEigen<Eigen::Matrix3d> DecomposeSymmetric(const Eigen::Matrix3d& symmetric) {
  return Decompose(symmetric);  // Eigen reduces a matrix of 3 x 3 in closed form.
}

// A matrix of 2 x 2 becomes a small matrix, because a solver for 2 x 2 alone would take as long to
// compile as the rest of this file.
template <>
SymmetricEigen<Eigen::Matrix2d> DecomposeSymmetric(const Eigen::Matrix2d& symmetric) {
  const SymmetricEigen<SmallMatrix> eigen = Decompose<SmallMatrix>(symmetric);
  return {eigen.values, eigen.vectors};
}

}  // namespace tumbler
