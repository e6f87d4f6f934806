#pragma once

#include <cstdio>
#include <cstdlib>
#include <istream>
#include <ostream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "offline/model/robot.h"

/// A robot as a text of its numbers, each with all of its bits, so that a program can have it
/// without a parser of URDFs.
namespace tumbler::testing {

/// Writes values, a line each.
class NumberWriter {
 public:
  explicit NumberWriter(std::ostream& out) : out_(out) {}
  void operator()(double& value) {
    char text[64];
    std::snprintf(text, sizeof text, "%a", value);
    out_ << text << '\n';
  }
  void operator()(std::string& value) { out_ << value << '\n'; }
  template <class Integer>
  requires std::is_integral_v<Integer> || std::is_enum_v<Integer>
  void operator()(Integer& value) { out_ << static_cast<long long>(value) << '\n'; }
  template <class T>
  void Resize(std::vector<T>& list) {
    out_ << list.size() << '\n';
  }

 private:
  std::ostream& out_;
};

/// Reads what a NumberWriter wrote.
class NumberReader {
 public:
  explicit NumberReader(std::istream& in) : in_(in) {}
  void operator()(double& value) { value = std::strtod(Line().c_str(), nullptr); }
  void operator()(std::string& value) { value = Line(); }
  template <class Integer>
  requires std::is_integral_v<Integer> || std::is_enum_v<Integer>
  void operator()(Integer& value) { value = static_cast<Integer>(std::stoll(Line())); }
  template <class T>
  void Resize(std::vector<T>& list) {
    list.resize(std::stoul(Line()));
  }

 private:
  std::string Line() {
    std::string line;
    if (!std::getline(in_, line)) throw std::runtime_error("the robot's numbers end too early");
    return line;
  }
  std::istream& in_;
};

template <class Numbers>
void Visit(Numbers& numbers, SpaceVector& v) {
  for (int i = 0; i < 3; ++i) numbers(v[i]);
}
template <class Numbers>
void Visit(Numbers& numbers, SpaceMatrix& m) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) numbers(m(i, k));
  }
}
template <class Numbers>
void Visit(Numbers& numbers, Pose& pose) {
  Visit(numbers, pose.rotation);
  Visit(numbers, pose.translation);
}
template <class Numbers>
void Visit(Numbers& numbers, Dof<Spatial>& dof) {
  numbers(dof.name);
  numbers(dof.parent);
  numbers(dof.kind);
  numbers(dof.prescribed);
  Visit(numbers, dof.axis);
  Visit(numbers, dof.direction);
  Visit(numbers, dof.offset);
  numbers(dof.massless);
  numbers(dof.mass_kg);
  Visit(numbers, dof.mass_centre);
  Visit(numbers, dof.inertia_kg_m2);
  numbers(dof.rotor_inertia_kg_m2);
  numbers(dof.damping_nm_s_per_rad);
}
template <class Numbers>
void Visit(Numbers& numbers, RobotJoint& joint) {
  numbers(joint.link);
  numbers(joint.limits.lower_rad);
  numbers(joint.limits.upper_rad);
  numbers(joint.limits.velocity_rad_s);
  numbers(joint.limits.effort_nm);
  numbers(joint.continuous);
  numbers(joint.axis_line);
  numbers(joint.dry_friction_nm);
  numbers(joint.mimics);
}
template <class Numbers>
void Visit(Numbers& numbers, RobotLink& link) {
  numbers(link.name);
  numbers(link.line);
  numbers(link.body);
  numbers(link.mass_kg);
  Visit(numbers, link.pose);
}
template <class Numbers>
void Visit(Numbers& numbers, RobotShape& shape) {
  numbers(shape.kind);
  numbers(shape.name);
  numbers(shape.link);
  numbers(shape.line);
  numbers(shape.body);
  Visit(numbers, shape.pose);
  numbers(shape.radius_m);
  numbers(shape.length_m);
  Visit(numbers, shape.size_m);
}
template <class Numbers, class T>
void VisitEach(Numbers& numbers, std::vector<T>& list) {
  numbers.Resize(list);
  for (T& each : list) Visit(numbers, each);
}

/// All of a robot that a motion depends on: not how it is drawn, nor what stands in the way of a
/// task.
template <class Numbers>
void Visit(Numbers& numbers, Robot& robot) {
  numbers(robot.name);
  numbers(robot.root);
  VisitEach(numbers, robot.tree.dofs);
  Visit(numbers, robot.tree.gravity);
  numbers(robot.root_dofs);
  VisitEach(numbers, robot.joints);
  numbers.Resize(robot.file_order);
  for (int& dof : robot.file_order) numbers(dof);
  VisitEach(numbers, robot.links);
  VisitEach(numbers, robot.collision_shapes);
}

}  // namespace tumbler::testing
