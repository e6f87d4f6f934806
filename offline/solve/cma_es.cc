#include "offline/solve/cma_es.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/model/dense_eigen.h"

namespace tumbler {

CmaEs::CmaEs(const std::vector<double>& start, double sigma, int population, std::uint64_t seed)
    : n_(static_cast<int>(start.size())),
      population_(population),
      parents_(population / 2),
      sigma_(sigma),
      normal_(seed, 0),
      weights_(parents_),
      mean_(Eigen::Map<const Eigen::VectorXd>(start.data(), n_)),
      path_c_(Eigen::VectorXd::Zero(n_)),
      path_s_(Eigen::VectorXd::Zero(n_)),
      scales_(Eigen::VectorXd::Ones(n_)),
      covariance_(Eigen::MatrixXd::Identity(n_, n_)),
      axes_(Eigen::MatrixXd::Identity(n_, n_)) {
  for (int i = 0; i < parents_; ++i)
    weights_[i] = portable::Log((population + 1) / 2.0) - portable::Log(i + 1.0);
  weights_ /= weights_.sum();
  const double n = n_;
  mu_eff_ = 1 / weights_.squaredNorm();
  c_c_ = (4 + mu_eff_ / n) / (n + 4 + 2 * mu_eff_ / n);
  c_s_ = (mu_eff_ + 2) / (n + mu_eff_ + 5);
  c_1_ = 2 / ((n + 1.3) * (n + 1.3) + mu_eff_);
  c_mu_ = std::min(1 - c_1_, 2 * (mu_eff_ - 2 + 1 / mu_eff_) / ((n + 2) * (n + 2) + mu_eff_));
  damping_ = 1 + 2 * std::max(0.0, std::sqrt((mu_eff_ - 1) / (n + 1)) - 1) + c_s_;
  expected_norm_ = std::sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n));
}

CmaEs::CmaEs(const std::vector<double>& start, const Eigen::MatrixXd& covariance, int population,
             std::uint64_t seed)
    : CmaEs(start, 1, population, seed) {
  covariance_ = covariance;
  Decompose();
}

void CmaEs::Decompose() {
  const DenseEigen eigen = DecomposeSymmetric(covariance_);
  axes_ = eigen.vectors;
  scales_ = eigen.values.cwiseMax(1e-20).cwiseSqrt();
}

std::vector<std::vector<double>> CmaEs::Ask() {
  candidates_.clear();
  std::vector<std::vector<double>> out;
  for (int i = 0; i < population_; ++i) {
    Eigen::VectorXd z(n_);
    for (int k = 0; k < n_; ++k) z[k] = normal_.Draw();
    const Eigen::VectorXd& x =
        candidates_.emplace_back(mean_ + sigma_ * (axes_ * scales_.cwiseProduct(z)));
    out.emplace_back(x.data(), x.data() + n_);
  }
  return out;
}

void CmaEs::Tell(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  const Eigen::VectorXd before = mean_;
  mean_.setZero();
  for (int i = 0; i < parents_; ++i) mean_ += weights_[i] * candidates_[order[Index(i)]];
  const Eigen::VectorXd step = (mean_ - before) / sigma_;

  ++generation_;
  const Eigen::VectorXd whitened =
      axes_ * scales_.cwiseInverse().cwiseProduct(axes_.transpose() * step);
  path_s_ = (1 - c_s_) * path_s_ + std::sqrt(c_s_ * (2 - c_s_) * mu_eff_) * whitened;
  const double usual = std::sqrt(1 - portable::Power(1 - c_s_, 2 * generation_)) * expected_norm_;
  const bool steady = path_s_.norm() < (1.4 + 2.0 / (n_ + 1)) * usual;
  path_c_ *= 1 - c_c_;
  if (steady) path_c_ += std::sqrt(c_c_ * (2 - c_c_) * mu_eff_) * step;

  const double kept = 1 - c_1_ - c_mu_ + (steady ? 0 : c_1_ * c_c_ * (2 - c_c_));
  covariance_ = kept * covariance_ + c_1_ * path_c_ * path_c_.transpose();
  for (int i = 0; i < parents_; ++i) {
    const Eigen::VectorXd y = (candidates_[order[Index(i)]] - before) / sigma_;
    covariance_ += c_mu_ * weights_[i] * y * y.transpose();
  }
  sigma_ *= portable::Exp(c_s_ / damping_ * (path_s_.norm() / expected_norm_ - 1));
  Decompose();
}

}  // namespace tumbler
