#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "common/core/scalar.h"

namespace tumbler {

enum class ShapeKind { kHalfSpace, kSphere, kCapsule, kBox };

/// A shape of the contact model, in the frame of the body that carries it: a half-space, or a
/// convex core given by linear constraints [AB04, Eqs. 26-27] with a radius swept around it.
///
/// The core is a box with half extents h_i >= 0 along its own axes. If all of them are zero the
/// shape is a sphere (a disc in the plane), if one is above zero a capsule, and else a box, rounded
/// if the radius is not zero.
template <class Space>
struct Shape {
  using Vector = typename Space::Vector;
  static constexpr int kDimension = Vector::RowsAtCompileTime;

  Vector centre = Vector::Zero();        ///< Of the core, or a point of a half-space's surface [m].
  typename Space::Rotation rotation;     ///< Of the core's axes.
  Vector half_extents = Vector::Zero();  ///< h of the core [m].
  double radius_m = 0;                   ///< Swept around the core.
  bool half_space = false;
  Vector normal = Vector::Zero();  ///< Of a half-space: a unit vector out of it. Else zero.

  bool operator==(const Shape&) const = default;

  [[nodiscard]] ShapeKind kind() const {
    if (half_space) return ShapeKind::kHalfSpace;
    int sides = 0;
    for (int i = 0; i < kDimension; ++i) sides += half_extents[i] > 0 ? 1 : 0;
    return sides == 0 ? ShapeKind::kSphere : sides == 1 ? ShapeKind::kCapsule : ShapeKind::kBox;
  }

  /// @param point      any point of the surface [m].
  /// @param direction  out of the half-space; need not be a unit vector, but must not be zero.
  static Shape HalfSpace(const Vector& point, const Vector& direction) {
    Shape shape;
    shape.half_space = true;
    shape.centre = point;
    shape.normal = direction.normalized();
    return shape;
  }
  static Shape Sphere(const Vector& centre, double radius_m) {
    Shape shape;
    shape.centre = centre;
    shape.radius_m = radius_m;
    return shape;
  }
  /// A capsule around a segment of that half length along the first axis of `rotation`.
  static Shape Capsule(const Vector& centre, const typename Space::Rotation& rotation,
                       double half_length_m, double radius_m) {
    Shape shape = Sphere(centre, radius_m);
    shape.rotation = rotation;
    shape.half_extents[0] = half_length_m;
    return shape;
  }
  static Shape Box(const Vector& centre, const typename Space::Rotation& rotation,
                   const Vector& half_extents) {
    Shape shape;
    shape.centre = centre;
    shape.rotation = rotation;
    shape.half_extents = half_extents;
    return shape;
  }
};

/// The vertices of a shape's core: its corners, ends or centre.
/// @pre the shape is no half-space.
template <class Space>
std::vector<typename Space::Vector> CoreVertices(const Shape<Space>& shape) {
  using Vector = typename Space::Vector;
  std::vector<Vector> vertices = {shape.centre};
  for (int i = 0; i < Shape<Space>::kDimension; ++i) {
    if (shape.half_extents[i] == 0) continue;
    const Vector side = shape.rotation * Vector(shape.half_extents[i] * Vector::Unit(i));
    const std::vector<Vector> middles = std::exchange(vertices, {});
    for (const Vector& middle : middles) {
      vertices.push_back(middle + side);
      vertices.push_back(middle - side);
    }
  }
  return vertices;
}

/// The vector to a point from the nearest point of a core, in the core's axes: zero inside of it.
/// Vector has numbers of any kind, one robot's or those of robots in lanes.
template <int kDimension, class Vector>
[[gnu::always_inline]] inline Vector FromCore(const Vector& point, const Vector& half_extents) {
  using S = std::decay_t<decltype(point[0])>;
  Vector from;
  for (int i = 0; i < kDimension; ++i) {
    const S c = point[i], h = half_extents[i];
    from[i] = c - Clamp(c, -h, h);
  }
  return from;
}

/// The side of a core that is nearest to a point inside of it.
template <class Vector, class S>
struct CoreSide {
  Vector out;  ///< Unit vector out of the core through that side, in the core's axes.
  S depth;     ///< Distance of the point from that side [m].
};

/// Of sides that are equally near the core's last axis wins.
template <int kDimension, class Vector>
[[gnu::always_inline]] inline auto NearestSide(const Vector& point, const Vector& half_extents) {
  using S = std::decay_t<decltype(point[0])>;
  CoreSide<Vector, S> side;
  for (int i = kDimension - 1; i >= 0; --i) {
    const S c = point[i];
    const S depth = half_extents[i] - Max(c, -c);
    const S out = Select(c < S(0), S(-1), S(1));
    if (i == kDimension - 1) {
      side.depth = depth;
      side.out[i] = out;
      continue;
    }
    const auto nearer = depth < side.depth;
    side.depth = Select(nearer, depth, side.depth);
    side.out[i] = Select(nearer, out, S(0));
    for (int k = i + 1; k < kDimension; ++k) side.out[k] = Select(nearer, S(0), S(side.out[k]));
  }
  return side;
}

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
  if constexpr (kDimension > 2) near.edge = Space::Vector::Zero();
  const Vector c = obstacle.rotation.Inverse(centre - obstacle.centre);
  const Vector from = FromCore<kDimension>(c, obstacle.half_extents);
  const double length = from.norm();
  if (length > 0) {
    near.d = length - obstacle.radius_m - radius_m;
    near.u_d = obstacle.rotation * Vector(from / length);
    int free = -1;
    int free_count = 0;
    for (int i = 0; i < kDimension; ++i) {
      if (!(std::abs(c[i]) < obstacle.half_extents[i])) continue;
      free = i;
      ++free_count;
    }
    if (free_count < kDimension - 1) {
      near.curvature_per_m = 1 / length;
      if constexpr (kDimension > 2) {
        if (free_count == 1) near.edge = obstacle.rotation * Vector(Vector::Unit(free));
      }
    }
    return near;
  }
  const auto side = NearestSide<kDimension>(c, obstacle.half_extents);
  near.d = -side.depth - obstacle.radius_m - radius_m;
  near.u_d = obstacle.rotation * side.out;
  return near;
}

/// The near point of a sphere with this centre and radius, and an obstacle of any shape. That of a
/// half-space takes few instructions, fewer than a call.
template <class Space>
[[gnu::always_inline]] inline NearPoint<Space> FindNearPoint(const Shape<Space>& obstacle,
                                                             const typename Space::Vector& centre,
                                                             double radius_m) {
  if (!obstacle.half_space) return FindNearPointOfCore(obstacle, centre, radius_m);
  NearPoint<Space> near;
  if constexpr (Shape<Space>::kDimension > 2) near.edge = Space::Vector::Zero();
  near.d = obstacle.normal.dot(centre - obstacle.centre) - radius_m;
  near.u_d = obstacle.normal;
  return near;
}

/// A shape in world axes, where its body has put it.
template <class Space>
struct PosedShape {
  using Vector = typename Space::Vector;
  static constexpr int kDimension = Vector::RowsAtCompileTime;

  Vector centre;
  IntArray<Vector, kDimension> axes;  ///< Of the core.
  Vector half_extents;
  double radius_m = 0;
  bool half_space = false;
  Vector normal;

  /// The shape of a body with rotation R and origin p.
  static PosedShape Of(const Shape<Space>& shape, const typename Space::Rotation& R,
                       const Vector& p) {
    PosedShape posed;
    posed.centre = p + R * shape.centre;
    const typename Space::Rotation axes = R * shape.rotation;
    for (int i = 0; i < kDimension; ++i) posed.axes[i] = axes * Vector(Vector::Unit(i));
    posed.half_extents = shape.half_extents;
    posed.radius_m = shape.radius_m;
    posed.half_space = shape.half_space;
    posed.normal = R * shape.normal;
    return posed;
  }
  [[nodiscard]] const Vector& axis(int i) const { return axes[i]; }
};

}  // namespace tumbler
