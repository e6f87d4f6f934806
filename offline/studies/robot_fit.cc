#include "offline/studies/robot_fit.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

#include "common/core/functions.h"
#include "offline/scene/normal.h"
#include "offline/studies/recorded_replay.h"

namespace tumbler {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Kind = RobotQuantity::Kind;

/// Of a difference, in standard deviations of the prior.
constexpr double kDifference = 0.01;
/// Of the sandwich: as long as a bump of residuals.
constexpr double kBlock_s = 0.05;
/// An iteration that gains less than this part of the objective is the last of its noise.
constexpr double kGain = 1e-3;

Eigen::Index ToIndex(std::size_t i) { return static_cast<Eigen::Index>(i); }

/// The objective of a fit: half the sum of squares of the residuals and of how far a robot is from
/// the prior, in variables that are independent and of deviation 1 by the prior.
class Objective {
 public:
  Objective(std::span<const RecordedMotion> records, const RobotPosterior& prior,
            const FitSettings& settings)
      : prior_(prior), settings_(settings), n_(prior.size()) {
    factor_ = LowerFactor(prior.covariance, n_);
    for (const RecordedMotion& record : records) {
      replays_.push_back(std::make_unique<RecordedReplay>(record, prior.quantities));
      rows_ += replays_.back()->count();
    }
    if (settings.weight_kg > 0) {
      ++rows_;
      for (std::size_t i = 0; i < n_; ++i)
        if (prior.quantities[i].kind == Kind::kMass) masses_.push_back(i);
    }
  }

  [[nodiscard]] std::size_t size() const { return n_; }
  [[nodiscard]] int evaluations() const { return evaluations_; }
  [[nodiscard]] const std::vector<std::unique_ptr<RecordedReplay>>& replays() const {
    return replays_;
  }

  [[nodiscard]] std::vector<double> CoordinatesOf(const VectorXd& u) const {
    std::vector<double> z = prior_.mean;
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t k = 0; k <= i; ++k) z[i] += factor_[i * n_ + k] * u[ToIndex(k)];
    }
    return z;
  }

  /// The variables with friction that is nowhere negative: where it would be, the motion no longer
  /// depends on it.
  [[nodiscard]] VectorXd Allowed(const VectorXd& u) const {
    std::vector<double> z = CoordinatesOf(u);
    bool changed = false;
    for (std::size_t i = 0; i < n_; ++i) {
      if (prior_.quantities[i].kind != Kind::kDry || z[i] >= 0) continue;
      z[i] = 0;
      changed = true;
    }
    if (!changed) return u;
    VectorXd allowed(ToIndex(n_));
    for (std::size_t i = 0; i < n_; ++i) {
      double rest = z[i] - prior_.mean[i];
      for (std::size_t k = 0; k < i; ++k) rest -= factor_[i * n_ + k] * allowed[ToIndex(k)];
      const double pivot = factor_[i * n_ + i];
      allowed[ToIndex(i)] = pivot > 0 ? rest / pivot : 0.0;
    }
    return allowed;
  }

  /// Residuals of robots, a column each.
  [[nodiscard]] MatrixXd Residuals(const std::vector<VectorXd>& robots, int per_tick) {
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

  /// Derivatives of the residuals, by forward differences.
  [[nodiscard]] MatrixXd Derivatives(const VectorXd& u, int per_tick) {
    std::vector<VectorXd> robots = {u};
    for (std::size_t i = 0; i < n_; ++i) {
      robots.push_back(u);
      robots.back()[ToIndex(i)] += kDifference;
    }
    MatrixXd all = Residuals(robots, per_tick);
    const VectorXd base = all.col(0);
    return (all.rightCols(ToIndex(n_)).colwise() - base) / kDifference;
  }

 private:
  const RobotPosterior& prior_;
  const FitSettings& settings_;
  std::size_t n_, rows_ = 0;
  std::vector<double> factor_;
  std::vector<std::size_t> masses_;
  std::vector<std::unique_ptr<RecordedReplay>> replays_;
  int evaluations_ = 0;
};

double ValueOf(const VectorXd& residuals, const VectorXd& u, double noise) {
  return 0.5 * (residuals.squaredNorm() / (noise * noise) + u.squaredNorm());
}

/// Where a fit got to.
struct Found {
  VectorXd u, residuals;
  double value = std::numeric_limits<double>::infinity();  // with the true noise
};

class Fitter {
 public:
  Fitter(Objective& objective, const FitSettings& settings)
      : objective_(objective), settings_(settings) {}

  Found From(VectorXd u) {
    Found found;
    for (const double noise : settings_.annealing) {
      for (int i = 0; i < settings_.iterations && !Interrupted(); ++i) {
        if (!Step(u, noise, found)) break;
      }
    }
    return found;
  }

  [[nodiscard]] bool Interrupted() const {
    return settings_.interrupt != nullptr && *settings_.interrupt;
  }

 private:
  /// @returns whether another step may gain something.
  bool Step(VectorXd& u, double noise, Found& found) {
    const bool last = noise <= 1;
    const MatrixXd J = objective_.Derivatives(u, settings_.per_tick_rough);
    if (found.u.size() == 0) {
      found.u = u;
      found.residuals = objective_.Residuals({u}, settings_.per_tick).col(0);
    }
    const double weight = 1 / (noise * noise);
    const MatrixXd H = weight * J.transpose() * J;
    const VectorXd gradient = weight * J.transpose() * found.residuals + u;
    std::vector<VectorXd> candidates;
    for (const double damping : {0.0, 1e-2, 0.1, 1.0, 10.0, 100.0}) {
      MatrixXd A = H;
      A.diagonal().array() += 1;
      A.diagonal() += damping * A.diagonal();
      VectorXd step = A.ldlt().solve(-gradient);
      const double longest = step.cwiseAbs().maxCoeff();
      constexpr double kLongest = 3;
      if (longest > kLongest) step *= kLongest / longest;
      candidates.push_back(u + step);
      if (damping == 0) {
        candidates.push_back(u + 0.5 * step);
        candidates.push_back(u + 0.25 * step);
      }
    }
    candidates.resize(Packet::kLanes, u);
    for (VectorXd& candidate : candidates) candidate = objective_.Allowed(candidate);
    const MatrixXd residuals = objective_.Residuals(candidates, settings_.per_tick);
    const double before = ValueOf(found.residuals, u, noise);
    double best = before;
    std::size_t which = candidates.size();
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      const double value = ValueOf(residuals.col(ToIndex(c)), candidates[c], noise);
      if (value < best) {
        best = value;
        which = c;
      }
    }
    if (settings_.say) {
      settings_.say(fmt::format(
          "noise x{:.3g}: {:.6g} -> {:.6g}{}", noise, before, best,
          which == candidates.size() ? " (no step helps)" : fmt::format(" by {}", which)));
    }
    if (which == candidates.size()) return false;
    u = candidates[which];
    found.u = u;
    found.residuals = residuals.col(ToIndex(which));
    found.value = ValueOf(found.residuals, u, 1);
    static_cast<void>(last);
    return before - best > kGain * before;
  }

  Objective& objective_;
  const FitSettings& settings_;
};

std::vector<FitResiduals> Split(const Objective& objective, const VectorXd& residuals) {
  std::vector<FitResiduals> split;
  Eigen::Index row = 0;
  for (const auto& replay : objective.replays()) {
    const RecordedMotion& motion = replay->motion();
    const std::size_t joints = motion.joint_count();
    FitResiduals of;
    of.record = motion.name;
    of.tick_s = motion.tick_s;
    of.first_s =
        (static_cast<double>(replay->first()) - static_cast<double>(motion.begins)) * motion.tick_s;
    of.of_joint.resize(joints);
    of.noise_rad = replay->noise_rad();
    std::vector<double> squares(joints, 0.0), counts(joints, 0.0);
    std::size_t i = 0;
    for (std::size_t k = replay->first(); k < motion.ticks.size(); ++k) {
      for (std::size_t j = 0; j < joints; ++j, ++row, ++i) {
        const double part = replay->parts()[i], r = residuals[row];
        of.of_joint[j].push_back(part > 0 ? r / std::sqrt(part)
                                          : std::numeric_limits<double>::quiet_NaN());
        squares[j] += r * r;
        counts[j] += part;
      }
    }
    for (std::size_t j = 0; j < joints; ++j) {
      of.chi_of_joint.push_back(std::sqrt(squares[j] / std::max(1.0, counts[j])));
      of.squares += squares[j];
      of.readings += counts[j];
    }
    of.chi = std::sqrt(of.squares / std::max(1.0, of.readings));
    split.push_back(std::move(of));
  }
  return split;
}

double ChiOf(const std::vector<FitResiduals>& records) {
  double squares = 0, readings = 0;
  for (const FitResiduals& record : records) {
    squares += record.squares;
    readings += record.readings;
  }
  return std::sqrt(squares / std::max(1.0, readings));
}

/// The covariance of the variables about a solution.
MatrixXd Sandwich(Objective& objective, const Found& found, const FitSettings& settings) {
  const MatrixXd J = objective.Derivatives(found.u, settings.per_tick);
  const Eigen::Index n = J.cols();
  MatrixXd A = J.transpose() * J;
  A.diagonal().array() += 1;
  MatrixXd meat = MatrixXd::Identity(n, n);
  Eigen::Index row = 0;
  for (const auto& replay : objective.replays()) {
    const RecordedMotion& motion = replay->motion();
    const auto rows = ToIndex(replay->count());
    const auto block = ToIndex(static_cast<std::size_t>(std::lround(kBlock_s / motion.tick_s)) *
                               motion.joint_count());
    for (Eigen::Index at = 0; at < rows; at += block) {
      const Eigen::Index length = std::min(block, rows - at);
      const VectorXd score =
          J.middleRows(row + at, length).transpose() * found.residuals.segment(row + at, length);
      meat += score * score.transpose();
    }
    row += rows;
  }
  for (; row < J.rows(); ++row) meat += J.row(row).transpose() * J.row(row);
  const auto solve = A.ldlt();
  const MatrixXd half = solve.solve(meat);
  const MatrixXd sandwich = solve.solve(half.transpose());
  const MatrixXd plain = solve.solve(MatrixXd::Identity(n, n));
  // No residual says less than its own noise.
  MatrixXd covariance = sandwich;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (sandwich(i, i) >= plain(i, i)) continue;
    const double larger = std::sqrt(plain(i, i) / sandwich(i, i));
    covariance.row(i) *= larger;
    covariance.col(i) *= larger;
  }
  return 0.5 * (covariance + covariance.transpose()) * settings.widening * settings.widening;
}

}  // namespace

double FitOutcome::ShareLeft(std::size_t quantity) const {
  const double before = prior.DeviationOf(quantity);
  return before > 0 ? posterior.DeviationOf(quantity) / before : 1;
}

RobotPosterior PriorOfRecords(std::span<const RecordedMotion> records, bool weighed) {
  RobotPosterior prior = PriorOf(records.front().scene);
  std::vector<RobotQuantity> more = {{Kind::kLag, ""}};
  if (weighed) more.push_back({Kind::kTorque, ""});
  const std::size_t n = prior.size(), m = n + more.size();
  std::vector<double> covariance(m * m, 0.0);
  for (std::size_t i = 0; i < n; ++i) covariance[i * m + i] = prior.covariance[i * n + i];
  for (std::size_t i = 0; i < more.size(); ++i) {
    const double sd = FactsOf(more[i].kind).prior_sd;
    covariance[(n + i) * m + n + i] = sd * sd;
    prior.quantities.push_back(more[i]);
    prior.mean.push_back(0);
  }
  prior.covariance = std::move(covariance);
  return prior;
}

FitOutcome FitRobot(std::span<const RecordedMotion> records, const RobotPosterior& prior,
                    const FitSettings& settings) {
  if (records.empty()) throw std::invalid_argument("a fit needs a record");
  FitOutcome outcome;
  outcome.prior = prior;
  outcome.weighed = settings.weight_kg > 0;
  Objective objective(records, prior, settings);
  Fitter fitter(objective, settings);
  Found best;
  for (int start = 0; start < settings.starts && !fitter.Interrupted(); ++start) {
    VectorXd u = VectorXd::Zero(ToIndex(prior.size()));
    Normal normal(1, static_cast<std::uint64_t>(start));
    if (start > 0)
      for (Eigen::Index i = 0; i < u.size(); ++i) u[i] = normal.Draw();
    const Found found = fitter.From(objective.Allowed(u));
    ++outcome.starts;
    if (found.value < best.value || best.u.size() == 0) best = found;
    if (ChiOf(Split(objective, best.residuals)) <= settings.chi_max) break;
  }
  outcome.interrupted = fitter.Interrupted();
  if (best.u.size() == 0) return outcome;
  outcome.records = Split(objective, best.residuals);
  outcome.chi = ChiOf(outcome.records);
  outcome.effective = outcome.chi > settings.chi_max;
  const MatrixXd of_variables = Sandwich(objective, best, settings);
  const std::size_t n = prior.size();
  const std::vector<double> factor = LowerFactor(prior.covariance, n);
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> L(
      factor.data(), ToIndex(n), ToIndex(n));
  const MatrixXd covariance = L * of_variables * L.transpose();
  outcome.posterior.quantities = prior.quantities;
  outcome.posterior.mean = objective.CoordinatesOf(best.u);
  outcome.posterior.covariance.resize(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < n; ++k)
      outcome.posterior.covariance[i * n + k] = covariance(ToIndex(i), ToIndex(k));
  }
  outcome.evaluations = objective.evaluations();
  return outcome;
}

std::vector<FitResiduals> ResidualsOf(std::span<const RecordedMotion> records,
                                      const RobotPosterior& robot, int per_tick) {
  FitSettings settings;
  Objective objective(records, robot, settings);
  const VectorXd mean = VectorXd::Zero(ToIndex(robot.size()));
  return Split(objective, objective.Residuals({mean}, per_tick).col(0));
}

}  // namespace tumbler
