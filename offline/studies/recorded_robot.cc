#include "offline/studies/recorded_robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "common/core/index.h"
#include "offline/scene/variation.h"

namespace tumbler {
namespace {

/// Numbers of two URDFs that are meant to be the same.
bool Alike(double a, double b) {
  constexpr double kRounding = 1e-9;
  return a == b || std::abs(a - b) <= kRounding * std::max(1.0, std::abs(a) + std::abs(b));
}
bool Alike(const Plane::Vector& a, const Plane::Vector& b) {
  return Alike(a.x(), b.x()) && Alike(a.y(), b.y());
}
bool Alike(const ContactShape<Plane>& a, const ContactShape<Plane>& b) {
  auto moved = a.shape;
  moved.centre = b.shape.centre;
  return a.name == b.name && a.body == b.body && moved == b.shape &&
         Alike(a.shape.centre, b.shape.centre);
}

/// How much longer the link of a body is, by what is farthest along its x: the next joints, or
/// shapes.
double LengthFactor(const PlanarRobot& of, const PlanarRobot& from, std::size_t body) {
  double x = 0, from_x = 0;
  const auto look = [&](double other, double own) {
    if (std::abs(own) <= std::abs(from_x)) return;
    x = other;
    from_x = own;
  };
  for (std::size_t i = 0; i < from.tree.dofs.size(); ++i) {
    if (from.tree.dofs[i].parent == static_cast<int>(body))
      look(of.tree.dofs[i].offset.x(), from.tree.dofs[i].offset.x());
  }
  for (std::size_t i = 0; i < from.shapes.size() && from_x == 0; ++i) {
    if (from.shapes[i].body == static_cast<int>(body))
      look(of.shapes[i].shape.centre.x(), from.shapes[i].shape.centre.x());
  }
  const double factor = x / from_x;
  return std::isfinite(factor) && factor > 0 ? factor : 1;
}

/// In words, where robots differ in what no number of a fit is; empty: they do not.
std::string DifferenceInKind(const PlanarRobot& a, const PlanarRobot& b) {
  if (a.name != b.name) return fmt::format("the robot's name is '{}' and '{}'", a.name, b.name);
  if (a.root != b.root || a.root_dofs != b.root_dofs) return "their roots differ";
  if (a.tree.dofs.size() != b.tree.dofs.size()) {
    return fmt::format("there are {} and {} joints", a.tree.dofs.size() - Index(a.root_dofs),
                       b.tree.dofs.size() - Index(b.root_dofs));
  }
  for (std::size_t i = 0; i < a.tree.dofs.size(); ++i) {
    const Dof<Plane>&of_a = a.tree.dofs[i], &of_b = b.tree.dofs[i];
    if (of_a.name != of_b.name)
      return fmt::format("a joint is '{}' and '{}'", of_a.name, of_b.name);
    if (a.body_names[i] != b.body_names[i])
      return fmt::format("a link is '{}' and '{}'", a.body_names[i], b.body_names[i]);
    if (of_a.parent != of_b.parent)
      return fmt::format("the joint '{}' is on another link", of_a.name);
    if (of_a.kind != of_b.kind || of_a.massless != of_b.massless || of_a.axis != of_b.axis ||
        !Alike(of_a.direction, of_b.direction)) {
      return fmt::format("the kind or axis of the joint '{}' differs", of_a.name);
    }
    const RobotJointLimits &limits_a = a.limits[i], &limits_b = b.limits[i];
    if (limits_a.lower_rad != limits_b.lower_rad || limits_a.upper_rad != limits_b.upper_rad ||
        limits_a.velocity_rad_s != limits_b.velocity_rad_s ||
        limits_a.effort_nm != limits_b.effort_nm) {
      return fmt::format("the limits of the joint '{}' differ", of_a.name);
    }
    if (a.dry_friction_nm[i] != b.dry_friction_nm[i])
      return fmt::format("the friction of the joint '{}' differs", of_a.name);
  }
  if (a.passive != b.passive) return "their joints without a motor differ";
  if (a.locked != b.locked) return "their locked joints differ";
  if (a.shapes.size() != b.shapes.size())
    return fmt::format("there are {} and {} contact shapes", a.shapes.size(), b.shapes.size());
  return "";
}

/// In words, which of their numbers differ, though they are meant to be the same.
std::string DifferenceInNumbers(const PlanarRobot& a, const PlanarRobot& b) {
  for (std::size_t i = 0; i < a.tree.dofs.size(); ++i) {
    const Dof<Plane>&of_a = a.tree.dofs[i], &of_b = b.tree.dofs[i];
    if (!Alike(of_a.offset, of_b.offset)) {
      return fmt::format(
          "the origin of the joint '{}' is at x, z = {:.6g}, {:.6g} and {:.6g}, "
          "{:.6g}, which is no other length of a link",
          of_a.name, of_a.offset.x(), of_a.offset.y(), of_b.offset.x(), of_b.offset.y());
    }
    if (!Alike(of_a.mass_centre, of_b.mass_centre)) {
      return fmt::format("the centre of mass of the link '{}' is at z = {:.6g} and {:.6g}",
                         a.body_names[i], of_a.mass_centre.y(), of_b.mass_centre.y());
    }
    if (!Alike(of_a.mass_kg, of_b.mass_kg) || !Alike(of_a.inertia_kg_m2, of_b.inertia_kg_m2))
      return fmt::format("the link '{}' has mass or inertia in one only", a.body_names[i]);
  }
  for (std::size_t i = 0; i < a.shapes.size(); ++i) {
    if (!Alike(a.shapes[i], b.shapes[i]))
      return fmt::format("the contact shape '{}' differs", b.shapes[i].name);
  }
  return "";
}

/// What a robot's links have to be to be those of another.
RobotVariation LinksOf(const PlanarRobot& of, const PlanarRobot& from) {
  RobotVariation links;
  for (std::size_t i = Index(from.first_body()); i < from.tree.dofs.size(); ++i) {
    const Dof<Plane>&to = of.tree.dofs[i], &own = from.tree.dofs[i];
    RobotVariation::Link link;
    const auto factor = [](double a, double b) { return b > 0 && a > 0 ? a / b : 1.0; };
    link.mass = factor(to.mass_kg, own.mass_kg);
    link.inertia = factor(to.inertia_kg_m2, own.inertia_kg_m2 * link.mass);
    link.length = LengthFactor(of, from, i);
    link.mass_centre_m = to.mass_centre.x() - link.length * own.mass_centre.x();
    links.links.push_back(link);
  }
  return links;
}

}  // namespace

std::string DifferenceOf(const Scene& scene, const PlanarRobot& robot) {
  std::string difference = DifferenceInKind(scene.robot, robot);
  if (!difference.empty()) return difference;
  return DifferenceInNumbers(Varied(scene, LinksOf(robot, scene.robot)).robot, robot);
}

void TakeModelOf(const RecordedMotion& base, RecordedMotion& record) {
  const ContactLaw &to = base.scene.contact, &own = record.scene.contact;
  ContactLaw estimated = own;
  estimated.mu = to.mu;
  estimated.v_max_m_per_s = to.v_max_m_per_s;
  estimated.stiffness_n_per_m = to.stiffness_n_per_m;
  estimated.damping_n_s_per_m = to.damping_n_s_per_m;
  if (!(estimated == to)) {
    throw std::invalid_argument(fmt::format(
        "{}: its motion was made for another ground than that of {}: its contact law has d_on_m = "
        "{} and d_off_m = {}, and that {} and {}, or smooths or damps otherwise; give records of "
        "motions whose [contact] differs in mu, v_max_m_per_s, stiffness_n_per_m and "
        "damping_n_s_per_m only",
        record.name, base.name, own.d_on_m, own.d_off_m, to.d_on_m, to.d_off_m));
  }
  if (record.robot_text != base.robot_text) {
    const PlanarRobot& robot = base.scene.robot;
    const std::string difference = DifferenceOf(record.scene, robot);
    if (difference.empty()) record.scene = Varied(record.scene, LinksOf(robot, record.scene.robot));
    if (!difference.empty()) {
      throw std::invalid_argument(fmt::format(
          "{}: is of another robot than {}: of the URDFs that their motions were made for, {} "
          "and {}, {}; give records of motions whose URDFs differ in masses, centres of mass along "
          "the link's x, inertias and lengths of links only",
          record.name, base.name, record.robot_file, base.robot_file, difference));
    }
  }
  record.scene.contact = to;
}

void TakeZerosOf(const DrivesConfig& drives, RecordedMotion& record) {
  for (std::size_t j = 0; j < record.joint_count(); ++j) {
    DriveEntry& own = record.drives.drives[j];
    const auto at = std::ranges::find(drives.drives, own.joint, &DriveEntry::joint);
    if (at == drives.drives.end()) continue;
    const float zero_rad = JointOf(at->config).zero_offset_rad;
    const double shift_rad =
        static_cast<double>(zero_rad) - static_cast<double>(JointOf(own.config).zero_offset_rad);
    if (shift_rad == 0) continue;
    for (std::vector<RecordedJoint>& tick : record.ticks) {
      tick[j].reading_rad += shift_rad;
      tick[j].setpoint.position += shift_rad;
    }
  }
}

}  // namespace tumbler
