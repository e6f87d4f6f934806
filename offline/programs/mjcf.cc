#include "offline/programs/mjcf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/near_points.h"
#include "offline/programs/mjcf_text.h"

namespace tumbler {
namespace {

/// Half of the thickness of boxes across the plane, and of obstacles [m].
constexpr double kHalfDepth_m = 0.05, kObstacleHalfDepth_m = 1;

class Writer {
 public:
  Writer(const SimulatedMotion& motion, const Scene& scene, const DriveGains& gains)
      : motion_(motion),
        scene_(scene),
        problem_(motion.ProblemAt(motion.file().graph.start)),
        robot_(scene_.robot),
        gains_(gains) {}

  std::string Text() {
    const PrimitiveFile& first = motion_.file().PrimitiveOf(motion_.file().graph.start);
    const std::vector<double> entry = PositionsIn(first.entry, robot_);
    const double clearance = ClearanceAt(scene_, entry);
    Line(0, "<!-- {}, as tumbler export wrote it. x right, z up; angles from +x towards +z.",
         MjcfText::InComment(motion_.file().graph.name.view()));
    Line(0, "     ctrl = {:.17g} position + {:.17g} velocity + feed-forward torque, of each joint.",
         gains_.kp_nm_per_rad, gains_.kd_nm_s_per_rad);
    if (std::isfinite(clearance)) {
      Line(0,
           "     The start is the motion's entry, {:.6f} m lower: so far its lowest point was "
           "from the ground.",
           clearance);
    }
    Line(0,
         "     Contacts are MuJoCo's own but for mu. The layer's stiffness is {:.17g} N/m, its "
         "damping {:.17g} N s/m. -->",
         scene_.contact.stiffness_n_per_m, scene_.contact.damping_n_s_per_m);
    Line(0, "<mujoco model=\"{}\">", Escaped(motion_.file().graph.name.view()));
    Line(1, "<compiler angle=\"radian\" inertiafromgeom=\"false\"/>");
    const Plane::Vector& g = robot_.tree.gravity;
    Line(1, "<option timestep=\"{}\" integrator=\"implicit\" gravity=\"{:.17g} 0 {:.17g}\"/>",
         MjcfText::kStep_s, g.x(), g.y());
    Line(1, "<default><geom condim=\"3\" friction=\"{:.17g} 0 0\"/></default>", scene_.contact.mu);
    text_.Purposes(first.purpose);
    Line(1, "<worldbody>");
    Line(2, "<light pos=\"0 -2 3\" dir=\"0 0.5 -1\"/>");
    for (const Obstacle<Plane>& obstacle : scene_.obstacles) WriteObstacle(obstacle);
    WriteShapes(2, -1);
    WriteChildren(2, -1);
    Line(1, "</worldbody>");
    text_.Actuators(problem_, gains_);
    WriteStart(entry, std::isfinite(clearance) ? clearance : 0);
    Line(0, "</mujoco>");
    return text_.Take();
  }

 private:
  template <typename... Args>
  void Line(int indent, fmt::format_string<Args...> format, Args&&... args) {
    text_.Line(indent, format, std::forward<Args>(args)...);
  }
  static std::string Escaped(std::string_view text) { return MjcfText::Escaped(text); }

  /// The attributes of a shape that is no half-space.
  static std::string ShapeText(const Shape<Plane>& shape, double half_depth_m, bool obstacle) {
    const Plane::Vector& c = shape.centre;
    const std::string at = fmt::format("pos=\"{:.17g} 0 {:.17g}\"", c.x(), c.y());
    // The rotation that takes a geom's z to y: a cylinder stands for the disc of an obstacle.
    const auto turned = fmt::format("axisangle=\"0 -1 0 {:.17g}\"", shape.rotation.angle());
    switch (shape.kind()) {
      case ShapeKind::kSphere:
        if (!obstacle) {
          return fmt::format("type=\"sphere\" {} size=\"{:.17g}\"", at,
                             MjcfText::SphereSize(shape.radius_m));
        }
        return fmt::format(
            "type=\"cylinder\" {} size=\"{:.17g} {:.17g}\" axisangle=\"1 0 0 {:.17g}\"", at,
            shape.radius_m, half_depth_m, std::numbers::pi / 2);
      case ShapeKind::kCapsule: {
        const int along = shape.half_extents[0] > 0 ? 0 : 1;
        const double half = shape.half_extents[along];
        const Plane::Vector end = shape.rotation * Plane::Vector(half * Plane::Vector::Unit(along));
        return fmt::format(
            "type=\"capsule\" fromto=\"{:.17g} 0 {:.17g} {:.17g} 0 {:.17g}\" size=\"{:.17g}\"",
            c.x() - end.x(), c.y() - end.y(), c.x() + end.x(), c.y() + end.y(), shape.radius_m);
      }
      default:
        // A box has sharp edges there: one that is rounded is as large.
        return fmt::format("type=\"box\" {} size=\"{:.17g} {:.17g} {:.17g}\" {}", at,
                           shape.half_extents[0] + shape.radius_m, half_depth_m,
                           shape.half_extents[1] + shape.radius_m, turned);
    }
  }

  void WriteObstacle(const Obstacle<Plane>& obstacle) {
    const Shape<Plane>& shape = obstacle.shape;
    const std::string of =
        shape.half_space
            ? fmt::format(
                  "type=\"plane\" pos=\"{:.17g} 0 {:.17g}\" zaxis=\"{:.17g} 0 {:.17g}\" "
                  "size=\"10 1 0.1\"",
                  shape.centre.x(), shape.centre.y(), shape.normal.x(), shape.normal.y())
            : ShapeText(shape, kObstacleHalfDepth_m, true);
    Line(2, "<geom name=\"{}\" {} contype=\"0\" conaffinity=\"1\"/>", Escaped(obstacle.name), of);
  }

  void WriteShapes(int indent, int body) {
    for (const ContactShape<Plane>& shape : robot_.shapes) {
      if (shape.body != body) continue;
      Line(indent, "<geom name=\"{}\" {} contype=\"1\" conaffinity=\"0\"/>", Escaped(shape.name),
           ShapeText(shape.shape, kHalfDepth_m, false));
    }
    for (const DrawnShape& drawn : robot_.drawing) {
      if (drawn.body != body || drawn.shape.half_space) continue;
      if (drawn.shape.kind() == ShapeKind::kCapsule && drawn.shape.radius_m == 0) continue;
      Line(indent, "<geom {} contype=\"0\" conaffinity=\"0\" group=\"2\"/>",
           ShapeText(drawn.shape, kHalfDepth_m / 5, false));
    }
  }

  void WriteJoint(int indent, int dof) {
    const Dof<Plane>& joint = robot_.tree.dofs[Index(dof)];
    std::string text = fmt::format("<joint name=\"{}\"", Escaped(joint.name));
    if (joint.kind == JointKind::kRevolute) {
      text += fmt::format(" type=\"hinge\" axis=\"0 {} 0\"", joint.axis > 0 ? -1 : 1);
    } else {
      text += fmt::format(" type=\"slide\" axis=\"{:.17g} 0 {:.17g}\"", joint.direction.x(),
                          joint.direction.y());
    }
    double dry_friction_nm = 0;
    for (std::size_t j = 0; j < scene_.motors.size(); ++j) {
      if (robot_.DofOfJoint(j) == Index(dof)) dry_friction_nm = scene_.motors[j].dry_friction_nm;
    }
    text += MjcfText::JointAttributes(robot_.limits[Index(dof)], joint.rotor_inertia_kg_m2,
                                      joint.damping_nm_s_per_rad, dry_friction_nm);
    for (const PassiveJoint& passive : robot_.passive) {
      if (passive.dof != dof) continue;
      text += fmt::format(" stiffness=\"{:.17g}\" springref=\"{:.17g}\"",
                          passive.stiffness_nm_per_rad, passive.rest_rad);
    }
    Line(indent, "{}/>", text);
    order_.push_back(dof);
  }

  /// The bodies that a body carries; -1: the world. The root's coordinates are joints of one body.
  void WriteChildren(int indent, int parent) {
    for (int dof = 0; dof < static_cast<int>(robot_.tree.dofs.size()); ++dof) {
      if (robot_.tree.dofs[Index(dof)].parent != parent) continue;
      const bool of_root = dof < robot_.root_dofs;
      const int body = of_root ? robot_.root_dofs - 1 : dof;
      Plane::Vector at =
          of_root ? Plane::Vector(Plane::Vector::Zero()) : robot_.tree.dofs[Index(dof)].offset;
      if (robot_.hinged() && of_root) at = scene_.bar;
      Line(indent, "<body name=\"{}\" pos=\"{:.17g} 0 {:.17g}\">",
           Escaped(robot_.body_names[Index(body)]), at.x(), at.y());
      for (int joint = robot_.hinged() && of_root ? body : dof; joint <= body; ++joint)
        WriteJoint(indent + 1, joint);
      WriteInertia(indent + 1, robot_.tree.dofs[Index(body)]);
      WriteShapes(indent + 1, body);
      WriteChildren(indent + 1, body);
      Line(indent, "</body>");
    }
  }

  /// In the plane only the moment about y counts; MuJoCo wants three that a body could have.
  void WriteInertia(int indent, const Dof<Plane>& body) {
    constexpr double kLeast = 1e-6;  // MuJoCo has no bodies without mass that move.
    const double inertia = std::max(body.inertia_kg_m2, kLeast * kLeast);
    Line(indent,
         "<inertial pos=\"{:.17g} 0 {:.17g}\" mass=\"{:.17g}\" diaginertia=\"{:.17g} "
         "{:.17g} {:.17g}\"/>",
         body.mass_centre.x(), body.mass_centre.y(), std::max(body.mass_kg, kLeast), inertia,
         inertia, inertia);
  }

  void WriteStart(const std::vector<double>& entry, double clearance_m) {
    std::string qpos, ctrl;
    for (const int dof : order_) {
      const bool is_height = robot_.root_dofs == 3 && !robot_.hinged() && dof == 1;
      qpos += fmt::format("{}{:.17g}", qpos.empty() ? "" : " ",
                          entry[Index(dof)] - (is_height ? clearance_m : 0));
    }
    for (const ActuatedJoint& joint : problem_.joints) {
      ctrl += fmt::format("{}{:.17g}", ctrl.empty() ? "" : " ",
                          gains_.kp_nm_per_rad * entry[Index(joint.dof)]);
    }
    Line(1, "<keyframe><key name=\"start\" qpos=\"{}\" ctrl=\"{}\"/></keyframe>", qpos, ctrl);
  }

  const SimulatedMotion& motion_;
  const Scene& scene_;
  const Problem& problem_;
  const PlanarRobot& robot_;
  DriveGains gains_;
  MjcfText text_;
  std::vector<int> order_;  ///< Degrees of freedom as MuJoCo counts them.
};

}  // namespace

double ClearanceAt(const Scene& scene, std::span<const double> q) {
  HybridDynamics<Plane> dynamics(scene.robot.tree);
  const std::vector<double> rest(q.size(), 0.0);
  dynamics.SetState(q, rest);
  // Lowering by the least distance never goes through anything, and ends where it touches.
  constexpr int kSteps = 200;
  constexpr double kTouches_m = 1e-9;
  double lowered = 0;
  for (int step = 0; step < kSteps; ++step) {
    double least = std::numeric_limits<double>::infinity();
    for (const ContactShape<Plane>& shape : scene.robot.shapes) {
      if (shape.body < 0) continue;
      Plane::Vector at = dynamics.origin() + dynamics.position(shape.body);
      at.y() -= lowered;
      const auto posed = PosedShape<Plane>::Of(shape.shape, dynamics.rotation(shape.body), at);
      for (const Obstacle<Plane>& obstacle : scene.obstacles) {
        const auto fixed =
            PosedShape<Plane>::Of(obstacle.shape, Plane::Rotation(), Plane::Vector::Zero());
        least = std::min(least, FindNearPoints(posed, fixed).d);
      }
    }
    if (!std::isfinite(least) || std::abs(lowered) > 1e3)
      return std::numeric_limits<double>::infinity();
    lowered += least;
    if (std::abs(least) < kTouches_m) break;
  }
  return lowered;
}

std::string ToMjcf(const SimulatedMotion& motion, const DriveGains& gains) {
  if (motion.ProblemAt(motion.file().graph.start).space) return ToMjcfInSpace(motion, gains);
  return ToMjcf(motion, motion.scene(), gains);
}

std::string ToMjcf(const SimulatedMotion& motion, const Scene& scene, const DriveGains& gains) {
  return Writer(motion, scene, gains).Text();
}

}  // namespace tumbler
