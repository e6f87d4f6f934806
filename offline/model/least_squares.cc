#include "offline/model/least_squares.h"

#include <Eigen/QR>

namespace tumbler {

Eigen::VectorXd SolveLeastSquares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  return A.colPivHouseholderQr().solve(b);
}

}  // namespace tumbler
