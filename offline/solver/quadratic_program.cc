#include "offline/solver/quadratic_program.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace tumbler {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostIterations = 60;
/// Relative residual and gap at which the method ends.
constexpr double kTolerance = 1e-11;

/// The program in the variables z = (p, t) with all limits as G z <= h, where t_i >= 0 is what the
/// soft limit i is exceeded by. Rows of G: hard, soft, then those of one number each, which are
/// p <= upper, -p <= -lower and -t <= 0.
class InteriorPoint {
 public:
  explicit InteriorPoint(const QuadraticProgram& program)
      : n_(program.g.size()),
        soft_(program.soft.rows()),
        dense_(program.hard.rows() + soft_),
        // Costs are of order one in the method.
        scale_(1 / std::max({program.g.lpNorm<Eigen::Infinity>(),
                             program.B.diagonal().cwiseAbs().maxCoeff() *
                                 program.upper.cwiseAbs().maxCoeff(),
                             1e-300})) {
    const Eigen::Index size = n_ + soft_;
    H_ = MatrixXd::Zero(size, size);
    H_.topLeftCorner(n_, n_) = scale_ * program.B;
    q_ = VectorXd::Constant(size, scale_ * program.price);
    q_.head(n_) = scale_ * program.g;
    G_ = MatrixXd::Zero(dense_, size);
    G_.topLeftCorner(program.hard.rows(), n_) = program.hard;
    G_.bottomLeftCorner(soft_, n_) = program.soft;
    G_.bottomRightCorner(soft_, soft_).diagonal().setConstant(-1);
    h_.resize(dense_ + 2 * n_ + soft_);
    h_ << -program.hard_value, -program.soft_value, program.upper, -program.lower,
        VectorXd::Zero(soft_);
    z_ = VectorXd::Zero(size);
    z_.tail(soft_) = program.soft_value.cwiseMax(0).array() + 1;
    slack_ = (h_ - Times(z_)).cwiseMax(1e-2);
    lambda_ = slack_.cwiseInverse() * 1e-2;
  }

  QuadraticSolution Run() {
    QuadraticSolution solution;
    for (int i = 0; i < kMostIterations && !solution.converged; ++i) {
      residual_dual_ = H_ * z_ + q_ + TransposedTimes(lambda_);
      residual_primal_ = Times(z_) + slack_ - h_;
      const double gap = slack_.dot(lambda_) / static_cast<double>(h_.size());
      solution.converged = residual_dual_.lpNorm<Eigen::Infinity>() <= kTolerance &&
                           residual_primal_.lpNorm<Eigen::Infinity>() <= kTolerance &&
                           gap <= kTolerance;
      if (solution.converged || !Step(gap)) break;
    }
    solution.p = z_.head(n_);
    solution.soft_multiplier = lambda_.segment(dense_ - soft_, soft_) / scale_;
    return solution;
  }

 private:
  [[nodiscard]] VectorXd Times(const VectorXd& z) const {
    VectorXd out(h_.size());
    out << G_ * z, z.head(n_), -z.head(n_), -z.tail(soft_);
    return out;
  }
  [[nodiscard]] VectorXd TransposedTimes(const VectorXd& v) const {
    VectorXd out = G_.transpose() * v.head(dense_);
    out.head(n_) += v.segment(dense_, n_) - v.segment(dense_ + n_, n_);
    out.tail(soft_) -= v.tail(soft_);
    return out;
  }

  /// @returns false when no further step is possible within rounding.
  bool Step(double gap) {
    const ArrayXd d = lambda_.array() / slack_.array();
    MatrixXd K = H_ + G_.transpose() * d.head(dense_).matrix().asDiagonal() * G_;
    K.diagonal().head(n_) += (d.segment(dense_, n_) + d.segment(dense_ + n_, n_)).matrix();
    K.diagonal().tail(soft_) += d.tail(soft_).matrix();
    const Eigen::LLT<MatrixXd> factors(K);
    if (factors.info() != Eigen::Success) return false;
    VectorXd dz, ds, dl;
    // Solves for the direction in which slack * lambda becomes slack * lambda - complement.
    const auto direction = [&](const ArrayXd& complement) {
      const ArrayXd w = d * residual_primal_.array() - complement / slack_.array();
      dz = factors.solve(-residual_dual_ - TransposedTimes(w.matrix()));
      ds = -residual_primal_ - Times(dz);
      dl = (-complement / slack_.array() - d * ds.array()).matrix();
    };
    const auto longest = [](const VectorXd& at, const VectorXd& towards) {
      double step = 1;
      for (Eigen::Index i = 0; i < at.size(); ++i) {
        if (towards[i] < 0) step = std::min(step, -at[i] / towards[i]);
      }
      return step;
    };
    const ArrayXd product = slack_.array() * lambda_.array();
    direction(product);
    const double affine = std::min(longest(slack_, ds), longest(lambda_, dl));
    const double after =
        (slack_ + affine * ds).dot(lambda_ + affine * dl) / static_cast<double>(h_.size());
    const double centring = std::pow(after / gap, 3);
    direction(product + ds.array() * dl.array() - centring * gap);
    const double step = 0.995 * std::min(longest(slack_, ds), longest(lambda_, dl));
    if (!(step > 1e-12)) return false;
    z_ += step * dz;
    slack_ += step * ds;
    lambda_ += step * dl;
    return true;
  }

  Eigen::Index n_, soft_, dense_;
  double scale_;
  MatrixXd H_, G_;
  VectorXd q_, h_, z_, slack_, lambda_, residual_dual_, residual_primal_;
};

}  // namespace

QuadraticSolution Solve(const QuadraticProgram& program) { return InteriorPoint(program).Run(); }

}  // namespace tumbler
