#include "offline/model/symmetric_eigen.h"

#include <Eigen/Jacobi>
#include <cmath>
#include <limits>
#include <utility>

namespace tumbler {

SmallVector SymmetricEigen::LeastSolution(const SmallVector& right) const {
  const double smallest = 1e-8 * values.cwiseAbs().maxCoeff();
  SmallVector sum = SmallVector::Zero(right.size());
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (std::abs(values[k]) <= smallest) continue;
    const auto& v = vectors.col(k);
    sum += (v.dot(right) / values[k]) * v;
  }
  return sum;
}

/// The cyclic Jacobi method (Golub and Van Loan, Matrix Computations, 4th ed., 8.5.3): rotations
/// make one entry beside the diagonal zero after the other, sweep after sweep. It converges
/// quadratically in the end, and small eigenvalues keep their digits. For small matrices, without
/// the heap, Eigen's solver would have to be compiled once more, which takes as long as all around
/// it.
SymmetricEigen DecomposeSymmetric(const SmallMatrix& symmetric) {
  // 6 to 8 are usual. Numbers that are not finite would never be done.
  constexpr int kMostSweeps = 50;
  const Eigen::Index n = symmetric.rows();
  SmallMatrix A = symmetric.selfadjointView<Eigen::Lower>();
  SymmetricEigen eigen{{}, SmallMatrix::Identity(n, n)};
  SmallMatrix& V = eigen.vectors;
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

}  // namespace tumbler
