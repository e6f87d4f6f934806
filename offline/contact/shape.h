#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

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
    const auto sides = (half_extents.array() > 0).count();
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

/// A shape in world axes, where its body has put it.
template <class Space>
struct PosedShape {
  using Vector = typename Space::Vector;
  static constexpr int kDimension = Vector::RowsAtCompileTime;
  using Matrix = Eigen::Matrix<double, kDimension, kDimension>;

  Vector centre;
  Matrix axes;  ///< The core's axes are its columns.
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
    for (int i = 0; i < kDimension; ++i) posed.axes.col(i) = axes * Vector(Vector::Unit(i));
    posed.half_extents = shape.half_extents;
    posed.radius_m = shape.radius_m;
    posed.half_space = shape.half_space;
    posed.normal = R * shape.normal;
    return posed;
  }
};

}  // namespace tumbler
