#pragma once

#include <Eigen/Core>

namespace tumbler {

/// The most rows and columns of a small matrix.
inline constexpr int kMaxSmallSize = 12;

/// Matrices and vectors whose size is known only at run time. No heap.
using SmallMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSmallSize, kMaxSmallSize>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxSmallSize, 1>;

}  // namespace tumbler
