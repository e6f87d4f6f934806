#include "common/primitive_limits.h"

#include <algorithm>
#include <limits>

namespace tumbler {
namespace {

double MarginOf(const Bound<double>& bound) {
  double margin = std::numeric_limits<double>::infinity();
  for (const double point : bound.points) {
    margin = std::min({margin, point - bound.min, bound.max - point});
  }
  return margin;
}

}  // namespace

LimitMargins MarginsOf(const Primitive<double>& primitive) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::array<double, 4> margins = {kNone, kNone, kNone, kNone};
  for (const JointMotion<double>& motion : primitive.motions()) {
    const auto bounds = BoundsOf(motion);
    for (std::size_t i = 0; i < bounds.size(); ++i)
      margins[i] = std::min(margins[i], MarginOf(bounds[i]));
  }
  return {margins[0], margins[1], margins[2], margins[3]};
}

}  // namespace tumbler
