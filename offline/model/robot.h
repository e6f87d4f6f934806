#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/joint_limits.h"
#include "offline/model/locked_joint.h"
#include "offline/model/pose.h"
#include "offline/model/robot_finding.h"
#include "offline/model/root_kind.h"
#include "offline/model/spatial.h"
#include "offline/model/tree.h"

namespace tumbler {

/// The properties of one degree of freedom that are no part of its dynamics.
struct RobotJoint {
  std::string link;             ///< The link on which the joint acts directly.
  RobotJointLimits limits;      ///< Infinite for the root's coordinates.
  bool continuous = false;      ///< Whether the URDF has it as a continuous joint.
  std::uint32_t axis_line = 0;  ///< Line of the axis in the file; 0 for the root's coordinates.
  double dry_friction_nm = 0;   ///< By the file; N where it is prismatic.
  std::string mimics;           ///< The joint that it follows by the file; empty: none.
};

/// A link of the file. Links on fixed joints are parts of the body that carries them.
struct RobotLink {
  std::string name;
  std::uint32_t line = 0;
  int body = -1;       ///< Index of the degree of freedom that moves it; -1 is the world.
  double mass_kg = 0;  ///< Of this link alone.
  Pose pose;           ///< Of its frame, in the body's.
};

/// The name of a collision shape, a sphere of radius 0, that is a point of a mesh in contact.
inline constexpr const char* kMeshPoint = "mesh-point";

/// A collision or visual shape, as the file describes it.
struct RobotShape {
  enum class Kind { kSphere, kCylinder, kBox, kMesh };
  Kind kind = Kind::kSphere;
  std::string name;  ///< `LINK/INDEX`
  std::string link;
  std::uint32_t line = 0;  ///< Line of the link in the file.
  int body = -1;           ///< Index of the degree of freedom that moves it; -1 is the world.
  Pose pose;               ///< In the body's frame.
  double radius_m = 0;     ///< Sphere, cylinder.
  double length_m = 0;     ///< Cylinder, along its z.
  SpaceVector size_m = SpaceVector::Zero();  ///< Box: whole sides.
  std::string mesh_file;                     ///< Mesh: as the robot's file names it.
  SpaceVector mesh_scale{1, 1, 1};           ///< Mesh: along each axis of its frame.
  bool mesh_point = false;                   ///< Sphere: a point of a mesh in contact.
};

/// A robot from a URDF, in space.
///
/// Its degrees of freedom are the root's coordinates, and then the movable joints in the order of
/// the file, except that parents come before children. Links on fixed joints are merged into the
/// body that carries them. At zero the frames of all bodies have the axes of the root link.
struct Robot {
  std::string file;  ///< For messages.
  std::string name;
  RootKind root = RootKind::kFixed;
  Tree<Spatial> tree;              ///< Only a bar's x and z are prescribed yet.
  int root_dofs = 0;               ///< 0 (fixed), 3 (planar, hinge), or 6 (floating).
  std::vector<RobotJoint> joints;  ///< Of each degree of freedom.
  /// Indices of the degrees of freedom in the order for people: the root's coordinates, then the
  /// joints exactly in the order of the file, even where it has children before parents.
  std::vector<int> file_order;
  std::vector<RobotLink> links;
  std::vector<RobotShape> collision_shapes;
  std::vector<RobotShape> visual_shapes;
  std::vector<LockedJoint> locked;  ///< In the order of the links.
  /// Joints of other types, such as `floating`, that are not locked: they are fixed here, and
  /// `findings` say so.
  std::vector<std::string> held_joints;
  /// Things that no real robot has, such as inertia that belongs to no body, or limits of zero, and
  /// what is not modelled, such as joints that follow others. The equations of motion can be
  /// evaluated with them, but a robot in a task must have none.
  std::vector<RobotFinding> findings;

  /// Index of a joint's degree of freedom, or -1. The root's coordinates are no joints.
  [[nodiscard]] int FindDof(std::string_view joint) const;
  /// The link with this name; null when there is none.
  [[nodiscard]] const RobotLink* FindLink(std::string_view link) const;
  /// Whether the body of the degree of freedom, or one that it carries, has mass or inertia. If
  /// none has, the degree of freedom cannot be free.
  [[nodiscard]] bool MovesMass(int dof) const;
};

/// Reads a robot. Gravity is 9.81 m/s^2 along -z.
/// @param text       the URDF.
/// @param file_name  for messages.
/// @param locked     joints that are held there, and with them those that follow them (`mimic`).
///                   Names of no such joint count for nothing: see `Robot::locked`.
/// @throws RobotFileError  with file, line and element of everything of this kind: the text is no
/// URDF, a mass is negative, a lower limit is above the upper one, a joint's type is unknown, or
/// the robot has no degree of freedom.
Robot ParseRobot(const std::string& text, const std::string& file_name, RootKind root,
                 const LockedJoints& locked = {});

}  // namespace tumbler
