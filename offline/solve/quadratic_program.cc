#include "offline/solve/quadratic_program.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace tumbler {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostIterations = 60;
/// Relative residual and gap at which the method ends.
constexpr double kTolerance = 1e-12;
/// The same, where rounding lets it get no further.
constexpr double kRoundingTolerance = 1e-9;

/// The largest size of a step's parts, which are of order one in the method.
double Length(const QuadraticProgram& program) {
  const double largest = program.lower.cwiseAbs().cwiseMax(program.upper.cwiseAbs()).maxCoeff();
  return std::isfinite(largest) && largest > 0 ? largest : 1;
}

/// The program without the limits that no p within its bounds meets: those that cannot be reached,
/// and soft ones that are exceeded anyway, whose price is then linear. They would be far larger
/// than what is left, and the method could not tell the rest from rounding.
struct Reduced {
  explicit Reduced(const QuadraticProgram& whole) : program(whole) {
    const auto extreme = [&](const auto& row, const VectorXd& lower, const VectorXd& upper) {
      return (row.transpose().array() > 0)
          .select(row.transpose().cwiseProduct(upper), row.transpose().cwiseProduct(lower))
          .sum();
    };
    Eigen::Index hard = 0;
    for (Eigen::Index i = 0; i < whole.hard.rows(); ++i) {
      const double most = extreme(whole.hard.row(i), whole.lower, whole.upper);
      if (most + whole.hard_value[i] < 0) continue;
      program.hard.row(hard) = whole.hard.row(i);
      program.hard_value[hard++] = whole.hard_value[i];
    }
    program.hard.conservativeResize(hard, Eigen::NoChange);
    program.hard_value.conservativeResize(hard);
    multiplier = VectorXd::Zero(whole.soft.rows());
    for (Eigen::Index i = 0; i < whole.soft.rows(); ++i) {
      const double most = extreme(whole.soft.row(i), whole.lower, whole.upper);
      const double least = extreme(whole.soft.row(i), whole.upper, whole.lower);
      if (least + whole.soft_value[i] >= 0) {
        multiplier[i] = whole.price;
        program.g += whole.price * whole.soft.row(i).transpose();
      } else if (most + whole.soft_value[i] > 0) {
        const auto left = static_cast<Eigen::Index>(soft.size());
        program.soft.row(left) = whole.soft.row(i);
        program.soft_value[left] = whole.soft_value[i];
        soft.push_back(i);
      }
    }
    const auto left = static_cast<Eigen::Index>(soft.size());
    program.soft.conservativeResize(left, Eigen::NoChange);
    program.soft_value.conservativeResize(left);
  }

  QuadraticProgram program;
  std::vector<Eigen::Index> soft;  ///< The soft limits that are left.
  VectorXd multiplier;             ///< Those of the others.
};

/// The program in the variables z = (p, t) with all limits as G z <= h, where t_i >= 0 is what the
/// soft limit i is exceeded by. Rows of G: hard, soft, then those of one number each, which are
/// p <= upper, -p <= -lower and -t <= 0. Steps, rows and costs have units in which they are of
/// order one.
class InteriorPoint {
 public:
  explicit InteriorPoint(const QuadraticProgram& program)
      : n_(program.g.size()),
        soft_(program.soft.rows()),
        dense_(program.hard.rows() + soft_),
        length_(Length(program)) {
    const Eigen::Index size = n_ + soft_;
    MatrixXd rows(dense_, n_);
    rows << program.hard, program.soft;
    rows *= length_;
    VectorXd values(dense_);
    values << -program.hard_value, -program.soft_value;
    row_scale_.resize(dense_);
    for (Eigen::Index i = 0; i < dense_; ++i) {
      const double largest = rows.row(i).lpNorm<Eigen::Infinity>();
      row_scale_[i] = largest > 0 ? 1 / largest : 1;
    }
    const VectorXd g = length_ * program.g;
    const MatrixXd B = length_ * length_ * program.B;
    scale_ = 1 / std::max({g.lpNorm<Eigen::Infinity>(), 1e-6 * B.diagonal().cwiseAbs().maxCoeff(),
                           1e-300});
    H_ = MatrixXd::Zero(size, size);
    H_.topLeftCorner(n_, n_) = scale_ * B;
    q_.resize(size);
    q_ << scale_ * g, (scale_ * program.price) * row_scale_.tail(soft_).cwiseInverse();
    G_ = MatrixXd::Zero(dense_, size);
    G_.leftCols(n_) = row_scale_.asDiagonal() * rows;
    G_.bottomRightCorner(soft_, soft_).diagonal().setConstant(-1);
    h_.resize(dense_ + 2 * n_ + soft_);
    h_ << row_scale_.cwiseProduct(values), program.upper / length_, -program.lower / length_,
        VectorXd::Zero(soft_);
    size_ = 1 + std::max(q_.lpNorm<Eigen::Infinity>(), H_.diagonal().maxCoeff());
    z_ = VectorXd::Zero(size);
    z_.tail(soft_) = (-h_.segment(dense_ - soft_, soft_)).cwiseMax(0).array() + 1;
    slack_ = (h_ - Times(z_)).cwiseMax(1e-2);
    lambda_ = slack_.cwiseInverse() * (1e-2 * size_);
  }

  QuadraticSolution Run() {
    QuadraticSolution solution;
    const auto solved = [&](double tolerance, double gap) {
      return residual_dual_.lpNorm<Eigen::Infinity>() <= tolerance * size_ &&
             residual_primal_.lpNorm<Eigen::Infinity>() <= tolerance && gap <= tolerance;
    };
    for (int i = 0; i < kMostIterations && !solution.converged; ++i) {
      residual_dual_ = H_ * z_ + q_ + TransposedTimes(lambda_);
      residual_primal_ = Times(z_) + slack_ - h_;
      const double gap = slack_.dot(lambda_) / static_cast<double>(h_.size());
      solution.converged = solved(kTolerance, gap);
      const bool ends = i + 1 == kMostIterations;
      if (solution.converged || (!ends && Step(gap))) continue;
      solution.converged = solved(kRoundingTolerance, gap);
      break;
    }
    solution.p = length_ * z_.head(n_);
    solution.soft_multiplier =
        lambda_.segment(dense_ - soft_, soft_).cwiseProduct(row_scale_.tail(soft_)) / scale_;
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
    // Where the residuals are large, the affine step may widen the gap, which no centring mends.
    const double share = std::min(1.0, after / gap);
    const double centred = share * share * share * gap;
    // Products far below the tolerance would leave nothing but rounding in the residuals.
    const double aim = std::max(centred, 0.1 * kTolerance);
    // After a short affine step its products say little of the next one.
    const double trust = affine > 0.1 ? 1 : affine;
    direction(product + trust * ds.array() * dl.array() - aim);
    const double step = 0.995 * std::min(longest(slack_, ds), longest(lambda_, dl));
    if (!(step > 1e-12)) return false;
    z_ += step * dz;
    slack_ += step * ds;
    lambda_ += step * dl;
    return true;
  }

  Eigen::Index n_, soft_, dense_;
  double length_;       // unit of p
  VectorXd row_scale_;  // of dense rows
  double scale_ = 1;    // of costs
  double size_ = 1;     // of the dual condition's parts
  MatrixXd H_, G_;
  VectorXd q_, h_, z_, slack_, lambda_, residual_dual_, residual_primal_;
};

}  // namespace

QuadraticSolution Solve(const QuadraticProgram& program) {
  const Reduced reduced(program);
  QuadraticSolution solution = InteriorPoint(reduced.program).Run();
  VectorXd multiplier = reduced.multiplier;
  for (std::size_t i = 0; i < reduced.soft.size(); ++i)
    multiplier[reduced.soft[i]] = solution.soft_multiplier[static_cast<Eigen::Index>(i)];
  solution.soft_multiplier = multiplier;
  return solution;
}

}  // namespace tumbler
