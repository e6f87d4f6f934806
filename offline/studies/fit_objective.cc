#include "offline/studies/fit_objective.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "common/core/functions.h"

namespace tumbler {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Kind = RobotQuantity::Kind;

namespace {

/// Of a difference, in standard deviations of the prior. A foot that lifts a little earlier makes a
/// bend in how a record depends on a robot, which a difference to one side takes for a slope, and
/// intervals are as much too narrow.
constexpr double kDifference = 0.003;

}  // namespace

FitObjective::FitObjective(std::span<const RecordedMotion> records, const FitPrior& prior,
                           const FitSettings& settings)
    : prior_(prior.known), settings_(settings), n_(prior_.size()) {
  for (std::size_t i = 0; i < n_; ++i) {
    const Kind kind = prior_.quantities[i].kind;
    const bool positive =
        kind == Kind::kDry || kind == Kind::kVelocityLag || kind == Kind::kTorqueLag;
    deviations_.push_back(prior.first_deviations.empty() ? prior_.DeviationOf(i)
                                                         : prior.first_deviations[i]);
    least_.push_back(positive ? -prior_.mean[i] / deviations_[i]
                              : -std::numeric_limits<double>::infinity());
  }
  SetPrior(prior.earlier);
  for (const RecordedMotion& record : records) {
    replays_.push_back(std::make_unique<RecordedReplay>(record, prior_.quantities));
    rows_ += replays_.back()->count();
  }
  if (settings.weight_kg > 0 && !prior.weighed) {
    ++rows_;
    for (std::size_t i = 0; i < n_; ++i)
      if (prior_.quantities[i].kind == Kind::kMass) masses_.push_back(i);
  }
}

std::vector<double> FitObjective::CoordinatesOf(const VectorXd& w) const {
  std::vector<double> z = prior_.mean;
  for (std::size_t i = 0; i < n_; ++i) z[i] += deviations_[i] * w[ToIndex(i)];
  return z;
}

VectorXd FitObjective::Allowed(VectorXd w) const {
  for (std::size_t i = 0; i < n_; ++i) w[ToIndex(i)] = std::max(w[ToIndex(i)], least_[i]);
  return w;
}

double FitObjective::ValueOf(const VectorXd& residuals, const VectorXd& w, double noise) const {
  return 0.5 * (residuals.squaredNorm() / (noise * noise) + (w - centre_).dot(PullOf(w)));
}

VectorXd FitObjective::StepOf(const MatrixXd& A, const VectorXd& g, const VectorXd& w) const {
  VectorXd step = VectorXd::Zero(w.size());
  std::vector<bool> held(n_, false);
  for (int round = 0; round < 4; ++round) {
    std::vector<Eigen::Index> free;
    for (std::size_t i = 0; i < n_; ++i)
      if (!held[i]) free.push_back(ToIndex(i));
    const MatrixXd of_free = A(free, free);
    VectorXd right = -g(free);
    for (std::size_t i = 0; i < n_; ++i)
      if (held[i]) right -= A(free, ToIndex(i)) * step[ToIndex(i)];
    const VectorXd solved = of_free.ldlt().solve(right);
    step(free) = solved;
    bool again = false;
    for (const Eigen::Index i : free) {
      const double least = least_[static_cast<std::size_t>(i)] - w[i];
      if (step[i] >= least) continue;
      step[i] = least;
      held[static_cast<std::size_t>(i)] = again = true;
    }
    if (!again) break;
  }
  return step;
}

MatrixXd FitObjective::Residuals(const std::vector<VectorXd>& robots, int per_tick) {
  std::vector<std::vector<double>> coordinates;
  for (const VectorXd& u : robots) coordinates.push_back(CoordinatesOf(u));
  MatrixXd all(ToIndex(rows_), ToIndex(robots.size()));
  Eigen::Index row = 0;
  for (const auto& replay : replays_) {
    const auto residuals = replay->Play(coordinates, per_tick);
    for (std::size_t r = 0; r < robots.size(); ++r) {
      all.block(row, ToIndex(r), ToIndex(replay->count()), 1) =
          Eigen::Map<const VectorXd>(residuals.of_robot[r].data(), ToIndex(replay->count()));
    }
    row += ToIndex(replay->count());
  }
  if (!masses_.empty()) {
    for (std::size_t r = 0; r < robots.size(); ++r) {
      double total = 0;
      for (const std::size_t i : masses_) total += portable::Exp(coordinates[r][i]);
      all(row, ToIndex(r)) = portable::Log(total / settings_.weight_kg) / settings_.weight_sd;
    }
  }
  evaluations_ += static_cast<int>(robots.size());
  return all;
}

MatrixXd FitObjective::Derivatives(const VectorXd& u, int per_tick) {
  std::vector<VectorXd> robots;
  for (const double step : {kDifference, -kDifference}) {
    for (Eigen::Index i = 0; i < u.size(); ++i) {
      VectorXd robot = u;
      robot[i] += step;
      robots.push_back(Allowed(robot));
    }
  }
  MatrixXd all = Residuals(robots, per_tick);
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const Eigen::Index less = u.size() + i;
    const double apart =
        robots[static_cast<std::size_t>(i)][i] - robots[static_cast<std::size_t>(less)][i];
    all.col(i) = (all.col(i) - all.col(less)) / apart;
  }
  return all.leftCols(u.size());
}

void FitObjective::SetPrior(const RobotInformation& earlier) {
  const Eigen::Index n = ToIndex(n_);
  centre_ = VectorXd::Zero(n);
  const Eigen::Map<const VectorXd> scale(deviations_.data(), n);
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto scaled = [&](const std::vector<double>& matrix) -> MatrixXd {
    return scale.asDiagonal() * Eigen::Map<const Rows>(matrix.data(), n, n) * scale.asDiagonal();
  };
  if (!earlier.empty()) {
    for (std::size_t i = 0; i < n_; ++i)
      centre_[ToIndex(i)] = (earlier.centre[i] - prior_.mean[i]) / deviations_[i];
    precision_ = scaled(earlier.hessian);
    gradient_covariance_ = scaled(earlier.gradient_covariance);
    return;
  }
  const VectorXd inverse = scale.cwiseInverse();
  MatrixXd correlations = inverse.asDiagonal() *
                          Eigen::Map<const Rows>(prior_.covariance.data(), n, n) *
                          inverse.asDiagonal();
  constexpr double kRounding = 1e-9;
  correlations.diagonal().array() += kRounding;
  precision_ = correlations.ldlt().solve(MatrixXd::Identity(n, n));
  gradient_covariance_ = precision_;
}

}  // namespace tumbler
