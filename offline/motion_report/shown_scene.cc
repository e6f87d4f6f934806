#include "offline/motion_report/shown_scene.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "common/index.h"
#include "offline/contact/outline.h"
#include "offline/dynamics/hybrid_dynamics.h"

namespace tumbler {
namespace {

constexpr double kRodRadius_m = 0.005;  // of what the file gives no shape

/// The radius with which a bar is drawn [m]: a little more than that of the root link on it, which
/// is drawn above it.
double BarRadius(const PlanarRobot& robot) {
  double radius_m = 0.01;
  for (const DrawnShape& drawn : robot.drawing) {
    if (drawn.body < robot.root_dofs) radius_m = std::max(radius_m, drawn.shape.radius_m);
  }
  return 1.4 * radius_m;
}

/// The bodies that have something to show. Each is drawn as a link. Where none has, all are drawn,
/// as rods.
std::vector<int> DrawnBodies(const Problem& problem) {
  const PlanarRobot& robot = problem.scene.robot;
  std::vector<int> bodies;
  for (int j = 0; j < static_cast<int>(robot.tree.dofs.size()); ++j) {
    const auto of_body = [j](const auto& shape) { return shape.body == j; };
    if (std::any_of(robot.drawing.begin(), robot.drawing.end(), of_body) ||
        std::any_of(robot.shapes.begin(), robot.shapes.end(), of_body)) {
      bodies.push_back(j);
    }
  }
  if (!bodies.empty()) return bodies;
  for (int j = robot.first_body(); j < static_cast<int>(robot.tree.dofs.size()); ++j)
    bodies.push_back(j);
  return bodies;
}

/// Rods from a link's origin to its centre of mass and to the links that it carries.
std::vector<ReportShape> Rods(const PlanarRobot& robot, int body) {
  std::vector<ReportShape> rods;
  const auto add = [&rods](const Plane::Vector& end) {
    if (end.norm() < kRodRadius_m) return;
    rods.push_back({{{0, 0}, {end.x(), end.y()}}, kRodRadius_m, false});
  };
  add(robot.tree.dofs[Index(body)].mass_centre);
  for (const Dof<Plane>& dof : robot.tree.dofs) {
    if (dof.parent == body) add(dof.offset);
  }
  if (rods.empty()) rods.push_back({{{0, 0}}, 2 * kRodRadius_m, false});
  return rods;
}

std::vector<std::array<double, 2>> CornersOf(const Outline& outline) {
  std::vector<std::array<double, 2>> corners;
  for (const Plane::Vector& corner : outline.corners) corners.push_back({corner.x(), corner.y()});
  return corners;
}

ReportShape ShownShape(const Shape<Plane>& shape, bool collides) {
  const Outline outline = OutlineOf(shape);
  return {CornersOf(outline), outline.radius_m, collides};
}

}  // namespace

ReportData ReportScene(const Problem& problem) {
  ReportData data;
  std::vector<int> link_of_body(problem.scene.robot.tree.dofs.size(), -1);
  for (const int body : DrawnBodies(problem)) {
    ReportLink link;
    link.name = problem.scene.robot.body_names[static_cast<std::size_t>(body)];
    for (const DrawnShape& drawn : problem.scene.robot.drawing) {
      if (drawn.body == body) link.shapes.push_back(ShownShape(drawn.shape, false));
    }
    for (const ContactShape<Plane>& own : problem.scene.robot.shapes) {
      if (own.body == body) link.shapes.push_back(ShownShape(own.shape, true));
    }
    if (link.shapes.empty()) link.shapes = Rods(problem.scene.robot, body);
    link_of_body[static_cast<std::size_t>(body)] = static_cast<int>(data.links.size());
    data.links.push_back(std::move(link));
  }
  for (const ActuatedJoint& joint : problem.joints) {
    data.joint_names.push_back(
        problem.scene.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].name);
    data.joint_links.push_back(std::max(0, link_of_body[static_cast<std::size_t>(joint.dof)]));
    data.torque_limits_nm.push_back(joint.limits.torque_max_nm);
    data.position_limits_rad.push_back(
        {joint.limits.position_min_rad, joint.limits.position_max_rad});
  }
  if (problem.scene.robot.hinged()) {
    const Plane::Vector& bar = problem.scene.bar;
    data.obstacles.push_back({"bar", {{bar.x(), bar.y()}}, BarRadius(problem.scene.robot)});
  }
  for (const Obstacle<Plane>& obstacle : problem.scene.obstacles) {
    const Outline outline = OutlineOf(obstacle.shape);
    ReportObstacle shown;
    shown.name = obstacle.name;
    shown.corners_m = CornersOf(outline);
    shown.radius_m = outline.radius_m;
    data.obstacles.push_back(std::move(shown));
    if (!data.ground_z_m) data.ground_z_m = LevelHeight(obstacle.shape);
  }
  return data;
}

ReportSample ShownSample(const Problem& problem, const MotionSample& sample) {
  ReportSample shown;
  shown.time_s = sample.time_s;
  shown.root_pitch_rad = RootPitchAt(sample.q, problem.scene.robot);
  const Plane::Vector origin = sample.dynamics->origin();
  for (const int body : DrawnBodies(problem)) {
    // The angles down the tree add up to a pitch that keeps whole turns.
    double pitch = 0;
    for (int b = body; b >= 0; b = sample.dynamics->parent(b)) {
      const Dof<Plane>& dof = problem.scene.robot.tree.dofs[static_cast<std::size_t>(b)];
      if (dof.kind == JointKind::kRevolute)
        pitch += dof.axis * sample.q[static_cast<std::size_t>(b)];
    }
    const Plane::Vector p = origin + sample.dynamics->position(body);
    shown.link_poses.push_back({p.x(), p.y(), pitch});
  }
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const auto dof = static_cast<std::size_t>(problem.joints[j].dof);
    shown.joint_positions_rad.push_back(sample.q[dof]);
    shown.joint_velocities_rad_s.push_back(sample.qd[dof]);
    shown.joint_torques_nm.push_back(sample.torque[j]);
  }
  for (const PassiveJoint& joint : problem.scene.robot.passive)
    shown.passive_positions_rad.push_back(sample.q[static_cast<std::size_t>(joint.dof)]);
  for (const ActiveContact<Plane>& contact : sample.contacts) {
    const Plane::Vector p = origin + contact.point;
    shown.forces.push_back({p.x(), p.y(), contact.force.x(), contact.force.y(), contact.normal.x(),
                            contact.normal.y()});
  }
  return shown;
}

}  // namespace tumbler
