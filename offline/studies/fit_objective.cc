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

/// Of where a joint was set down, from its setpoint: as of a zero.
constexpr double kStart_rad = 5e-3;

/// Central differences, a column each.
/// @param robots  those of FitObjective::Beside.
/// @param first   the coordinate in which the first of them differs.
MatrixXd SlopesOf(const MatrixXd& residuals, const std::vector<VectorXd>& robots,
                  Eigen::Index first) {
  const Eigen::Index count = residuals.cols() / 2;
  MatrixXd of = residuals.leftCols(count) - residuals.rightCols(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    of.col(i) /= robots[static_cast<std::size_t>(i)][first + i] -
                 robots[static_cast<std::size_t>(count + i)][first + i];
  }
  return of;
}

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
  for (const RecordedMotion& record : records) {
    replays_.push_back(std::make_unique<RecordedReplay>(record, prior_.quantities));
    rows_ += replays_.back()->count();
    starts_ += record.joint_count();
  }
  least_.resize(n_ + starts_, -std::numeric_limits<double>::infinity());
  SetPrior(prior.earlier);
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

VectorXd FitObjective::Extended(const VectorXd& w) const {
  VectorXd extended = VectorXd::Zero(size());
  extended.head(w.size()) = w;
  return extended;
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
  std::vector<bool> held(least_.size(), false);
  for (int round = 0; round < 4; ++round) {
    std::vector<Eigen::Index> free;
    for (std::size_t i = 0; i < held.size(); ++i)
      if (!held[i]) free.push_back(ToIndex(i));
    const MatrixXd of_free = A(free, free);
    VectorXd right = -g(free);
    for (std::size_t i = 0; i < held.size(); ++i)
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

MatrixXd FitObjective::ResidualsOf(std::size_t record, const std::vector<VectorXd>& robots,
                                   int per_tick) const {
  std::size_t first = n_;
  for (std::size_t r = 0; r < record; ++r) first += replays_[r]->motion().joint_count();
  const RecordedReplay& replay = *replays_[record];
  std::vector<std::vector<double>> coordinates, starts;
  for (const VectorXd& u : robots) {
    coordinates.push_back(CoordinatesOf(u));
    const auto start = u.segment(ToIndex(first), ToIndex(replay.motion().joint_count()));
    starts.emplace_back(start.begin(), start.end());
    for (double& offset : starts.back()) offset *= kStart_rad;
  }
  const auto residuals = replay.Play(coordinates, per_tick, starts);
  MatrixXd all(ToIndex(replay.count()), ToIndex(robots.size()));
  for (std::size_t r = 0; r < robots.size(); ++r) {
    all.col(ToIndex(r)) =
        Eigen::Map<const VectorXd>(residuals.of_robot[r].data(), ToIndex(replay.count()));
  }
  return all;
}

MatrixXd FitObjective::Residuals(const std::vector<VectorXd>& robots, int per_tick) {
  MatrixXd all(ToIndex(rows_), ToIndex(robots.size()));
  Eigen::Index row = 0;
  for (std::size_t record = 0; record < replays_.size(); ++record) {
    const MatrixXd of_record = ResidualsOf(record, robots, per_tick);
    all.middleRows(row, of_record.rows()) = of_record;
    row += of_record.rows();
  }
  if (!masses_.empty()) {
    for (std::size_t r = 0; r < robots.size(); ++r) {
      const std::vector<double> coordinates = CoordinatesOf(robots[r]);
      double total = 0;
      for (const std::size_t i : masses_) total += portable::Exp(coordinates[i]);
      all(row, ToIndex(r)) = portable::Log(total / settings_.weight_kg) / settings_.weight_sd;
    }
  }
  evaluations_ += static_cast<int>(robots.size());
  return all;
}

std::vector<VectorXd> FitObjective::Beside(const VectorXd& u, Eigen::Index first,
                                           Eigen::Index count) const {
  std::vector<VectorXd> robots;
  for (const double step : {kDifference, -kDifference}) {
    for (Eigen::Index i = first; i < first + count; ++i) {
      VectorXd robot = u;
      robot[i] += step;
      robots.push_back(Allowed(robot));
    }
  }
  return robots;
}

MatrixXd FitObjective::Derivatives(const VectorXd& u, int per_tick) {
  const std::vector<VectorXd> robots = Beside(u, 0, ToIndex(n_));
  MatrixXd J(ToIndex(rows_), size());
  J << SlopesOf(Residuals(robots, per_tick), robots, 0), StartDerivatives(u, per_tick);
  return J;
}

MatrixXd FitObjective::StartDerivatives(const VectorXd& u, int per_tick) const {
  MatrixXd J = MatrixXd::Zero(ToIndex(rows_), ToIndex(starts_));
  Eigen::Index row = 0, column = 0;
  for (std::size_t record = 0; record < replays_.size(); ++record) {
    const auto joints = ToIndex(replays_[record]->motion().joint_count());
    const auto rows = ToIndex(replays_[record]->count());
    const Eigen::Index first = ToIndex(n_) + column;
    const std::vector<VectorXd> robots = Beside(u, first, joints);
    J.block(row, column, rows, joints) =
        SlopesOf(ResidualsOf(record, robots, per_tick), robots, first);
    row += rows;
    column += joints;
  }
  return J;
}

void FitObjective::SetPrior(const RobotInformation& earlier) {
  const Eigen::Index n = ToIndex(n_);
  centre_ = VectorXd::Zero(size());
  precision_ = gradient_covariance_ = MatrixXd::Identity(size(), size());
  const Eigen::Map<const VectorXd> scale(deviations_.data(), n);
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto scaled = [&](const std::vector<double>& matrix) -> MatrixXd {
    return scale.asDiagonal() * Eigen::Map<const Rows>(matrix.data(), n, n) * scale.asDiagonal();
  };
  if (!earlier.empty()) {
    for (std::size_t i = 0; i < n_; ++i)
      centre_[ToIndex(i)] = (earlier.centre[i] - prior_.mean[i]) / deviations_[i];
    precision_.topLeftCorner(n, n) = scaled(earlier.hessian);
    gradient_covariance_.topLeftCorner(n, n) = scaled(earlier.gradient_covariance);
    return;
  }
  const VectorXd inverse = scale.cwiseInverse();
  MatrixXd correlations = inverse.asDiagonal() *
                          Eigen::Map<const Rows>(prior_.covariance.data(), n, n) *
                          inverse.asDiagonal();
  constexpr double kRounding = 1e-9;
  correlations.diagonal().array() += kRounding;
  precision_.topLeftCorner(n, n) = correlations.ldlt().solve(MatrixXd::Identity(n, n));
  gradient_covariance_ = precision_;
}

}  // namespace tumbler
