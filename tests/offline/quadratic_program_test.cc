// The quadratic program of a step of sequential quadratic programming.

#include "offline/solve/quadratic_program.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace tumbler {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Size {
  Index variables, hard, soft;
};
/// Two directions of a step are this much steeper than the others: the robot balances.
constexpr double kSteep = 1e2;

MatrixXd RandomMatrix(std::mt19937& random, Index rows, Index columns) {
  std::normal_distribution<double> normal;
  MatrixXd out(rows, columns);
  for (double& entry : out.reshaped()) entry = normal(random);
  return out;
}

/// A step of length `radius` at most, from a motion that lies at some of its limits.
QuadraticProgram SomeStep(std::mt19937& random, const Size& size, double radius, double price) {
  const Index n = size.variables;
  QuadraticProgram program;
  const MatrixXd steep = kSteep * RandomMatrix(random, 2, n);
  const MatrixXd rest = 1e-1 * RandomMatrix(random, n, n);
  program.B = steep.transpose() * steep + rest.transpose() * rest;
  program.g = steep.transpose() * VectorXd::Constant(2, 1e-3) + 1e-2 * RandomMatrix(random, n, 1);
  program.hard = RandomMatrix(random, size.hard, n);
  program.hard_value = -RandomMatrix(random, size.hard, 1).cwiseAbs();
  program.hard_value.head(size.hard / 4).setZero();
  program.soft = 10 * RandomMatrix(random, size.soft, n);
  program.soft_value = 0.05 * RandomMatrix(random, size.soft, 1);
  program.price = price;
  program.lower = VectorXd::Constant(n, -radius);
  program.upper = VectorXd::Constant(n, radius);
  program.upper[0] = 0;  // at the end of its range
  return program;
}

double Value(const QuadraticProgram& program, const VectorXd& p) {
  return program.g.dot(p) + 0.5 * p.dot(program.B * p) +
         program.price * (program.soft * p + program.soft_value).cwiseMax(0).sum();
}

/// How far p is beyond the limits that it must keep.
double Excess(const QuadraticProgram& program, const VectorXd& p) {
  return std::max({(program.hard * p + program.hard_value).maxCoeff(),
                   (p - program.upper).maxCoeff(), (program.lower - p).maxCoeff()});
}

/// The least value of all, by trying which limits hold with equality: for each choice, the
/// stationary point of what is left is found by linear algebra. Of those that keep all limits, the
/// best one is the solution, since the program is convex.
class ActiveSets {
 public:
  explicit ActiveSets(const QuadraticProgram& program, double tolerance)
      : program_(program), tolerance_(tolerance) {
    Choose(0, {}, {}, program.g);
  }
  [[nodiscard]] double least() const { return least_; }

 private:
  /// @param rows, values  what holds with equality so far: row . p + value = 0.
  /// @param g             gradient, with that of soft limits that are exceeded.
  void Choose(Index limit, const std::vector<VectorXd>& rows, const std::vector<double>& values,
              const VectorXd& g) {
    const Index n = program_.g.size(), hard = program_.hard.rows();
    if (static_cast<Index>(rows.size()) > n) return;
    if (limit == n + hard + program_.soft.rows()) return Try(rows, values, g);
    Choose(limit + 1, rows, values, g);
    const auto with = [&](const VectorXd& row, double value) {
      std::vector<VectorXd> more = rows;
      std::vector<double> more_values = values;
      more.push_back(row);
      more_values.push_back(value);
      Choose(limit + 1, more, more_values, g);
    };
    if (limit < n) {
      with(VectorXd::Unit(n, limit), -program_.lower[limit]);
      with(VectorXd::Unit(n, limit), -program_.upper[limit]);
    } else if (limit < n + hard) {
      with(program_.hard.row(limit - n), program_.hard_value[limit - n]);
    } else {
      const Index i = limit - n - hard;
      with(program_.soft.row(i), program_.soft_value[i]);
      Choose(limit + 1, rows, values, g + program_.price * program_.soft.row(i).transpose());
    }
  }

  void Try(const std::vector<VectorXd>& rows, const std::vector<double>& values,
           const VectorXd& g) {
    const Index n = g.size(), active = static_cast<Index>(rows.size());
    MatrixXd K = MatrixXd::Zero(n + active, n + active);
    VectorXd right(n + active);
    K.topLeftCorner(n, n) = program_.B;
    right.head(n) = -g;
    for (Index i = 0; i < active; ++i) {
      K.col(n + i).head(n) = rows[static_cast<std::size_t>(i)];
      K.row(n + i).head(n) = rows[static_cast<std::size_t>(i)].transpose();
      right[n + i] = -values[static_cast<std::size_t>(i)];
    }
    const VectorXd p = K.partialPivLu().solve(right).head(n);
    if (p.allFinite() && Excess(program_, p) <= tolerance_)
      least_ = std::min(least_, Value(program_, p));
  }

  const QuadraticProgram& program_;
  double tolerance_;
  double least_ = std::numeric_limits<double>::infinity();
};

TEST(QuadraticProgram, HasTheLeastValueOfAllChoicesOfActiveLimits) {
  std::mt19937 random(1);
  for (const double radius : {0.2, 1e-2, 1e-4}) {
    for (const double price : {1e-4, 1e-2, 1.0, 1e3}) {
      for (int trial = 0; trial < 10; ++trial) {
        const QuadraticProgram program = SomeStep(random, {4, 4, 2}, radius, price);
        const QuadraticSolution solution = Solve(program);
        EXPECT_TRUE(solution.converged) << radius << " " << price << " " << trial;
        EXPECT_LE(Excess(program, solution.p), 1e-8 * radius);
        const double least = ActiveSets(program, 1e-9 * radius).least();
        const double rounding = 1e-7 * (program.g.cwiseAbs().sum() * radius + price * 10 * radius);
        EXPECT_NEAR(Value(program, solution.p), least, rounding)
            << radius << " " << price << " " << trial;
        EXPECT_GE(solution.soft_multiplier.minCoeff(), 0);
        EXPECT_LE(solution.soft_multiplier.maxCoeff(), price * (1 + 1e-6));
      }
    }
  }
}

/// A task has too many limits to try all choices of them.
TEST(QuadraticProgram, HasNoBetterStepAnywhereWithManyLimits) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (const double radius : {0.2, 1e-2, 1e-4, 1e-6}) {
    for (const double price : {1e-4, 1e-2, 1.0, 1e3}) {
      for (int trial = 0; trial < 20; ++trial) {
        const QuadraticProgram program = SomeStep(random, {12, 40, 4}, radius, price);
        const QuadraticSolution solution = Solve(program);
        EXPECT_TRUE(solution.converged) << radius << " " << price << " " << trial;
        EXPECT_LE(Excess(program, solution.p), 1e-8 * radius);
        const double least = Value(program, solution.p);
        const double rounding = 1e-7 * (program.g.cwiseAbs().sum() * radius + price * 10 * radius);
        for (int other = 0; other < 50; ++other) {
          VectorXd step = radius * RandomMatrix(random, 12, 1);
          step = step.cwiseMax(program.lower).cwiseMin(program.upper);
          // Steps that break limits are shortened until they keep them.
          double most = 1;
          const VectorXd slope = program.hard * step;
          for (Index i = 0; i < slope.size(); ++i) {
            if (slope[i] > 0) most = std::min(most, -program.hard_value[i] / slope[i]);
          }
          EXPECT_GE(Value(program, most * step), least - rounding);
        }
      }
    }
  }
}

}  // namespace
}  // namespace tumbler
