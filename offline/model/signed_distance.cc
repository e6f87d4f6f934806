#include "offline/model/signed_distance.h"

#include <cmath>
#include <limits>

#include "offline/model/near_points.h"

namespace tumbler {
namespace {

using Vector = Plane::Vector;

/// The vertex of a core that is farthest along a direction.
Vector Farthest(const PosedShape<Plane>& shape, const Vector& direction) {
  Vector vertex = shape.centre;
  for (int i = 0; i < 2; ++i) {
    const Vector& axis = shape.axis(i);
    vertex += std::copysign(shape.half_extents[i], axis.dot(direction)) * axis;
  }
  return vertex;
}

/// The distance of two cores that overlap. The shortest way apart is across a side of one of them,
/// so that its direction is an axis of that core.
SignedDistance FindOverlap(const PosedShape<Plane>& a, const PosedShape<Plane>& b) {
  SignedDistance best;
  best.d = -std::numeric_limits<double>::infinity();
  for (const PosedShape<Plane>* side : {&a, &b}) {
    for (int i = 0; i < 2; ++i) {
      Vector u = side->axis(i);
      if (u.dot(a.centre - b.centre) < 0) u = -u;
      const Vector on_a = Farthest(a, -u), on_b = Farthest(b, u);
      const double d = u.dot(on_a - on_b);
      // The vertex of the other core slides along this side, and the side's direction turns.
      if (d > best.d) best = {d, u, side == &a ? on_b : on_a};
    }
  }
  return best;
}

}  // namespace

SignedDistance FindSignedDistance(const PosedShape<Plane>& a, const PosedShape<Plane>& b) {
  const double radii = a.radius_m + b.radius_m;
  if (a.half_extents == Vector::Zero() && b.half_extents == Vector::Zero()) {
    const Vector between = a.centre - b.centre;
    const double length = between.norm();
    if (length == 0) return {-radii, Vector::UnitY(), a.centre};
    return {length - radii, between / length, a.centre};
  }
  const NearPoints<Plane> near = FindNearPoints(a, b);
  if (!near.overlap) return {near.d, near.u_d, near.p_a};
  SignedDistance crossing = FindOverlap(a, b);
  crossing.d -= radii;
  return crossing;
}

}  // namespace tumbler
