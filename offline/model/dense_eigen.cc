#include "offline/model/dense_eigen.h"

#include <Eigen/Eigenvalues>

namespace tumbler {

DenseEigen DecomposeSymmetric(const Eigen::MatrixXd& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace tumbler
