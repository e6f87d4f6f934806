#include "offline/model/symmetric_eigen.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "offline/model/dense_eigen.h"

namespace tumbler {
namespace {

/// A matrix Q diag(values) Q' with a random orthogonal Q, which is a product of reflections.
SmallMatrix WithEigenvalues(const SmallVector& values, std::mt19937& random) {
  const Eigen::Index n = values.size();
  std::normal_distribution<double> normal;
  SmallMatrix Q = SmallMatrix::Identity(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const SmallVector v = SmallVector::NullaryExpr(n, [&] { return normal(random); }).normalized();
    Q -= 2 * v * (v.transpose() * Q);
  }
  return Q * values.asDiagonal() * Q.transpose();
}

TEST(SymmetricEigen, FindsTheEigenvaluesThatAMatrixWasMadeFromInIncreasingOrder) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> exponent(-6, 3);
  for (int n = 1; n <= kMaxSmallSize; ++n) {
    for (int k = 0; k < 20; ++k) {
      SmallVector values = SmallVector::NullaryExpr(n, [&] {
        const double size = std::pow(10, exponent(random));
        return random() % 4 == 0 ? 0 : random() % 2 == 0 ? size : -size;
      });
      const SmallMatrix A = WithEigenvalues(values, random);
      std::sort(values.begin(), values.end());
      const double rounding = 1e-14 * n * (1 + values.cwiseAbs().maxCoeff());

      const SymmetricEigen eigen = DecomposeSymmetric(A);
      EXPECT_LT((eigen.values - values).cwiseAbs().maxCoeff(), rounding) << n;
      const SmallMatrix& V = eigen.vectors;
      EXPECT_LT((V.transpose() * V - SmallMatrix::Identity(n, n)).norm(), 1e-14 * n) << n;
      EXPECT_LT((A * V - V * eigen.values.asDiagonal()).norm(), n * rounding) << n;
      const Eigen::MatrixXd of_any_size = A;
      EXPECT_LT((DecomposeSymmetric(of_any_size).values - values).cwiseAbs().maxCoeff(), rounding)
          << n;
    }
  }
}

TEST(SymmetricEigen, ReadsTheLowerTriangleAlone) {
  SmallMatrix given(2, 2);
  given << 2, 77, 1, 2;
  EXPECT_NEAR(DecomposeSymmetric(given).values[0], 1, 1e-15);
  EXPECT_NEAR(DecomposeSymmetric(given).values[1], 3, 1e-15);
}

TEST(SymmetricEigen, EndsOnNumbersThatAreNotFinite) {
  const SmallMatrix given = SmallMatrix::Constant(3, 3, std::nan(""));
  EXPECT_TRUE(std::isnan(DecomposeSymmetric(given).values.sum()));
}

TEST(SymmetricEigen, TheLeastSolutionHasTheLeastResidualAndIsTheShortest) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-1, 1);
  SmallVector values(5);
  values << 0, 0, 0.5, -2, 7;
  for (int k = 0; k < 20; ++k) {
    const SmallMatrix A = WithEigenvalues(values, random);
    const SmallVector right = SmallVector::NullaryExpr(5, [&] { return number(random); });
    const SmallVector x = DecomposeSymmetric(A).LeastSolution(right);
    EXPECT_LT((A * (A * x - right)).norm(), 1e-12);  // the residual is normal to all that A reaches
    // No part of x is in the null space: x is what A makes of something.
    EXPECT_LT((x - A * DecomposeSymmetric(A).LeastSolution(x)).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace tumbler
