#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
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

/// The near points of two shapes a and b, [AB04, Eqs. 10 and 23-25], with a signed distance.
///
/// The paper's p_rob and p_obs are p_a and p_b here. They lie on the surfaces: they are the near
/// points x_a and x_b of the two cores, moved by the swept radii along the normal. So the normal is
/// defined in penetration too, until the cores themselves overlap.
template <class Space>
struct NearPoints {
  using Vector = typename Space::Vector;
  static constexpr int kDimension = Vector::RowsAtCompileTime;

  Vector p_a, p_b;
  double d = 0;  ///< Distance [m], negative in penetration.
  Vector u_d;    ///< Unit normal, from b to a.
  /// Whether the cores overlap, so that no normal follows from the near points. Then d is minus the
  /// sum of the radii, u_d points from the centre of b to that of a (up, if they coincide), and p_a
  /// and p_b are one point.
  bool overlap = false;
  /// Whether the near points are unique. Between parallel edges or faces they are not; then those
  /// nearest to the centres of their cores are given (least sum of squares).
  bool unique = true;
  /// The active set, [AB04, Eq. 30], of each core's coordinates: -1 or +1 at that bound (and always
  /// where the extent is zero, an equality constraint), 0 between the bounds.
  std::array<std::int8_t, kDimension> active_a{}, active_b{};
  double core_distance_m = 0;  ///< |x_a - x_b|
};

/// Derivatives of near points when a is displaced and b stays: one entry for each basis motion of
/// the space about the origin of the coordinates in use. Those for a displacement of b follow from
/// them, since displacing both moves everything rigidly.
template <class Space>
struct NearPointsDerivative {
  static constexpr std::size_t kMotions = Space::kMotions;
  std::array<typename Space::Vector, kMotions> p_a, p_b, u_d;
  std::array<double, kMotions> d{};
};

/// The near points of two shapes, at most one of them a half-space: [AB04, Eqs. 23-25] as the
/// bounded least squares problem in the coordinates of both cores. Exact to rounding, no heap.
template <class Space>
NearPoints<Space> FindNearPoints(const PosedShape<Space>& a, const PosedShape<Space>& b);

/// The derivatives of near points by the Kuhn-Tucker system, [AB04, Eqs. 28-32]. With x = (x_a,
/// x_b), f = |x_a - x_b|^2, and one row (K x + b = 0, or D x + b = 0) for every constraint that
/// holds with equality,
///
///   H (x, lambda, mu) = [ Q K^T D^T; K 0 0; D 0 0 ] (x, lambda, mu) = (0, -b_1, -b_2)       (31)
///   d(x, lambda, mu) = H^-1 ( (0, -db_1, -db_2) - dH (x, lambda, mu) )                      (32)
///
/// The paper prints +b on the right side of (31), which contradicts its own (26) and (29).
///
/// In two cases there is no derivative, and the result is a substitute: where the near points are
/// not unique, H is singular, and the least of all solutions is taken; where the cores overlap, the
/// normal stays and a's point moves with a. No heap.
template <class Space>
NearPointsDerivative<Space> DifferentiateNearPoints(const PosedShape<Space>& a,
                                                    const PosedShape<Space>& b,
                                                    const NearPoints<Space>& near);

}  // namespace tumbler
