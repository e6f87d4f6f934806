#include "offline/rollout/smooth_maximum.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tumbler {
namespace {

/// The longest part of a step that Gauss's three points stand for.
constexpr double kLongestPart_s = 5e-4;

/// Gauss's points in (0, 1), and their weights.
constexpr std::array<double, 3> kGaussPoint = {0.1127016653792583, 0.5, 0.8872983346207417};
constexpr std::array<double, 3> kGaussWeight = {5. / 18, 8. / 18, 5. / 18};

/// Sets the weights of the stages in the polynomial through them, at a part of the step.
template <std::size_t kNodes>
void Interpolate(const std::array<std::size_t, kNodes>& stage, const Tableau& scheme, double at,
                 std::array<double, Tableau::kMaxStages>& weight) {
  for (std::size_t i = 0; i < kNodes; ++i) {
    double product = 1;
    for (std::size_t k = 0; k < kNodes; ++k) {
      if (k != i) product *= (at - scheme.c[stage[k]]) / (scheme.c[stage[i]] - scheme.c[stage[k]]);
    }
    weight[stage[i]] = product;
  }
}

/// Into so many parts a step is divided.
std::size_t PartsOf(double step_s) {
  return static_cast<std::size_t>(std::max(1.0, std::ceil(step_s / kLongestPart_s - 1e-9)));
}

}  // namespace

LookPoints::LookPoints(const Tableau& scheme, double longest_s) : by_count_(PartsOf(longest_s)) {
  for (std::size_t count = 1; count <= by_count_.size(); ++count) {
    for (std::size_t i = 0; i < count * kGaussPoint.size(); ++i) {
      const std::size_t part = i / kGaussPoint.size(), k = i % kGaussPoint.size();
      const double at = (static_cast<double>(part) + kGaussPoint[k]) / static_cast<double>(count);
      LookPoint point;
      point.part = kGaussWeight[k] / static_cast<double>(count);
      if (&scheme == &kClassical) {
        Interpolate<3>({0, 1, 3}, scheme, at, point.of_stage);
        // Errors of the two stages in the middle are opposite.
        point.of_stage[1] /= 2;
        point.of_stage[2] = point.of_stage[1];
      } else {
        Interpolate<5>({0, 2, 3, 4, 5}, scheme, at, point.of_stage);
      }
      by_count_[count - 1].push_back(point);
    }
  }
}

std::span<const LookPoint> LookPoints::In(double step_s) const {
  return by_count_[std::min(PartsOf(step_s), by_count_.size()) - 1];
}

double SmoothMaximum::Add(std::span<const LookPoint> points, double step_s,
                          std::span<const double> values, std::span<double> slopes) {
  const auto value_at = [&](const LookPoint& point) {
    double value = 0;
    for (std::size_t s = 0; s < values.size(); ++s) value += point.of_stage[s] * values[s];
    return value;
  };
  const auto counted = [&](double value) {
    return of_ == Of::kSize ? std::abs(value) : std::max(0.0, value);
  };
  std::fill(slopes.begin(), slopes.end(), 0.0);
  const double before = largest_;
  for (const LookPoint& point : points) largest_ = std::max(largest_, counted(value_at(point)));
  const double shrink = std::exp(rho_ * (before - largest_));
  sum_ *= shrink;
  const double unit = std::exp(-rho_ * largest_);
  const double share = step_s / kPeakDuration_s;
  for (const LookPoint& point : points) {
    const double value = value_at(point), exponent = rho_ * counted(value);
    if (exponent < rho_ * largest_ + 2 * kNegligibleExponent) continue;
    const double power = std::exp(exponent - rho_ * largest_);
    double term = power;
    // The difference of two numbers near one would be rounding.
    if (of_ == Of::kAboveZero) term = exponent < 1 ? std::expm1(exponent) * unit : power - unit;
    const double part = share * point.part;
    sum_ += part * term;
    if (of_ == Of::kAboveZero && value <= 0) continue;
    const double slope = std::copysign(part * power, value);
    for (std::size_t s = 0; s < slopes.size(); ++s) slopes[s] += point.of_stage[s] * slope;
  }
  return shrink;
}

double SmoothMaximum::value() const { return largest_ + std::log(sum_) / rho_; }

double SmoothDepth::Evaluate(std::span<const ActiveContact<Plane>> active) {
  slopes_.assign(active.size(), 0.0);
  // The sum and its terms are scaled by exp(-largest).
  double largest = 0, others = 0;
  for (const auto& contact : active)
    largest = std::max(largest, rho_ * (contact.depth_m / usable_m_ - least()));
  for (std::size_t i = 0; i < active.size(); ++i) {
    const double exponent = rho_ * (active[i].depth_m / usable_m_ - least());
    if (exponent < kNegligibleExponent) continue;
    slopes_[i] = std::exp(exponent - largest);
    others += slopes_[i];
  }
  const double one = std::exp(-largest);
  for (double& slope : slopes_) slope /= (one + others) * usable_m_;
  if (largest == 0) return std::log1p(others) / rho_;
  return (largest + std::log(one + others)) / rho_;
}

}  // namespace tumbler
