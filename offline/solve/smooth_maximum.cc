#include "offline/solve/smooth_maximum.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "common/core/functions.h"
#include "offline/model/plane.h"
#include "offline/model/spatial.h"

namespace tumbler {
namespace {

using AtPoints = StepPoints::AtPoints;

/// The values at a group's points, of those at the stages.
AtPoints ValuesAt(const StepPoints::Group& group, std::span<const double> values) {
  AtPoints sum{};
  for (std::size_t s = 0; s < values.size(); ++s) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += group.of_stage[s][i] * values[s];
  }
  return sum;
}

/// The largest of values at points, and at least 0.
double LargestOf(const AtPoints& at_point, bool of_size) {
  AtPoints counted = at_point;
  if (of_size) {
    for (double& value : counted) value = std::abs(value);
  }
  double largest = 0;
  for (const double value : counted) largest = std::max(largest, value);
  return largest;
}

}  // namespace

void SmoothMaximum::Expect(const StepPoints& points, std::span<const double> values) {
  for (const StepPoints::Group& group : points.groups)
    expected_ = std::max(expected_, LargestOf(ValuesAt(group, values), of_ == Of::kSize));
}

double SmoothMaximum::Add(const StepPoints& points, double step_s, std::span<const double> values,
                          std::span<double> slopes) {
  std::fill(slopes.begin(), slopes.end(), 0.0);
  const double before = largest_;
  const bool of_size = of_ == Of::kSize;
  // Most steps have one group.
  const std::span<const StepPoints::Group> groups = points.groups;
  const AtPoints first = ValuesAt(groups[0], values);
  largest_ = std::max(largest_, LargestOf(first, of_size));
  for (const StepPoints::Group& group : groups.subspan(1))
    largest_ = std::max(largest_, LargestOf(ValuesAt(group, values), of_size));
  const double shrink = largest_ == before ? 1 : portable::Exp(rho_ * (before - largest_));
  sum_ *= shrink;
  const double share = step_s / kPeakDuration_s;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const AtPoints at_point = g == 0 ? first : ValuesAt(groups[g], values);
    if (of_size) {
      AddGroup<Of::kSize>(groups[g], at_point, share, slopes);
    } else {
      AddGroup<Of::kAboveZero>(groups[g], at_point, share, slopes);
    }
  }
  return shrink;
}

template <SmoothMaximum::Of kOf>
void SmoothMaximum::AddGroup(const StepPoints::Group& group, const AtPoints& at_point, double share,
                             std::span<double> slopes) {
  const double rho = rho_, top = rho * largest_, least = LeastExponent();
  const double unit = kOf == Of::kAboveZero ? portable::Exp(-top) : 0;
  double sum = sum_;
  AtPoints by_value{};
  for (std::size_t i = 0; i < at_point.size(); ++i) {
    const double value = at_point[i];
    const double exponent = rho * (kOf == Of::kSize ? std::abs(value) : std::max(0.0, value));
    if (exponent < least) continue;
    const double power = portable::Exp(exponent - top), part = share * group.part[i];
    double term = power;
    // The difference of two numbers near one would be rounding.
    if (kOf == Of::kAboveZero)
      term = exponent < 1 ? portable::Expm1(exponent) * unit : power - unit;
    sum += part * term;
    if (kOf == Of::kAboveZero && value <= 0) continue;
    by_value[i] = part * power;
  }
  sum_ = sum;
  if (slopes.empty()) return;
  for (std::size_t i = 0; i < by_value.size(); ++i)
    by_value[i] = std::copysign(by_value[i], at_point[i]);
  for (std::size_t s = 0; s < slopes.size(); ++s) {
    for (std::size_t i = 0; i < by_value.size(); ++i)
      slopes[s] += group.of_stage[s][i] * by_value[i];
  }
}

double SmoothMaximum::value() const { return largest_ + portable::Log(sum_) / rho_; }

template <class Space>
double SmoothDepth::Evaluate(std::span<const ActiveContact<Space>> active) {
  slopes_.clear();
  double highest = -std::numeric_limits<double>::infinity();
  const auto exponent_of = [&](const ActiveContact<Space>& contact) {
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
    slopes_[i] = exponent == largest ? 1 : portable::Exp(exponent - largest);
    others += slopes_[i];
  }
  const double one = portable::Exp(-largest);
  for (double& slope : slopes_) slope /= (one + others) * usable_m_;
  if (largest == 0) return portable::Log1p(others) / rho_;
  return (largest + portable::Log(one + others)) / rho_;
}

template double SmoothDepth::Evaluate(std::span<const ActiveContact<Plane>> active);
template double SmoothDepth::Evaluate(std::span<const ActiveContact<Spatial>> active);

}  // namespace tumbler
