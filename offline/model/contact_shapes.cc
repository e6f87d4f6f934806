#include "offline/model/contact_shapes.h"

#include <fmt/format.h>

#include <stdexcept>

#include "offline/dynamics/plane.h"
#include "offline/dynamics/spatial.h"
#include "offline/model/robot.h"

namespace tumbler {
namespace {

const char* const kShortCylinder =
    "is a cylinder shorter than wide, which no capsule stands for; use a sphere or a box";

/// Thrown when the contact model cannot use a shape; says why.
struct Unusable : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The rotation of the plane that takes x to `direction`.
Plane::Rotation Towards(const Eigen::Vector2d& direction) {
  const double length = direction.norm();
  return {direction.x() / length, direction.y() / length};
}

double CapsuleHalfLength(const RobotShape& shape) {
  const double half = shape.length_m / 2 - shape.radius_m;
  if (half < 0) throw Unusable(kShortCylinder);
  return half;
}

Shape<Spatial> InSpace(const RobotShape& shape) {
  const Eigen::Vector3d centre = shape.pose.translation();
  const Eigen::Matrix3d axes = shape.pose.linear();
  switch (shape.kind) {
    case RobotShape::Kind::kSphere:
      return Shape<Spatial>::Sphere(centre, shape.radius_m);
    case RobotShape::Kind::kCylinder: {
      Eigen::Matrix3d turned;  // A capsule lies along its first axis, a cylinder along its third.
      turned << axes.col(2), axes.col(0), axes.col(1);
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
  const Eigen::Vector2d centre = InPlane(shape.pose.translation());
  const Eigen::Matrix3d axes = shape.pose.linear();
  switch (shape.kind) {
    case RobotShape::Kind::kSphere:
      return Shape<Plane>::Sphere(centre, shape.radius_m);
    case RobotShape::Kind::kCylinder: {
      const Eigen::Vector2d along = InPlane(axes.col(2));
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
      out.ignored.push_back(
          {shape.link, shape.line, fmt::format("collision shape {} {}", shape.name, why.what())});
    }
  }
  return out;
}

}  // namespace

ContactShapes<Spatial> SpatialContactShapes(const Robot& robot) {
  return ConvertAll<Spatial>(robot, InSpace);
}

ContactShapes<Plane> PlanarContactShapes(const Robot& robot) {
  return ConvertAll<Plane>(robot, InThePlane);
}

}  // namespace tumbler
