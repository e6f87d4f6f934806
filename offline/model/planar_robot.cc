#include "offline/model/planar_robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/robot.h"

namespace tumbler {
namespace {

/// About the link that a degree of freedom moves.
RobotFinding AboutLink(const Robot& robot, std::size_t dof, const std::string& problem) {
  const std::string& name = robot.joints[dof].link;
  const RobotLink* const link = robot.FindLink(name);
  return {link == nullptr ? 0 : link->line, fmt::format("link '{}'", name), problem};
}

Dof<Plane> ReduceDof(const Dof<Spatial>& from) {
  Dof<Plane> dof;
  dof.name = from.name;
  dof.parent = from.parent;
  dof.kind = from.kind;
  dof.offset = InPlane(from.offset);
  if (from.kind == JointKind::kRevolute) {
    dof.axis = from.axis.y() < 0 ? 1 : -1;
  } else {
    dof.direction = InPlane(from.direction).normalized();
  }
  dof.prescribed = from.prescribed;
  dof.massless = from.massless;
  dof.mass_kg = from.mass_kg;
  dof.mass_centre = InPlane(from.mass_centre);
  // About -y through the mass centre: the same number as about +y.
  dof.inertia_kg_m2 = from.inertia_kg_m2(1, 1);
  dof.damping_nm_s_per_rad = from.damping_nm_s_per_rad;
  return dof;
}

PlanarLink ReduceLink(const RobotLink& link) {
  PlanarLink out;
  out.name = link.name;
  out.body = link.body;
  const auto in_plane = [](const auto& r) { return std::array<double, 2>{r.x(), r.z()}; };
  out.origin_m = in_plane(link.pose.translation);
  const SpaceVector x = link.pose.rotation * SpaceVector::UnitX();
  const SpaceVector z = link.pose.rotation * SpaceVector::UnitZ();
  out.x_axis = in_plane(x);
  out.z_axis = in_plane(z);
  out.in_plane = std::abs(x.y()) <= kPlaneTolerance && std::abs(z.y()) <= kPlaneTolerance;
  return out;
}

}  // namespace

int PlanarRobot::FindDof(std::string_view joint) const {
  for (std::size_t j = static_cast<std::size_t>(root_dofs); j < tree.dofs.size(); ++j) {
    if (tree.dofs[j].name == joint) return static_cast<int>(j);
  }
  return -1;
}

std::optional<std::string> LeavesPlane(const Dof<Spatial>& dof) {
  if (dof.kind == JointKind::kPrismatic) {
    if (std::abs(dof.direction.y()) <= kPlaneTolerance) return std::nullopt;
    return "its axis leaves the x-z plane; allowed for a prismatic joint: any direction in it, or "
           "lock it";
  }
  const SpaceVector& axis = dof.axis;
  if (portable::Length(axis.x(), axis.z()) <= kPlaneTolerance) return std::nullopt;
  return fmt::format(
      "its axis in the robot's frame is ({:.4g}, {:.4g}, {:.4g}); allowed for a robot in the x-z "
      "plane: (0, 1, 0) or (0, -1, 0), or lock it",
      axis.x(), axis.y(), axis.z());
}

std::vector<RobotFinding> ObstaclesToPlanning(const Robot& robot) {
  std::vector<RobotFinding> found = robot.findings;
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    const Dof<Spatial>& dof = robot.tree.dofs[j];
    if (const std::optional<std::string> why = LeavesPlane(dof))
      found.push_back({robot.joints[j].axis_line, fmt::format("joint '{}'", dof.name), *why});
  }
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    if (robot.MovesMass(static_cast<int>(j))) continue;
    found.push_back(
        AboutLink(robot, j,
                  fmt::format("degree of freedom '{}' moves no mass; give the link, or one that it "
                              "carries, an <inertial>",
                              robot.tree.dofs[j].name)));
  }
  return found;
}

PlanarRobot ReduceToPlane(const Robot& robot) {
  if (robot.root == RootKind::kFloating)
    throw std::invalid_argument("a robot with a floating root does not stay in a plane");
  std::vector<RobotFinding> found = ObstaclesToPlanning(robot);
  if (robot.tree.dofs.size() > Plane::kMaxDofs) {
    found.push_back(AboutLink(
        robot, Plane::kMaxDofs,
        fmt::format("the robot has more than {} degrees of freedom, its root's included ({}); lock "
                    "some",
                    Plane::kMaxDofs, robot.tree.dofs.size())));
  }
  if (!found.empty()) throw RobotFileError(robot.file, std::move(found));
  PlanarRobot out;
  out.name = robot.name;
  out.file = robot.file;
  out.tree.gravity = InPlane(robot.tree.gravity);
  out.root = robot.root;
  out.root_dofs = robot.root_dofs;
  out.locked = robot.locked;
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    out.tree.dofs.push_back(ReduceDof(robot.tree.dofs[j]));
    out.body_names.push_back(robot.joints[j].link);
    out.limits.push_back(robot.joints[j].limits);
    out.dry_friction_nm.push_back(robot.joints[j].dry_friction_nm);
  }
  for (const RobotLink& link : robot.links) out.links.push_back(ReduceLink(link));
  ContactShapes<Plane> contact = PlanarContactShapes(robot);
  out.shapes = std::move(contact.shapes);
  out.ignored_shapes = std::move(contact.ignored);
  out.own_shapes = PlanarOwnShapes(robot);
  for (const RobotShape& shape : robot.visual_shapes) {
    if (shape.kind == RobotShape::Kind::kMesh) {
      out.drawn_meshes.push_back({shape.body, shape.mesh_file, shape.mesh_scale, shape.pose});
    }
    const std::optional<Shape<Plane>> outline = PlanarOutline(shape);
    if (outline) out.drawing.push_back({shape.body, *outline});
  }
  return out;
}

std::string LinksWithoutContact(const PlanarRobot& robot) {
  std::string names;
  for (int body = robot.first_body(); body < static_cast<int>(robot.tree.dofs.size()); ++body) {
    const bool touches =
        std::any_of(robot.shapes.begin(), robot.shapes.end(),
                    [body](const ContactShape<Plane>& shape) { return shape.body == body; });
    if (touches) continue;
    if (!names.empty()) names += ", ";
    names += robot.body_names[Index(body)];
  }
  return names;
}

void Tilt(PlanarRobot& robot, double slope_rad) {
  const auto [s, c] = portable::SinCos(slope_rad);
  const Plane::Vector g = robot.tree.gravity;
  robot.tree.gravity = {c * g.x() + s * g.y(), c * g.y() - s * g.x()};
}

PlanarRobot ParsePlanarRobot(const std::string& text, const std::string& file_name, RootKind root,
                             const LockedJoints& locked) {
  return ReduceToPlane(ParseRobot(text, file_name, root, locked));
}

}  // namespace tumbler
