#include "offline/model/contact_shapes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "offline/model/plane.h"
#include "offline/model/robot.h"
#include "offline/model/spatial.h"

namespace tumbler {
namespace {

const char* const kShortCylinder =
    "is a cylinder shorter than wide, which no capsule stands for; use a sphere or a box";

/// Thrown when the contact model cannot use a shape; says why.
struct Unusable : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The rotation of the plane that takes x to `direction`.
Plane::Rotation Towards(const Plane::Vector& direction) {
  const double length = direction.norm();
  return {direction.x() / length, direction.y() / length};
}

double CapsuleHalfLength(const RobotShape& shape) {
  const double half = shape.length_m / 2 - shape.radius_m;
  if (half < 0) throw Unusable(kShortCylinder);
  return half;
}

Shape<Spatial> InSpace(const RobotShape& shape) {
  const SpaceVector& centre = shape.pose.translation;
  const SpaceMatrix& axes = shape.pose.rotation;
  switch (shape.kind) {
    case RobotShape::Kind::kSphere:
      return Shape<Spatial>::Sphere(centre, shape.radius_m);
    case RobotShape::Kind::kCylinder: {
      // A capsule lies along its first axis, a cylinder along its third.
      const SpaceMatrix turned(axes.col(2), axes.col(0), axes.col(1));
      return Shape<Spatial>::Capsule(centre, {turned}, CapsuleHalfLength(shape), shape.radius_m);
    }
    case RobotShape::Kind::kBox:
      return Shape<Spatial>::Box(centre, {axes}, shape.size_m / 2);
    case RobotShape::Kind::kMesh:
      break;
  }
  throw Unusable("is a mesh");
}

Shape<Plane> InThePlane(const RobotShape& shape) {
  const Plane::Vector centre = InPlane(shape.pose.translation);
  const SpaceMatrix& axes = shape.pose.rotation;
  switch (shape.kind) {
    case RobotShape::Kind::kSphere:
      return Shape<Plane>::Sphere(centre, shape.radius_m);
    case RobotShape::Kind::kCylinder: {
      const Plane::Vector along = InPlane(axes.col(2));
      if (along.norm() < kPlaneTolerance) return Shape<Plane>::Sphere(centre, shape.radius_m);
      return Shape<Plane>::Capsule(centre, Towards(along), CapsuleHalfLength(shape) * along.norm(),
                                   shape.radius_m);
    }
    case RobotShape::Kind::kBox:
      for (int across = 0; across < 3; ++across) {
        if (InPlane(axes.col(across)).norm() > kPlaneTolerance) continue;
        const int first = (across + 1) % 3, second = (across + 2) % 3;
        return Shape<Plane>::Box(centre, Towards(InPlane(axes.col(first))),
                                 {shape.size_m[first] / 2, shape.size_m[second] / 2});
      }
      throw Unusable("is a box without a side along y");
    case RobotShape::Kind::kMesh:
      break;
  }
  throw Unusable("is a mesh");
}

template <class Space, class Convert>
ContactShapes<Space> ConvertAll(const Robot& robot, const Convert& convert) {
  ContactShapes<Space> out;
  for (const RobotShape& shape : robot.collision_shapes) {
    try {
      if (shape.body < 0) throw Unusable("is fixed to the world");
      out.shapes.push_back({shape.name, shape.body, convert(shape)});
    } catch (const Unusable& why) {
      out.ignored.push_back({shape.link, shape.name, shape.line, why.what(),
                             shape.kind == RobotShape::Kind::kMesh && shape.body >= 0});
    }
  }
  return out;
}

/// A box in the plane with a side along `u` that a shape's outline lies in: a cylinder's or a
/// box's. It is the outline itself where one of the shape's axes is across the plane.
Shape<Plane> OutlineBox(const RobotShape& shape, const Plane::Vector& u) {
  const Plane::Vector w(-u.y(), u.x());
  const SpaceMatrix& axes = shape.pose.rotation;
  const auto reach = [&](const Plane::Vector& direction) {
    const auto along = [&](int axis) { return InPlane(axes.col(axis)).dot(direction); };
    if (shape.kind == RobotShape::Kind::kCylinder) {
      return std::abs(along(2)) * shape.length_m / 2 +
             portable::Length(along(0), along(1)) * shape.radius_m;
    }
    double sum = 0;
    for (int axis = 0; axis < 3; ++axis) sum += std::abs(along(axis)) * shape.size_m[axis] / 2;
    return sum;
  };
  return Shape<Plane>::Box(InPlane(shape.pose.translation), Towards(u), {reach(u), reach(w)});
}

/// As InThePlane, and what that cannot use in a box that is around it: what is to stay apart is at
/// least as large as the robot has it.
Shape<Plane> AroundInThePlane(const RobotShape& shape) {
  try {
    return InThePlane(shape);
  } catch (const Unusable&) {
    if (shape.kind == RobotShape::Kind::kMesh) throw;
    // Along the axis of a cylinder, or that of a box which is nearest to the plane.
    Plane::Vector along = InPlane(shape.pose.rotation.col(2));
    for (int axis = 0; axis < 2 && shape.kind == RobotShape::Kind::kBox; ++axis) {
      const Plane::Vector other = InPlane(shape.pose.rotation.col(axis));
      if (other.norm() > along.norm()) along = other;
    }
    return OutlineBox(shape, along / along.norm());
  }
}

/// Half of the width of a shape along y.
double HalfWidth(const RobotShape& shape) {
  const SpaceMatrix& axes = shape.pose.rotation;
  switch (shape.kind) {
    case RobotShape::Kind::kSphere:
      return shape.radius_m;
    case RobotShape::Kind::kCylinder:
      return std::abs(axes(1, 2)) * shape.length_m / 2 +
             portable::Length(axes(1, 0), axes(1, 1)) * shape.radius_m;
    case RobotShape::Kind::kBox:
      return SpaceVector(std::abs(axes(1, 0)), std::abs(axes(1, 1)), std::abs(axes(1, 2)))
                 .dot(shape.size_m) /
             2;
    case RobotShape::Kind::kMesh:
      break;
  }
  throw Unusable("is a mesh");
}

/// Where the origin of a body's frame is along y. Joints of a robot in the plane never change it.
double AcrossThePlane(const Robot& robot, int body) {
  double y = 0;
  for (; body >= 0; body = robot.tree.dofs[Index(body)].parent)
    y += robot.tree.dofs[Index(body)].offset.y();
  return y;
}

void AddOwnShapes(const Robot& robot, bool drawn, std::vector<OwnShape>& shapes) {
  const std::size_t known = shapes.size();
  for (const RobotShape& shape : drawn ? robot.visual_shapes : robot.collision_shapes) {
    if (shape.mesh_point) continue;
    OwnShape own{shape.name, shape.link, shape.body, {}, 0, 0, drawn};
    try {
      own.shape = AroundInThePlane(shape);
      const double half_width = HalfWidth(shape);
      const double y = AcrossThePlane(robot, shape.body) + shape.pose.translation.y();
      own.y_min_m = y - half_width;
      own.y_max_m = y + half_width;
    } catch (const Unusable&) {
      continue;
    }
    if (drawn) own.name.insert(own.link.size(), "/visual");
    const auto end = shapes.begin() + static_cast<std::ptrdiff_t>(known);
    const bool copy = drawn && std::any_of(shapes.begin(), end, [&own](const OwnShape& other) {
                        return other.body == own.body && other.shape == own.shape &&
                               other.y_min_m == own.y_min_m && other.y_max_m == own.y_max_m;
                      });
    if (!copy) shapes.push_back(std::move(own));
  }
}

}  // namespace

ContactShapes<Spatial> SpatialContactShapes(const Robot& robot) {
  return ConvertAll<Spatial>(robot, InSpace);
}

ContactShapes<Plane> PlanarContactShapes(const Robot& robot) {
  return ConvertAll<Plane>(robot, InThePlane);
}

std::optional<Shape<Spatial>> SpatialOutline(const RobotShape& shape) {
  if (shape.kind == RobotShape::Kind::kMesh) return std::nullopt;
  try {
    return InSpace(shape);
  } catch (const Unusable&) {
    const double r = shape.radius_m;
    return Shape<Spatial>::Box(shape.pose.translation, {shape.pose.rotation},
                               {r, r, shape.length_m / 2});
  }
}

std::optional<Shape<Plane>> PlanarOutline(const RobotShape& shape) {
  if (shape.kind == RobotShape::Kind::kMesh) return std::nullopt;
  return AroundInThePlane(shape);
}

std::vector<OwnShape> PlanarOwnShapes(const Robot& robot) {
  std::vector<OwnShape> shapes;
  AddOwnShapes(robot, false, shapes);
  AddOwnShapes(robot, true, shapes);
  return shapes;
}

}  // namespace tumbler
