#pragma once

#include <Eigen/Core>

#include "offline/model/small_matrix.h"

namespace tumbler {

/// The LU factors of a regular square matrix of at most 12 rows, with partial pivoting. No heap.
class SmallSystem {
 public:
  explicit SmallSystem(const SmallMatrix& regular);

  /// Returns the x that solves A x = right.
  [[nodiscard]] SmallVector Solve(const SmallVector& right) const;

 private:
  SmallMatrix factors_;
  Eigen::PermutationMatrix<Eigen::Dynamic, kMaxSmallSize> rows_;
};

}  // namespace tumbler
