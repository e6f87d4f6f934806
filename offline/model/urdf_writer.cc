#include "offline/model/urdf_writer.h"

#include <fmt/format.h>

#include "common/core/functions.h"
#include "common/files/markup.h"

namespace tumbler {
namespace {

std::string Number(double value) { return fmt::format("{}", value == 0 ? 0.0 : value); }
std::string Numbers(const SpaceVector& v) {
  return fmt::format("{} {} {}", Number(v.x()), Number(v.y()), Number(v.z()));
}

/// Roll, pitch and yaw of a rotation Rz(yaw) Ry(pitch) Rx(roll).
SpaceVector AnglesOf(const SpaceMatrix& R) {
  // Where x points along z, roll and yaw turn about the same axis. Near there roll is not known
  // well; the others are those that go with it.
  const bool upright = portable::Length(R(2, 1), R(2, 2)) < 1e-12;
  const double roll = upright ? 0 : portable::Atan2(R(2, 1), R(2, 2));
  const auto [sine, cosine] = portable::SinCos(roll);
  return {roll, portable::Atan2(-R(2, 0), sine * R(2, 1) + cosine * R(2, 2)),
          portable::Atan2(sine * R(0, 2) - cosine * R(0, 1), cosine * R(1, 1) - sine * R(1, 2))};
}

std::string Origin(const Pose& pose) {
  return fmt::format("<origin xyz=\"{}\" rpy=\"{}\"/>", Numbers(pose.translation),
                     Numbers(AnglesOf(pose.rotation)));
}

/// The rest of a joint's element.
std::string MotionText(const UrdfMotion& motion) {
  std::string text = fmt::format("    <axis xyz=\"{}\"/>\n    <limit", Numbers(motion.axis));
  if (motion.range || motion.slides) {
    const auto [lower, upper] = motion.range.value_or(std::pair(-1000.0, 1000.0));
    text += fmt::format(" lower=\"{}\" upper=\"{}\"", Number(lower), Number(upper));
  }
  if (motion.effort) text += fmt::format(" effort=\"{}\"", Number(*motion.effort));
  if (motion.velocity) text += fmt::format(" velocity=\"{}\"", Number(*motion.velocity));
  return text + fmt::format("/>\n    <dynamics damping=\"{}\" friction=\"{}\"/>\n",
                            Number(motion.damping), Number(motion.friction));
}

std::string TypeOf(const UrdfJoint& joint) {
  if (!joint.motion) return joint.type;
  if (joint.motion->slides) return "prismatic";
  return joint.motion->range ? "revolute" : "continuous";
}

}  // namespace

std::string SphereForm(double radius) {
  return fmt::format("<sphere radius=\"{}\"/>", Number(radius));
}
std::string CylinderForm(double radius, double length) {
  return fmt::format("<cylinder radius=\"{}\" length=\"{}\"/>", Number(radius), Number(length));
}
std::string CapsuleForm(double radius, double length) {
  return fmt::format("<capsule radius=\"{}\" length=\"{}\"/>", Number(radius), Number(length));
}
std::string BoxForm(const SpaceVector& sides) {
  return fmt::format("<box size=\"{}\"/>", Numbers(sides));
}
std::string MeshForm(const std::string& file, const SpaceVector& scale) {
  if (scale == SpaceVector(1, 1, 1))
    return fmt::format("<mesh filename=\"{}\"/>", MarkupText(file));
  return fmt::format("<mesh filename=\"{}\" scale=\"{}\"/>", MarkupText(file), Numbers(scale));
}

UrdfWriter::UrdfWriter(const std::string& robot)
    : text_(fmt::format("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n",
                        MarkupText(robot.empty() ? "robot" : robot))) {}

void UrdfWriter::Add(const UrdfLink& link) {
  if (!link.inertial && link.shapes.empty()) {
    text_ += fmt::format("  <link name=\"{}\"/>\n", MarkupText(link.name));
    return;
  }
  text_ += fmt::format("  <link name=\"{}\">\n", MarkupText(link.name));
  if (link.inertial) {
    const SpaceMatrix& I = link.inertial->moments;
    text_ += fmt::format(
        "    <inertial>\n      {}\n      <mass value=\"{}\"/>\n      <inertia ixx=\"{}\" "
        "ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>\n",
        Origin(link.inertial->pose), Number(link.inertial->mass_kg), Number(I(0, 0)),
        Number(I(0, 1)), Number(I(0, 2)), Number(I(1, 1)), Number(I(1, 2)), Number(I(2, 2)));
  }
  for (const UrdfShape& shape : link.shapes) {
    text_ += fmt::format("    <{0}>\n      {1}\n      <geometry>{2}</geometry>\n    </{0}>\n",
                         shape.collides ? "collision" : "visual", Origin(shape.pose), shape.form);
  }
  text_ += "  </link>\n";
}

void UrdfWriter::Add(const UrdfJoint& joint) {
  text_ += fmt::format(
      "  <joint name=\"{}\" type=\"{}\">\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n"
      "    {}\n{}  </joint>\n",
      MarkupText(joint.name), TypeOf(joint), MarkupText(joint.parent), MarkupText(joint.child),
      Origin(joint.place), joint.motion ? MotionText(*joint.motion) : "");
}

std::string UrdfWriter::Finish() { return std::move(text_ += "</robot>\n"); }

}  // namespace tumbler
