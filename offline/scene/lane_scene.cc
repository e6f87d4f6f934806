#include "offline/scene/lane_scene.h"

#include <fmt/format.h>

#include <stdexcept>

#include "common/core/index.h"

namespace tumbler {
namespace {

void AddBodies(const PlanarRobot& robot, const LaneDrive& drive, LaneScene& lanes) {
  if (robot.root_dofs != 3) {
    throw std::invalid_argument("the robot's root is fixed; lanes need a planar one");
  }
  if (!robot.passive.empty()) {
    throw std::invalid_argument(
        fmt::format("the joint '{}' has no motor; lanes have one in every joint",
                    robot.tree.dofs[Index(robot.passive[0].dof)].name));
  }
  RequireLaneRoom(robot.joint_count(), LaneModel::kMaxJoints, "joints");
  lanes.model.joints = robot.joint_count();
  lanes.model.hinged = robot.hinged();
  lanes.robot.bar_friction = robot.tree.dofs[2].damping_nm_s_per_rad;
  for (std::size_t i = 0; i <= lanes.model.joints; ++i) {
    const Dof<Plane>& dof = robot.tree.dofs[i + 2];
    if (dof.kind != JointKind::kRevolute) {
      throw std::invalid_argument(
          fmt::format("the joint '{}' is prismatic; lanes have revolute joints only", dof.name));
    }
    auto& body = lanes.robot.bodies[i];
    body = {dof.offset.x(),      dof.offset.y(),      dof.mass_kg,
            dof.mass_centre.x(), dof.mass_centre.y(), dof.inertia_kg_m2};
    lanes.model.axis[i] = dof.axis;
    if (i == 0) continue;
    lanes.model.parent[i] = Index(dof.parent) - 2;
    lanes.robot.joints[i - 1] =
        MakeLaneJoint(dof.rotor_inertia_kg_m2, dof.damping_nm_s_per_rad,
                      robot.dry_friction_nm[i + 2], robot.limits[i + 2], drive);
  }
}

void AddPoints(const Scene& scene, LaneScene& lanes) {
  for (std::size_t body = 0; body <= lanes.model.joints; ++body) {
    lanes.model.first_point[body] = lanes.model.points;
    for (const ContactShape<Plane>& shape : scene.robot.shapes) {
      if (Index(shape.body) != body + 2) continue;
      for (const Plane::Vector& vertex : CoreVertices(shape.shape)) {
        RequireLaneRoom(lanes.model.points + 1, LaneModel::kMaxPoints, "contact points");
        lanes.model.point_body[lanes.model.points] = body;
        lanes.robot.points[lanes.model.points++] = {vertex.x(), vertex.y(), shape.shape.radius_m};
      }
    }
  }
  lanes.model.first_point[lanes.model.joints + 1] = lanes.model.points;
}

/// An obstacle that is no half-space. Its near point is that of a sphere.
void AddStone(const PlanarRobot& robot, const Obstacle<Plane>& obstacle, LaneScene& lanes) {
  for (const ContactShape<Plane>& shape : robot.shapes) {
    if (shape.shape.kind() == ShapeKind::kSphere) continue;
    throw std::invalid_argument(
        fmt::format("the obstacle '{}' is no half-space, and the robot's shape {} is no sphere; "
                    "lanes have one of the two only",
                    obstacle.name, shape.name));
  }
  RequireLaneRoom(lanes.model.stones + 1, LaneModel::kMaxStones,
                  "obstacles that are no half-spaces");
  const Shape<Plane>& shape = obstacle.shape;
  const Plane::Vector axis = shape.rotation * Plane::Vector(Plane::Vector::UnitX());
  lanes.robot.stones[lanes.model.stones++] = {
      shape.centre.x(),       shape.centre.y(),       axis.x(),      axis.y(),
      shape.half_extents.x(), shape.half_extents.y(), shape.radius_m};
}

void AddObstacles(const Scene& scene, LaneScene& lanes) {
  for (const Obstacle<Plane>& obstacle : scene.obstacles) {
    if (!obstacle.shape.half_space) {
      AddStone(scene.robot, obstacle, lanes);
      continue;
    }
    RequireLaneRoom(lanes.model.grounds + 1, LaneModel::kMaxGrounds, "half-spaces");
    const Plane::Vector& normal = obstacle.shape.normal;
    lanes.robot.grounds[lanes.model.grounds++] = {normal.x(), normal.y(),
                                                  normal.dot(obstacle.shape.centre)};
  }
}

}  // namespace

void RequireLaneRoom(std::size_t count, std::size_t room, const char* what) {
  if (count > room) {
    throw std::invalid_argument(
        fmt::format("there are {} {}; lanes have room for {}", count, what, room));
  }
}

LaneJoint<double> MakeLaneJoint(double rotor_inertia_kg_m2, double damping_nm_s_per_rad,
                                double dry_friction_nm, const RobotJointLimits& limits,
                                const LaneDrive& drive) {
  return {rotor_inertia_kg_m2,
          damping_nm_s_per_rad + drive.viscous_friction_nm_s_per_rad,
          dry_friction_nm + drive.dry_friction_nm,
          limits.lower_rad,
          limits.upper_rad,
          drive.torque_max_nm,
          drive.kp,
          drive.kd,
          1.0,
          0.0,
          drive.delay_s,
          0.0,
          0.0};
}

LaneScene MakeLaneScene(const Scene& scene, const LaneDrive& drive) {
  if (!scene.motors.empty()) {
    throw std::invalid_argument(
        "the task gives its motors friction or a torque-speed curve; lanes have those of the "
        "twin's defaults: leave out [motor]");
  }
  LaneScene lanes;
  AddBodies(scene.robot, drive, lanes);
  AddPoints(scene, lanes);
  AddObstacles(scene, lanes);
  SetContact(scene.contact, lanes);
  lanes.robot.gravity_x = scene.robot.tree.gravity.x();
  lanes.robot.gravity_z = scene.robot.tree.gravity.y();
  return lanes;
}

}  // namespace tumbler
