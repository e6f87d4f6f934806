#include "offline/scene/look_points.h"

#include <algorithm>
#include <cmath>

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
  constexpr std::size_t kGroup = StepPoints::kGroup;
  for (std::size_t count = 1; count <= by_count_.size(); ++count) {
    StepPoints& points = by_count_[count - 1];
    const std::size_t size = count * kGaussPoint.size();
    points.groups.resize((size + kGroup - 1) / kGroup);
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t part = i / kGaussPoint.size(), k = i % kGaussPoint.size();
      const double at = (static_cast<double>(part) + kGaussPoint[k]) / static_cast<double>(count);
      std::array<double, Tableau::kMaxStages> weight{};
      if (&scheme == &kClassical) {
        Interpolate<3>({0, 1, 3}, scheme, at, weight);
        // Errors of the two stages in the middle are opposite.
        weight[1] /= 2;
        weight[2] = weight[1];
      } else {
        Interpolate<5>({0, 2, 3, 4, 5}, scheme, at, weight);
      }
      StepPoints::Group& group = points.groups[i / kGroup];
      group.part[i % kGroup] = kGaussWeight[k] / static_cast<double>(count);
      double sum = 0;
      for (std::size_t s = 0; s < weight.size(); ++s) {
        group.of_stage[s][i % kGroup] = weight[s];
        sum += std::abs(weight[s]);
      }
      points.growth = std::max(points.growth, sum * (1 + 1e-12));  // for rounding
    }
  }
}

const StepPoints& LookPoints::In(double step_s) const {
  return by_count_[std::min(PartsOf(step_s), by_count_.size()) - 1];
}

const StepPoints& LookPoints::Start() {
  static const StepPoints start = [] {
    StepPoints points{{StepPoints::Group{}}};
    points.groups[0].of_stage[0][0] = points.groups[0].part[0] = 1;
    return points;
  }();
  return start;
}

}  // namespace tumbler
