#include "offline/linear/symmetric_eigen.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Jacobi>
#include <limits>
#include <utility>

namespace tumbler {
namespace {

/// The cyclic Jacobi method (Golub and Van Loan, Matrix Computations, 4th ed., 8.5.3): rotations
/// make one entry beside the diagonal zero after the other, sweep after sweep. It converges
/// quadratically in the end, and small eigenvalues keep their digits. For small matrices, without
/// the heap, Eigen's solver would have to be compiled once more, which takes as long as all around
/// it.
template <class Matrix>
SymmetricEigen<Matrix> Decompose(const Matrix& symmetric) {
  // 6 to 8 are usual. Numbers that are not finite would never be done.
  constexpr int kMostSweeps = 50;
  const Eigen::Index n = symmetric.rows();
  Matrix A = symmetric.template selfadjointView<Eigen::Lower>();
  SymmetricEigen<Matrix> eigen{{}, Matrix::Identity(n, n)};
  Matrix& V = eigen.vectors;
  const double zero = std::numeric_limits<double>::epsilon() * A.norm();
  bool diagonal = false;
  for (int sweep = 0; sweep < kMostSweeps && !diagonal; ++sweep) {
    diagonal = true;
    for (Eigen::Index p = 0; p < n; ++p) {
      for (Eigen::Index q = p + 1; q < n; ++q) {
        if (std::abs(A(p, q)) <= zero) continue;
        diagonal = false;
        Eigen::JacobiRotation<double> J;
        J.makeJacobi(A, p, q);
        A.applyOnTheLeft(p, q, J.adjoint());
        A.applyOnTheRight(p, q, J);
        V.applyOnTheRight(p, q, J);
      }
    }
  }
  eigen.values = A.diagonal();
  for (Eigen::Index k = 0; k < n; ++k) {
    for (Eigen::Index j = k + 1; j < n; ++j) {
      if (!(eigen.values[j] < eigen.values[k])) continue;
      std::swap(eigen.values[j], eigen.values[k]);
      V.col(j).swap(V.col(k));
    }
  }
  return eigen;
}

}  // namespace

template <>
SymmetricEigen<Eigen::MatrixXd> DecomposeSymmetric(const Eigen::MatrixXd& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

template <>
SymmetricEigen<SmallMatrix> DecomposeSymmetric(const SmallMatrix& symmetric) {
  return Decompose(symmetric);
}

// Matrices of 2 x 2 and 3 x 3 become small matrices, so that the method is compiled once.
template <>
SymmetricEigen<Eigen::Matrix3d> DecomposeSymmetric(const Eigen::Matrix3d& symmetric) {
  const SymmetricEigen<SmallMatrix> eigen = Decompose<SmallMatrix>(symmetric);
  return {eigen.values, eigen.vectors};
}

template <>
SymmetricEigen<Eigen::Matrix2d> DecomposeSymmetric(const Eigen::Matrix2d& symmetric) {
  const SymmetricEigen<SmallMatrix> eigen = Decompose<SmallMatrix>(symmetric);
  return {eigen.values, eigen.vectors};
}

}  // namespace tumbler
