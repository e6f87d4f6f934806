#include "offline/solve/gauss_newton.h"

#include "common/core/index.h"

namespace tumbler {

GaussNewtonSum::GaussNewtonSum(const Problem& problem)
    : parameters_(problem.parameter_count()), slope_(Index(parameters_)) {
  for (const CostTerm& term : problem.cost) {
    if (term.kind == CostTerm::Kind::kEffort) effort_weight_ += term.weight;
  }
}

void GaussNewtonSum::Begin(GaussNewton* wanted) {
  wanted_ = wanted;
  if (wanted_ == nullptr) return;
  wanted_->matrix.setZero(parameters_, parameters_);
  wanted_->residual_slopes.resize(0, parameters_);
  wanted_->squares = 0;
  wanted_->linear.setZero(parameters_);
}

/// Adds weight slope slope^T to the lower triangle of the matrix.
void GaussNewtonSum::AddSquare(double weight, const double* slope) {
  const Eigen::Map<const Eigen::VectorXd> v(slope, parameters_);
  for (int k = 0; k < parameters_; ++k)
    wanted_->matrix.col(k).tail(parameters_ - k) += (weight * v[k]) * v.tail(parameters_ - k);
}

void GaussNewtonSum::AddEffort(double step_s, double growth, double torque, const double* slope) {
  if (!(effort_weight_ > 0)) return;
  if (growth == 0) return AddSquare(effort_weight_ * step_s, slope);
  // What is squared is the torque times the root of the step's length.
  slope_.assign(slope, slope + parameters_);
  slope_.back() += 0.5 * growth * torque;
  AddSquare(effort_weight_ * step_s, slope_.data());
}

void GaussNewtonSum::AddResidual(double residual, std::span<const double> slope) {
  wanted_->squares += residual * residual;
  AddSquare(2, slope.data());
  Eigen::MatrixXd& slopes = wanted_->residual_slopes;
  slopes.conservativeResize(slopes.rows() + 1, parameters_);
  slopes.row(slopes.rows() - 1) = Eigen::Map<const Eigen::RowVectorXd>(slope.data(), parameters_);
}

void GaussNewtonSum::End() {
  if (wanted_ == nullptr) return;
  Eigen::MatrixXd& matrix = wanted_->matrix;
  for (Eigen::Index k = 1; k < matrix.cols(); ++k)
    matrix.col(k).head(k) = matrix.row(k).head(k).transpose();
}

}  // namespace tumbler
