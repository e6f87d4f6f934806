#include "offline/model/outline.h"

#include <algorithm>
#include <cmath>

#include "common/core/functions.h"

namespace tumbler {

Outline OutlineOf(const Shape<Plane>& shape) {
  if (shape.half_space) {
    constexpr double kFar = 1000;
    const Plane::Vector along = kFar * Plane::Vector(shape.normal.y(), -shape.normal.x());
    const Plane::Vector deep = -kFar * shape.normal;
    const Plane::Vector left = shape.centre - along, right = shape.centre + along;
    return {{left, left + deep, right + deep, right}, 0};
  }
  Outline outline{CoreVertices(shape), shape.radius_m};
  const auto angle = [&shape](const Plane::Vector& corner) {
    return portable::Atan2(corner.y() - shape.centre.y(), corner.x() - shape.centre.x());
  };
  std::ranges::sort(outline.corners, {}, angle);
  return outline;
}

std::optional<double> LevelHeight(const Shape<Plane>& shape) {
  constexpr double kLevel = 0.999999;
  if (!shape.half_space || shape.normal.y() <= kLevel) return std::nullopt;
  return shape.centre.y();
}

}  // namespace tumbler
