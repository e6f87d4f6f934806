#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "offline/scene/normal.h"

namespace tumbler {

/// The evolution strategy with covariance matrix adaptation, for minima of functions that are
/// neither smooth nor exact [H16, Figure 6], with its default parameters. One generation is Ask,
/// evaluation of the candidates by the caller, and Tell.
///
/// [H16] N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, 2016.
class CmaEs {
 public:
  /// @param sigma  initial standard deviation of every variable.
  /// @param seed   determines all candidates.
  CmaEs(const std::vector<double>& start, double sigma, int population, std::uint64_t seed);

  /// @param covariance  with which candidates are drawn at first, symmetric and positive definite.
  CmaEs(const std::vector<double>& start, const Eigen::MatrixXd& covariance, int population,
        std::uint64_t seed);

  /// New candidates.
  std::vector<std::vector<double>> Ask();
  /// @param values  of the candidates of the last Ask; lower is better, and none is NaN.
  void Tell(const std::vector<double>& values);

  /// How many variables there are.
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(n_); }
  /// Of every variable at first, where the search began with one; else a factor of its covariance.
  [[nodiscard]] double sigma() const { return sigma_; }
  /// The mean of the distribution that candidates are drawn from.
  [[nodiscard]] std::vector<double> mean() const { return {mean_.begin(), mean_.end()}; }

 private:
  /// Takes axes and scales from the covariance.
  void Decompose();

  int n_, population_, parents_;
  double sigma_;
  Normal normal_;
  int generation_ = 0;
  double mu_eff_, c_c_, c_s_, c_1_, c_mu_, damping_, expected_norm_;
  Eigen::VectorXd weights_, mean_, path_c_, path_s_, scales_;
  Eigen::MatrixXd covariance_, axes_;
  std::vector<Eigen::VectorXd> candidates_;
};

}  // namespace tumbler
