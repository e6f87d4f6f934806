#pragma once

#include <Eigen/Core>

namespace tumbler {

/// The most rows and columns of a small matrix.
inline constexpr int kMaxSmallSize = 12;

/// Matrices and vectors with a size that only the run knows, without heap.
using SmallMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSmallSize, kMaxSmallSize>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxSmallSize, 1>;

}  // namespace tumbler
