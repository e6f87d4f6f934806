#pragma once

#include "offline/model/small_matrix.h"

namespace tumbler {

/// Eigenvalues of a small symmetric matrix in increasing order, and its eigenvectors of unit length
/// as columns in the same order.
struct SymmetricEigen {
  SmallVector values;
  SmallMatrix vectors;

  /// The shortest of all least squares solutions x of A x = right. Eigenvalues below 1e-8 of the
  /// largest, in magnitude, count as zero.
  [[nodiscard]] SmallVector LeastSolution(const SmallVector& right) const;
};

/// Only the lower triangle of the matrix is read. No heap. For any size there is dense_eigen.h.
SymmetricEigen DecomposeSymmetric(const SmallMatrix& symmetric);

}  // namespace tumbler
