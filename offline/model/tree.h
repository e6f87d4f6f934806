#pragma once

#include <string>
#include <vector>

namespace tumbler {

enum class JointKind { kRevolute, kPrismatic };

/// One degree of freedom: a joint, and the body that it moves. A root with several degrees of
/// freedom is a chain of these, of which only the last body has mass.
///
/// At q = 0 the frames of all bodies have world axes, so an offset and an axis describe a joint.
template <class Space>
struct Dof {
  std::string name;
  /// Index of the degree of freedom that carries this one; -1 is the world.
  int parent = -1;
  JointKind kind = JointKind::kRevolute;
  /// Whether the acceleration is given (a motor follows a path) rather than the force or torque.
  bool prescribed = false;
  /// Axis of a revolute joint, which is the same in this frame and in the parent's.
  typename Space::Axis axis = Space::DefaultAxis();
  /// Direction of a prismatic joint: a unit vector in the parent's frame.
  typename Space::Vector direction = Space::Vector::Zero();
  /// Origin of this frame in the parent's at q = 0 [m].
  typename Space::Vector offset = Space::Vector::Zero();
  /// Whether the body has neither mass nor inertia.
  bool massless = false;
  double mass_kg = 0;
  /// Centre of mass in this frame [m].
  typename Space::Vector mass_centre = Space::Vector::Zero();
  /// Inertia about the mass centre, in this frame.
  typename Space::BodyInertia inertia_kg_m2 = Space::NoInertia();
  /// Inertia of the motor's rotor, seen through its gear. It resists this joint's acceleration
  /// only.
  double rotor_inertia_kg_m2 = 0;
  /// Viscous friction of the joint (N s/m where prismatic).
  double damping_nm_s_per_rad = 0;
};

/// A kinematic tree of joints with one degree of freedom each, parents before children.
template <class Space>
struct Tree {
  std::vector<Dof<Space>> dofs;
  typename Space::Vector gravity = Space::Vector::Zero();  ///< [m/s^2]
};

}  // namespace tumbler
