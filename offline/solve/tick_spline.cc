#include "offline/solve/tick_spline.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/core/index.h"
#include "offline/solve/robust_task.h"

namespace tumbler {

TickSpline::TickSpline(double duration_s, int ticks) : knots_(FeedForwardKnots(duration_s)) {
  const std::size_t count = knots_.size() - kFeedForwardDegree - 1;
  const Spline spline = With(std::vector<double>(count));
  for (int k = 0; k <= ticks; ++k)
    weights_.push_back(spline.EvaluateWeights(k * RobustTask::kTick_s));
  Factor(count);
}

TickSpline::Spline TickSpline::With(const std::vector<double>& points) const {
  Spline spline;
  if (spline.Assign(kFeedForwardDegree, knots_, points) != Status::kOk)
    throw std::logic_error("a spline with the knots of a feed-forward could not be set up");
  return spline;
}

std::vector<double> TickSpline::Fit(const std::vector<double>& values) const {
  std::vector<double> x(factor_.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    for (std::size_t a = 0; a < kBand; ++a)
      x[Index(weights_[k].first) + a] += weights_[k].w[0][a] * values[k];
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t d = 1; d < kBand && d <= i; ++d) x[i] -= factor_[i][d] * x[i - d];
    x[i] /= factor_[i][0];
  }
  for (std::size_t i = x.size(); i-- > 0;) {
    for (std::size_t d = 1; d < kBand && i + d < x.size(); ++d)
      x[i] -= factor_[i + d][d] * x[i + d];
    x[i] /= factor_[i][0];
  }
  return x;
}

double TickSpline::At(std::size_t tick, const std::vector<double>& points) const {
  double sum = 0;
  for (std::size_t a = 0; a < kBand; ++a)
    sum += weights_[tick].w[0][a] * points[Index(weights_[tick].first) + a];
  return sum;
}

void TickSpline::Factor(std::size_t count) {
  factor_.resize(count);
  for (const Spline::Weights& weights : weights_) {
    for (std::size_t a = 0; a < kBand; ++a) {
      for (std::size_t b = 0; b <= a; ++b)
        factor_[Index(weights.first) + a][a - b] += weights.w[0][a] * weights.w[0][b];
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t d = std::min(i, kBand - 1); d > 0; --d) {
      for (std::size_t e = d + 1; e < kBand && e <= i; ++e)
        factor_[i][d] -= factor_[i][e] * factor_[i - d][e - d];
      factor_[i][d] /= factor_[i - d][0];
    }
    for (std::size_t d = 1; d < kBand && d <= i; ++d)
      factor_[i][0] -= factor_[i][d] * factor_[i][d];
    factor_[i][0] = std::sqrt(factor_[i][0]);
  }
}

}  // namespace tumbler
