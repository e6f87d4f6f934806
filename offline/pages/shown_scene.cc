#include "offline/pages/shown_scene.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/outline.h"
#include "offline/pages/mesh_outline.h"

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

/// The world, as the body that shapes of a fixed root are on.
constexpr int kWorld = -1;

/// The bodies in the order of the page's links: the root's, which is the world where the root is
/// fixed, and then those that the joints move.
std::vector<int> DrawnBodies(const PlanarRobot& robot) {
  std::vector<int> bodies;
  for (int j = robot.root_dofs - 1; j < static_cast<int>(robot.tree.dofs.size()); ++j)
    bodies.push_back(j);
  return bodies;
}

/// The place of a joint's body among them.
int LinkOfDof(const PlanarRobot& robot, int dof) { return dof - (robot.root_dofs - 1); }

/// The root's link has the name of the file's root, whatever else is on its body.
const std::string& NameOf(const PlanarRobot& robot, int body) {
  return body < robot.root_dofs ? robot.links.front().name : robot.body_names[Index(body)];
}

/// Rods from a body's origin to its centre of mass, to what it touches with, and to the bodies that
/// it carries.
std::vector<ReportShape> Rods(const PlanarRobot& robot, int body) {
  std::vector<ReportShape> rods;
  const auto add = [&rods](const Plane::Vector& end) {
    if (end.norm() < kRodRadius_m) return;
    rods.push_back({{{0, 0}, {end.x(), end.y()}}, kRodRadius_m, false});
  };
  if (body != kWorld) add(robot.tree.dofs[Index(body)].mass_centre);
  for (const ContactShape<Plane>& own : robot.shapes) {
    if (own.body == body) add(own.shape.centre);
  }
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
  const bool point = outline.radius_m == 0 && outline.corners.size() == 1;
  return {CornersOf(outline), point ? kShownPoint_m : outline.radius_m, collides};
}

}  // namespace

ReportData ReportScene(const Problem& problem) {
  ReportData data;
  const PlanarRobot& robot = problem.scene.robot;
  for (const int body : DrawnBodies(robot)) {
    ReportLink link;
    link.name = NameOf(robot, body);
    for (const DrawnShape& drawn : robot.drawing) {
      if (drawn.body == body) link.shapes.push_back(ShownShape(drawn.shape, false));
    }
    for (const DrawnMesh& mesh : robot.drawn_meshes) {
      if (mesh.body != body) continue;
      const Outline outline = MeshOutline(mesh, robot.file);
      if (outline.corners.empty()) continue;
      link.shapes.push_back({CornersOf(outline), outline.radius_m, false});
    }
    // Shapes for contact alone may be no more than a foot.
    if (link.shapes.empty()) link.shapes = Rods(robot, body);
    for (const ContactShape<Plane>& own : robot.shapes) {
      if (own.body == body) link.shapes.push_back(ShownShape(own.shape, true));
    }
    data.links.push_back(std::move(link));
  }
  for (const ActuatedJoint& joint : problem.joints) {
    data.joint_names.push_back(robot.tree.dofs[Index(joint.dof)].name);
    data.joint_links.push_back(LinkOfDof(robot, joint.dof));
    data.torque_limits_nm.push_back(joint.limits.torque_max_nm);
    data.position_limits_rad.push_back(
        {joint.limits.position_min_rad, joint.limits.position_max_rad});
  }
  if (robot.hinged()) {
    const Plane::Vector& bar = problem.scene.bar;
    data.obstacles.push_back({"bar", {{bar.x(), bar.y()}}, BarRadius(robot)});
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
  for (const int body : DrawnBodies(problem.scene.robot)) {
    if (body == kWorld) {
      shown.link_poses.push_back({0, 0, 0});
      continue;
    }
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
