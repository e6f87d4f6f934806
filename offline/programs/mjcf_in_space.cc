#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "common/core/index.h"
#include "offline/problem/space_task.h"
#include "offline/programs/mjcf.h"
#include "offline/programs/mjcf_text.h"

namespace tumbler {
namespace {

std::string Numbers(const SpaceVector& v) {
  return fmt::format("{:.17g} {:.17g} {:.17g}", v.x(), v.y(), v.z());
}
std::string Numbers(const std::array<double, 4>& q) {
  return fmt::format("{:.17g} {:.17g} {:.17g} {:.17g}", q[0], q[1], q[2], q[3]);
}

class SpaceWriter {
 public:
  SpaceWriter(const SimulatedMotion& motion, const DriveGains& gains)
      : motion_(motion),
        problem_(motion.ProblemAt(motion.file().graph.start)),
        scene_(problem_.space->scene),
        robot_(scene_.robot),
        gains_(gains) {}

  std::string Text() {
    const PrimitiveFile& first = motion_.file().PrimitiveOf(motion_.file().graph.start);
    const std::string_view name = motion_.file().graph.name.view();
    const SpacePose entry = ToSpacePose(first.entry);
    const double clearance_m = ClearanceAt(entry);
    text_.Line(0, "<!-- {}, as tumbler export wrote it. SI units; z up.",
               MjcfText::InComment(name));
    text_.Line(0,
               "     ctrl = {:.17g} position + {:.17g} velocity + feed-forward torque, of each "
               "joint.",
               gains_.kp_nm_per_rad, gains_.kd_nm_s_per_rad);
    text_.Line(0,
               "     The start is the motion's entry, {:.6f} m lower: so far its lowest point was "
               "from the ground.",
               clearance_m);
    text_.Line(0,
               "     Contacts are MuJoCo's own but for mu. The layer's stiffness is {:.17g} N/m, "
               "its damping {:.17g} N s/m. -->",
               scene_.contact.stiffness_n_per_m, scene_.contact.damping_n_s_per_m);
    text_.Line(0, "<mujoco model=\"{}\">", MjcfText::Escaped(name));
    text_.Line(1, "<compiler angle=\"radian\" inertiafromgeom=\"false\"/>");
    text_.Line(1, "<option timestep=\"{}\" integrator=\"implicit\" gravity=\"{}\"/>",
               MjcfText::kStep_s, Numbers(robot_.tree.gravity));
    text_.Line(1, "<default><geom condim=\"3\" friction=\"{:.17g} 0 0\"/></default>",
               scene_.contact.mu);
    text_.Purposes(first.purpose);
    text_.Line(1, "<worldbody>");
    text_.Line(2, "<light pos=\"0 -2 3\" dir=\"0 0.5 -1\"/>");
    for (const Obstacle<Spatial>& obstacle : scene_.obstacles) {
      text_.Line(2, "<geom name=\"{}\" {} contype=\"0\" conaffinity=\"1\"/>",
                 MjcfText::Escaped(obstacle.name), ShapeText(obstacle.shape));
    }
    WriteBody(2, robot_.root_dofs - 1);
    text_.Line(1, "</worldbody>");
    text_.Actuators(problem_, gains_);
    WriteStart(first.entry, entry, clearance_m);
    text_.Line(0, "</mujoco>");
    return text_.Take();
  }

 private:
  /// How far the lowest point is above what the robot stands on; 0 where there is nothing.
  [[nodiscard]] double ClearanceAt(const SpacePose& entry) const {
    if (scene_.obstacles.empty()) return 0;
    // Rigid ground begins at the surface, not with the compliant layer above it.
    constexpr double kNoLayer_m = 1e-9;
    SpaceScene rigid = scene_;
    rigid.contact.d_on_m = kNoLayer_m;
    rigid.contact.d_off_m = kNoLayer_m / 2;
    return entry.q[2] - TouchingHeight(rigid, entry);
  }

  static std::string ShapeText(const Shape<Spatial>& shape) {
    const SpaceVector& c = shape.centre;
    switch (shape.kind()) {
      case ShapeKind::kHalfSpace:
        return fmt::format("type=\"plane\" pos=\"{}\" zaxis=\"{}\" size=\"10 10 0.1\"", Numbers(c),
                           Numbers(shape.normal));
      case ShapeKind::kSphere:
        return fmt::format("type=\"sphere\" pos=\"{}\" size=\"{:.17g}\"", Numbers(c),
                           MjcfText::SphereSize(shape.radius_m));
      case ShapeKind::kCapsule: {
        int along = 0;
        while (!(shape.half_extents[along] > 0)) ++along;
        const SpaceVector end =
            shape.rotation * SpaceVector(shape.half_extents[along] * SpaceVector::Unit(along));
        return fmt::format("type=\"capsule\" fromto=\"{} {}\" size=\"{:.17g}\"",
                           Numbers(SpaceVector(c - end)), Numbers(SpaceVector(c + end)),
                           shape.radius_m);
      }
      default: {
        // A box has sharp edges there: one that is rounded is as large.
        const double r = shape.radius_m;
        return fmt::format("type=\"box\" pos=\"{}\" size=\"{}\" xyaxes=\"{} {}\"", Numbers(c),
                           Numbers(SpaceVector(shape.half_extents + SpaceVector(r, r, r))),
                           Numbers(shape.rotation * SpaceVector::Unit(0)),
                           Numbers(shape.rotation * SpaceVector::Unit(1)));
      }
    }
  }

  void WriteJoint(int indent, std::size_t dof) {
    const Dof<Spatial>& joint = robot_.tree.dofs[dof];
    const bool turns = joint.kind == JointKind::kRevolute;
    std::string text =
        fmt::format("<joint name=\"{}\" type=\"{}\" axis=\"{}\"", MjcfText::Escaped(joint.name),
                    turns ? "hinge" : "slide", Numbers(turns ? joint.axis : joint.direction));
    double dry_friction_nm = 0;
    for (std::size_t j = 0; j < scene_.motors.size(); ++j) {
      if (robot_.DofOfJoint(j) == dof) dry_friction_nm = scene_.motors[j].dry_friction_nm;
    }
    text += MjcfText::JointAttributes(robot_.limits[dof], joint.rotor_inertia_kg_m2,
                                      joint.damping_nm_s_per_rad, dry_friction_nm);
    text_.Line(indent, "{}/>", text);
  }

  /// A body and those that it carries. All frames have the world's axes where the joints are at 0.
  void WriteBody(int indent, int body) {
    const Dof<Spatial>& dof = robot_.tree.dofs[Index(body)];
    const bool root = body == robot_.root_dofs - 1;
    text_.Line(indent, "<body name=\"{}\" pos=\"{}\">",
               MjcfText::Escaped(robot_.body_names[Index(body)]),
               Numbers(root ? SpaceVector(SpaceVector::Zero()) : dof.offset));
    if (root) {
      text_.Line(indent + 1, "<freejoint/>");
    } else {
      WriteJoint(indent + 1, Index(body));
    }
    constexpr double kLeast = 1e-6;  // MuJoCo has no bodies without mass that move.
    const SpaceMatrix& I = dof.inertia_kg_m2;
    text_.Line(
        indent + 1,
        "<inertial pos=\"{}\" mass=\"{:.17g}\" fullinertia=\"{:.17g} {:.17g} {:.17g} {:.17g} "
        "{:.17g} {:.17g}\"/>",
        Numbers(dof.mass_centre), std::max(dof.mass_kg, kLeast), std::max(I(0, 0), kLeast * kLeast),
        std::max(I(1, 1), kLeast * kLeast), std::max(I(2, 2), kLeast * kLeast), I(0, 1), I(0, 2),
        I(1, 2));
    for (const ContactShape<Spatial>& shape : robot_.shapes) {
      if (shape.body != body) continue;
      text_.Line(indent + 1, "<geom name=\"{}\" {} contype=\"1\" conaffinity=\"0\"/>",
                 MjcfText::Escaped(shape.name), ShapeText(shape.shape));
    }
    for (int child = 0; child < static_cast<int>(robot_.tree.dofs.size()); ++child) {
      if (child >= robot_.root_dofs && robot_.tree.dofs[Index(child)].parent == body)
        WriteBody(indent + 1, child);
    }
    text_.Line(indent, "</body>");
  }

  void WriteStart(const PrimitivePose& entry, const SpacePose& pose, double clearance_m) {
    std::string qpos =
        fmt::format("{} {}", Numbers(SpaceVector(pose.q[0], pose.q[1], pose.q[2] - clearance_m)),
                    Numbers(entry.root_quaternion));
    // MuJoCo counts joints as they stand in the file: depth first.
    std::string ctrl;
    AddPositions(robot_.root_dofs - 1, pose, qpos);
    for (const ActuatedJoint& joint : problem_.joints) {
      ctrl += fmt::format("{}{:.17g}", ctrl.empty() ? "" : " ",
                          gains_.kp_nm_per_rad * pose.q[Index(joint.dof)]);
    }
    text_.Line(1, "<keyframe><key name=\"start\" qpos=\"{}\" ctrl=\"{}\"/></keyframe>", qpos, ctrl);
  }

  void AddPositions(int body, const SpacePose& pose, std::string& qpos) const {
    for (int child = robot_.root_dofs; child < static_cast<int>(robot_.tree.dofs.size()); ++child) {
      if (robot_.tree.dofs[Index(child)].parent != body) continue;
      qpos += fmt::format(" {:.17g}", pose.q[Index(child)]);
      AddPositions(child, pose, qpos);
    }
  }

  const SimulatedMotion& motion_;
  const Problem& problem_;
  const SpaceScene& scene_;
  const SpaceRobot& robot_;
  DriveGains gains_;
  MjcfText text_;
};

}  // namespace

std::string ToMjcfInSpace(const SimulatedMotion& motion, const DriveGains& gains) {
  return SpaceWriter(motion, gains).Text();
}

}  // namespace tumbler
