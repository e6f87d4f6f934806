#pragma once

#include <optional>
#include <vector>

#include "offline/model/plane.h"
#include "offline/model/shape.h"

namespace tumbler {

/// The outline of a shape of the plane, for pictures: a convex polygon with a radius swept around
/// it. One corner makes a disc, two make a capsule.
struct Outline {
  std::vector<Plane::Vector> corners;  ///< Counter-clockwise [m].
  double radius_m = 0;
};

/// A half-space is drawn 2 km wide and 1 km deep, which is beyond every view.
Outline OutlineOf(const Shape<Plane>& shape);

/// The height z [m] of level ground: of a half-space whose normal points up.
std::optional<double> LevelHeight(const Shape<Plane>& shape);

}  // namespace tumbler
