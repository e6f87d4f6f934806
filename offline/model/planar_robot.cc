#include "offline/model/planar_robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "common/index.h"
#include "common/portable/functions.h"
#include "common/toml_reader.h"
#include "offline/model/robot.h"

namespace tumbler {
namespace {

[[noreturn]] void FailLink(const Robot& robot, const std::string& link,
                           const std::string& problem) {
  const RobotLink* const about = robot.FindLink(link);
  throw FileError(robot.file, about == nullptr ? 0 : about->line, fmt::format("link '{}'", link),
                  problem);
}

Dof<Plane> ReduceDof(const Robot& robot, std::size_t j) {
  const Dof<Spatial>& from = robot.tree.dofs[j];
  const auto fail = [&](const std::string& problem) {
    throw FileError(robot.file, robot.joints[j].axis_line, fmt::format("joint '{}'", from.name),
                    problem);
  };
  Dof<Plane> dof;
  dof.name = from.name;
  dof.parent = from.parent;
  dof.kind = from.kind;
  dof.offset = InPlane(from.offset);
  if (from.kind == JointKind::kRevolute) {
    const SpaceVector& axis = from.axis;
    if (portable::Length(axis.x(), axis.z()) > kPlaneTolerance) {
      fail(
          fmt::format("its axis in the robot's frame is ({:.4g}, {:.4g}, {:.4g}); allowed for a "
                      "robot in the x-z plane: (0, 1, 0) or (0, -1, 0)",
                      axis.x(), axis.y(), axis.z()));
    }
    dof.axis = axis.y() < 0 ? 1 : -1;
  } else {
    if (std::abs(from.direction.y()) > kPlaneTolerance) {
      fail("its axis leaves the x-z plane; allowed for a prismatic joint: any direction in it");
    }
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

PlanarRobot ReduceToPlane(const Robot& robot) {
  if (robot.root == RootKind::kFloating)
    throw std::invalid_argument("a robot with a floating root does not stay in a plane");
  if (!robot.findings.empty()) {
    const RobotFinding& finding = robot.findings.front();
    throw FileError(robot.file, finding.line, finding.key, finding.problem);
  }
  if (robot.tree.dofs.size() > Plane::kMaxDofs) {
    FailLink(robot, robot.joints[Plane::kMaxDofs].link,
             fmt::format("the robot has more than {} degrees of freedom, its root's included",
                         Plane::kMaxDofs));
  }
  PlanarRobot out;
  out.name = robot.name;
  out.file = robot.file;
  out.tree.gravity = InPlane(robot.tree.gravity);
  out.root = robot.root;
  out.root_dofs = robot.root_dofs;
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    out.tree.dofs.push_back(ReduceDof(robot, j));
    out.body_names.push_back(robot.joints[j].link);
    out.limits.push_back(robot.joints[j].limits);
  }
  for (std::size_t j = 0; j < robot.tree.dofs.size(); ++j) {
    if (robot.MovesMass(static_cast<int>(j))) continue;
    FailLink(robot, robot.joints[j].link,
             fmt::format("degree of freedom '{}' moves no mass; give the link, or one that it "
                         "carries, an <inertial>",
                         robot.tree.dofs[j].name));
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

PlanarRobot ParsePlanarRobot(const std::string& text, const std::string& file_name, RootKind root) {
  return ReduceToPlane(ParseRobot(text, file_name, root));
}

}  // namespace tumbler
