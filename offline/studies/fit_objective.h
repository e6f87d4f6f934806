#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "offline/scene/robot_posterior.h"
#include "offline/studies/recorded_motion.h"
#include "offline/studies/recorded_replay.h"
#include "offline/studies/robot_fit.h"

namespace tumbler {

/// Index of Eigen's.
inline Eigen::Index ToIndex(std::size_t i) { return static_cast<Eigen::Index>(i); }

/// The objective of a fit: half the sum of squares of the residuals, and
/// (w - c)^T P (w - c) / 2 of how far a robot is from what was known before. A robot is that of the
/// prior's mean and the first coordinates of w, in deviations of what was known before the first
/// record. The others say of each record and joint where the robot was set down: a robot that is
/// put where its encoders read the start is off by their zeros, and one that was moved there is
/// not, and which of both it was no record tells.
class FitObjective {
 public:
  /// All have to outlive this object.
  FitObjective(std::span<const RecordedMotion> records, const FitPrior& prior,
               const FitSettings& settings);

  /// How many coordinates w has, those of the robot first.
  [[nodiscard]] Eigen::Index size() const { return ToIndex(n_ + starts_); }
  /// Coordinates with zeros for starts that they lack.
  [[nodiscard]] Eigen::VectorXd Extended(const Eigen::VectorXd& w) const;
  /// How many robots were played.
  [[nodiscard]] int evaluations() const { return evaluations_; }
  [[nodiscard]] const Eigen::MatrixXd& precision() const { return precision_; }
  /// Of the gradient of what was known before.
  [[nodiscard]] const Eigen::MatrixXd& gradient_covariance() const { return gradient_covariance_; }
  /// The gradient of what was known before.
  [[nodiscard]] Eigen::VectorXd PullOf(const Eigen::VectorXd& w) const {
    return precision_ * (w - centre_);
  }
  [[nodiscard]] const std::vector<double>& deviations() const { return deviations_; }
  [[nodiscard]] const std::vector<std::unique_ptr<RecordedReplay>>& replays() const {
    return replays_;
  }

  [[nodiscard]] std::vector<double> CoordinatesOf(const Eigen::VectorXd& w) const;
  /// Deviations with friction and filters that are nowhere negative.
  [[nodiscard]] Eigen::VectorXd Allowed(Eigen::VectorXd w) const;
  /// @param noise  by how much larger it is taken to be.
  [[nodiscard]] double ValueOf(const Eigen::VectorXd& residuals, const Eigen::VectorXd& w,
                               double noise) const;

  /// The step that minimises s^T A s / 2 + g^T s, where no friction and no filter gets negative:
  /// what would is held at 0, and the others are solved for again.
  [[nodiscard]] Eigen::VectorXd StepOf(const Eigen::MatrixXd& A, const Eigen::VectorXd& g,
                                       const Eigen::VectorXd& w) const;

  /// Residuals of robots, a column each.
  [[nodiscard]] Eigen::MatrixXd Residuals(const std::vector<Eigen::VectorXd>& robots, int per_tick);
  /// Derivatives of the residuals, by central differences. A start moves its own record alone.
  [[nodiscard]] Eigen::MatrixXd Derivatives(const Eigen::VectorXd& u, int per_tick);
  /// The same by where robots were set down alone, the last columns.
  [[nodiscard]] Eigen::MatrixXd StartDerivatives(const Eigen::VectorXd& u, int per_tick) const;

 private:
  void SetPrior(const RobotInformation& earlier);
  /// Robots a difference to either side of one, in so many coordinates from the first.
  [[nodiscard]] std::vector<Eigen::VectorXd> Beside(const Eigen::VectorXd& u, Eigen::Index first,
                                                    Eigen::Index count) const;
  /// Residuals of a record, of robots a column each.
  [[nodiscard]] Eigen::MatrixXd ResidualsOf(std::size_t record,
                                            const std::vector<Eigen::VectorXd>& robots,
                                            int per_tick) const;

  const RobotPosterior& prior_;
  const FitSettings& settings_;
  std::size_t n_, starts_ = 0, rows_ = 0;
  std::vector<double> deviations_, least_;
  Eigen::VectorXd centre_;
  Eigen::MatrixXd precision_, gradient_covariance_;
  std::vector<std::size_t> masses_;
  std::vector<std::unique_ptr<RecordedReplay>> replays_;
  int evaluations_ = 0;
};

}  // namespace tumbler
