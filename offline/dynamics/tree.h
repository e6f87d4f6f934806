#pragma once

#include <string>
#include <vector>

namespace tumbler {

enum class JointKind { kRevolute, kPrismatic };

/// One degree of freedom and the body that it moves. A root with several is a chain of these with
/// massless bodies.
///
/// At q = 0 the frames of all bodies have world axes, so a joint is an offset and an axis.
template <class Space>
struct Dof {
  std::string name;
  int parent = -1;  ///< Index of the degree of freedom that carries this one; -1 is the world.
  JointKind kind = JointKind::kRevolute;
  bool prescribed =
      false;  ///< Its acceleration is given (a motor's path), else its force or torque.
  typename Space::Axis axis = Space::DefaultAxis();  ///< Revolute: in this frame and the parent's.
  typename Space::Vector direction =
      Space::Vector::Zero();  ///< Prismatic: unit vector in the parent's frame.
  typename Space::Vector offset =
      Space::Vector::Zero();  ///< Origin of this frame in the parent's at q = 0 [m].
  bool massless = false;      ///< The body has neither mass nor inertia.
  double mass_kg = 0;
  typename Space::Vector mass_centre = Space::Vector::Zero();  ///< In this frame [m].
  typename Space::BodyInertia inertia_kg_m2 =
      Space::NoInertia();  ///< About the mass centre, in this frame.
  double rotor_inertia_kg_m2 =
      0;  ///< Of a motor, seen through its gear: adds to the joint's own inertia only.
  double damping_nm_s_per_rad = 0;  ///< Viscous friction of the joint (N s/m where prismatic).
};

/// A kinematic tree of one-degree-of-freedom joints, parents before children.
template <class Space>
struct Tree {
  std::vector<Dof<Space>> dofs;
  typename Space::Vector gravity = Space::Vector::Zero();  ///< [m/s^2]
};

}  // namespace tumbler
