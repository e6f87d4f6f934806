#pragma once

#include <Eigen/Core>

namespace tumbler {

/// Eigenvalues of a symmetric matrix of any size in increasing order, and its eigenvectors of unit
/// length as columns in the same order.
struct DenseEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

/// Only the lower triangle of the matrix is read. For small matrices symmetric_eigen.h needs no
/// heap.
DenseEigen DecomposeSymmetric(const Eigen::MatrixXd& symmetric);

}  // namespace tumbler
