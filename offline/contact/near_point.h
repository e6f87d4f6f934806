#pragma once

#include <cmath>
#include <type_traits>

#include "offline/contact/shape.h"

namespace tumbler {

/// The near points of a sphere with an obstacle in closed form, which exists because the core of a
/// sphere is a point c. They are those of `FindNearPoints`, except inside the core of the obstacle:
/// there normal and distance are those of the core's nearest side, so that they are defined
/// everywhere.
template <class Space>
struct NearPoint {
  double d = 0;                ///< Distance between the surfaces [m], negative in penetration.
  typename Space::Vector u_d;  ///< Unit normal, from the obstacle to the sphere.
  /// du_d = curvature (I - u_d u_d^T - e e^T) dc for a motion dc of the sphere's centre.
  double curvature_per_m = 0;
  /// e: in space, the unit vector along the core's edge on which the near point is; zero where it
  /// is on a face or a vertex. The plane has no such edges.
  struct None {};
  using Edge = std::conditional_t<Shape<Space>::kDimension == 2, None, typename Space::Vector>;
  [[no_unique_address]] Edge edge{};
};

/// The near point of a sphere with a shape that is no half-space.
template <class Space>
NearPoint<Space> FindNearPointOfCore(const Shape<Space>& obstacle,
                                     const typename Space::Vector& centre, double radius_m) {
  using Vector = typename Space::Vector;
  constexpr int kDimension = Vector::RowsAtCompileTime;
  NearPoint<Space> near;
  if constexpr (kDimension > 2) near.edge.setZero();
  const Vector c = obstacle.rotation.Inverse(centre - obstacle.centre);
  Vector rest = c;  // from the core's nearest point
  int free = -1;
  int free_count = 0;
  for (int i = 0; i < kDimension; ++i) {
    const double h = obstacle.half_extents[i];
    if (std::abs(c[i]) < h) {
      rest[i] = 0;
      free = i;
      ++free_count;
    } else {
      rest[i] -= std::copysign(h, c[i]);
    }
  }
  const double length = rest.norm();
  if (length > 0) {
    near.d = length - obstacle.radius_m - radius_m;
    near.u_d = obstacle.rotation * Vector(rest / length);
    if (free_count < kDimension - 1) {
      near.curvature_per_m = 1 / length;
      if constexpr (kDimension > 2) {
        if (free_count == 1) near.edge = obstacle.rotation * Vector(Vector::Unit(free));
      }
    }
    return near;
  }
  // Inside the core the normal leads out through the nearest side. Of sides that are equally near
  // the core's last axis wins.
  int side = kDimension - 1;
  const auto depth = [&](int i) { return obstacle.half_extents[i] - std::abs(c[i]); };
  for (int i = kDimension - 1; i >= 0; --i) {
    if (depth(i) < depth(side)) side = i;
  }
  near.d = -depth(side) - obstacle.radius_m - radius_m;
  near.u_d = obstacle.rotation * Vector(std::copysign(1.0, c[side]) * Vector::Unit(side));
  return near;
}

/// The near point of a sphere with this centre and radius, and an obstacle of any shape.
template <class Space>
NearPoint<Space> FindNearPoint(const Shape<Space>& obstacle, const typename Space::Vector& centre,
                               double radius_m) {
  if (!obstacle.half_space) return FindNearPointOfCore(obstacle, centre, radius_m);
  NearPoint<Space> near;
  if constexpr (Shape<Space>::kDimension > 2) near.edge.setZero();
  near.d = obstacle.normal.dot(centre - obstacle.centre) - radius_m;
  near.u_d = obstacle.normal;
  return near;
}

}  // namespace tumbler
