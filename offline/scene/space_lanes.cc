#include "offline/scene/space_lanes.h"

#include <fmt/format.h>

#include <stdexcept>

#include "common/core/index.h"
#include "offline/model/contact_shape.h"

namespace tumbler {
namespace in_space {
namespace {

std::array<double, 3> Numbers(const SpaceVector& v) { return {v.x(), v.y(), v.z()}; }

void AddBodies(const SpaceRobot& robot, const LaneDrive& drive, SpaceLaneScene& lanes) {
  RequireLaneRoom(robot.joint_count(), SpaceLaneModel::kMaxJoints, "joints");
  const std::size_t first = Index(robot.first_body());
  lanes.model.joints = robot.joint_count();
  for (std::size_t i = 0; i <= lanes.model.joints; ++i) {
    const Dof<Spatial>& dof = robot.tree.dofs[first + i];
    const SpaceMatrix& I = dof.inertia_kg_m2;
    lanes.robot.bodies[i] = {Numbers(dof.offset),
                             dof.mass_kg,
                             Numbers(dof.mass_centre),
                             {I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)}};
    if (i == 0) continue;
    if (dof.kind != JointKind::kRevolute) {
      throw std::invalid_argument(
          fmt::format("the joint '{}' is prismatic; lanes have revolute joints only", dof.name));
    }
    lanes.model.axis[i] = Numbers(dof.axis);
    lanes.model.parent[i] = Index(dof.parent) - first;
    lanes.robot.joints[i - 1] =
        MakeLaneJoint(dof.rotor_inertia_kg_m2, dof.damping_nm_s_per_rad,
                      robot.dry_friction_nm[first + i], robot.limits[first + i], drive);
  }
}

void AddPoints(const SpaceRobot& robot, SpaceLaneScene& lanes) {
  const std::size_t first = Index(robot.first_body());
  for (std::size_t body = 0; body <= lanes.model.joints; ++body) {
    lanes.model.first_point[body] = lanes.model.points;
    for (const ContactShape<Spatial>& shape : robot.shapes) {
      if (Index(shape.body) != first + body) continue;
      for (const SpaceVector& vertex : CoreVertices(shape.shape)) {
        RequireLaneRoom(lanes.model.points + 1, SpaceLaneModel::kMaxPoints, "contact points");
        lanes.robot.points[lanes.model.points++] = {Numbers(vertex), shape.shape.radius_m};
      }
    }
  }
  lanes.model.first_point[lanes.model.joints + 1] = lanes.model.points;
}

void AddGrounds(const SpaceScene& scene, SpaceLaneScene& lanes) {
  for (const Obstacle<Spatial>& obstacle : scene.obstacles) {
    if (!obstacle.shape.half_space) {
      throw std::invalid_argument(fmt::format(
          "the obstacle '{}' is no half-space; in space lanes have these only", obstacle.name));
    }
    RequireLaneRoom(lanes.model.grounds + 1, SpaceLaneModel::kMaxGrounds, "half-spaces");
    const SpaceVector& normal = obstacle.shape.normal;
    lanes.robot.grounds[lanes.model.grounds++] = {Numbers(normal),
                                                  normal.dot(obstacle.shape.centre)};
  }
}

}  // namespace
}  // namespace in_space

SpaceLaneScene MakeLaneScene(const SpaceScene& scene, const LaneDrive& drive) {
  if (!scene.motors.empty()) {
    throw std::invalid_argument(
        "the task gives its motors friction or a torque-speed curve; lanes in space have neither: "
        "leave out [motor]");
  }
  SpaceLaneScene lanes;
  in_space::AddBodies(scene.robot, drive, lanes);
  in_space::AddPoints(scene.robot, lanes);
  in_space::AddGrounds(scene, lanes);
  SetContact(scene.contact, lanes);
  lanes.robot.gravity = in_space::Numbers(scene.robot.tree.gravity);
  lanes.robot.push = {};
  return lanes;
}

}  // namespace tumbler
