#include "offline/rollout/smooth_maximum.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

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

/// The value at a point, of those at the stages. The classical method's four need no loop.
double ValueAt(const LookPoint& point, std::span<const double> values) {
  const auto& weight = point.of_stage;
  double value = 0;
  if (values.size() == 4) {
    value += weight[0] * values[0];
    value += weight[1] * values[1];
    value += weight[2] * values[2];
    value += weight[3] * values[3];
    return value;
  }
  for (std::size_t s = 0; s < values.size(); ++s) value += weight[s] * values[s];
  return value;
}

}  // namespace

LookPoints::LookPoints(const Tableau& scheme, double longest_s) : by_count_(PartsOf(longest_s)) {
  for (std::size_t count = 1; count <= by_count_.size(); ++count) {
    double growth = 0;
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
      double sum = 0;
      for (const double weight : point.of_stage) sum += std::abs(weight);
      growth = std::max(growth, sum * (1 + 1e-12));  // for rounding
      by_count_[count - 1].push_back(point);
    }
    for (LookPoint& point : by_count_[count - 1]) point.growth = growth;
  }
}

std::span<const LookPoint> LookPoints::In(double step_s) const {
  return by_count_[std::min(PartsOf(step_s), by_count_.size()) - 1];
}

double SmoothMaximum::Add(std::span<const LookPoint> points, double step_s,
                          std::span<const double> values, std::span<double> slopes) {
  std::fill(slopes.begin(), slopes.end(), 0.0);
  double highest = 0;
  for (const double value : values) highest = std::max(highest, std::abs(value));
  // Most steps are far from the largest.
  if (rho_ * (highest * points.front().growth) < rho_ * largest_ + 2 * kNegligibleExponent)
    return 1;

  const auto counted = [&](double value) {
    return of_ == Of::kSize ? std::abs(value) : std::max(0.0, value);
  };
  std::array<double, 12> at_point;  // as many points as most steps have
  const double before = largest_;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double value = ValueAt(points[i], values);
    if (i < at_point.size()) at_point[i] = value;
    largest_ = std::max(largest_, counted(value));
  }
  const double shrink = largest_ == before ? 1 : std::exp(rho_ * (before - largest_));
  sum_ *= shrink;
  const double unit = of_ == Of::kAboveZero ? std::exp(-rho_ * largest_) : 0;
  const double share = step_s / kPeakDuration_s;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const LookPoint& point = points[i];
    const double value = i < at_point.size() ? at_point[i] : ValueAt(point, values);
    const double exponent = rho_ * counted(value);
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
  slopes_.clear();
  double highest = -std::numeric_limits<double>::infinity();
  const auto exponent_of = [&](const ActiveContact<Plane>& contact) {
    return rho_ * (contact.depth_m / usable_m_ - least());
  };
  for (const auto& contact : active) highest = std::max(highest, exponent_of(contact));
  if (highest < kNegligibleExponent) return 0;  // the usual
  slopes_.assign(active.size(), 0.0);
  // The sum and its terms are scaled by exp(-largest).
  const double largest = std::max(0.0, highest);
  double others = 0;
  for (std::size_t i = 0; i < active.size(); ++i) {
    const double exponent = exponent_of(active[i]);
    if (exponent < kNegligibleExponent) continue;
    slopes_[i] = exponent == largest ? 1 : std::exp(exponent - largest);
    others += slopes_[i];
  }
  const double one = std::exp(-largest);
  for (double& slope : slopes_) slope /= (one + others) * usable_m_;
  if (largest == 0) return std::log1p(others) / rho_;
  return (largest + std::log(one + others)) / rho_;
}

}  // namespace tumbler
