#include "common/files/primitive_limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "common/files/toml_reader.h"

namespace tumbler {

std::string ToText(const Bound& bound) {
  const bool above = bound.path.max > bound.max;
  const auto [value, allowed] =
      DistinctNumbers(above ? bound.path.max : bound.path.min, above ? bound.max : bound.min);
  return fmt::format("{} is {} {} at {:.3g} s; allowed: {} {} {}", bound.name, value, bound.unit,
                     above ? bound.path.max_at_s : bound.path.min_at_s,
                     above ? "<=" : ">=", allowed, bound.unit);
}

namespace {

template <typename Ranges>
LimitMargins SmallestMargins(const Primitive<double>& primitive, Ranges ranges) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::array<double, 4> margins = {kNone, kNone, kNone, kNone};
  for (const JointMotion<double>& motion : primitive.motions()) {
    const auto bounds = BoundsOf(motion, motion.limits);
    const std::array<Interval<double>, 4> reached = ranges(motion, bounds);
    for (std::size_t i = 0; i < bounds.size(); ++i) {
      margins[i] =
          std::min({margins[i], reached[i].min - bounds[i].min, bounds[i].max - reached[i].max});
    }
  }
  return {margins[0], margins[1], margins[2], margins[3]};
}

}  // namespace

LimitMargins MarginsOf(const Primitive<double>& primitive) {
  return SmallestMargins(primitive, [](const auto& /*motion*/, const auto& bounds) {
    std::array<Interval<double>, 4> reached;
    for (std::size_t i = 0; i < bounds.size(); ++i)
      reached[i] = {bounds[i].path.min, bounds[i].path.max};
    return reached;
  });
}

LimitMargins HullMarginsOf(const Primitive<double>& primitive) {
  return SmallestMargins(primitive, [](const auto& motion, const auto& /*bounds*/) {
    return std::array{motion.position.Bounds(0), motion.position.Bounds(1),
                      motion.position.Bounds(2), motion.torque.Bounds(0)};
  });
}

}  // namespace tumbler
