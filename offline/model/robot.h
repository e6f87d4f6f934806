#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "offline/dynamics/spatial.h"
#include "offline/dynamics/tree.h"
#include "offline/model/joint_limits.h"
#include "offline/model/root_kind.h"

namespace tumbler {

/// What the file says of one degree of freedom beyond its dynamics.
struct RobotJoint {
  std::string link;         ///< The link that it moves first.
  RobotJointLimits limits;  ///< The root's are infinite.
  bool continuous = false;
  std::uint32_t axis_line = 0;  ///< 0 for the root's coordinates.
};

/// A link of the file. Links on fixed joints are parts of the body that carries them.
struct RobotLink {
  std::string name;
  std::uint32_t line = 0;
  int body = -1;       ///< Degree of freedom that moves it; -1 is the world.
  double mass_kg = 0;  ///< Its own.
};

/// A collision or visual shape in the terms of the file.
struct RobotShape {
  enum class Kind { kSphere, kCylinder, kBox, kMesh };
  Kind kind = Kind::kSphere;
  std::string name;  ///< `LINK/INDEX`
  std::string link;
  std::uint32_t line = 0;  ///< Of the link.
  int body = -1;           ///< Degree of freedom that moves it; -1 is the world.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< In the body's frame.
  double radius_m = 0;                                     ///< Sphere, cylinder.
  double length_m = 0;                                     ///< Cylinder, along its z.
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();        ///< Box: whole sides.
};

/// A place in the file and what is wrong there.
struct RobotFinding {
  std::uint32_t line = 0;
  std::string key;
  std::string problem;
};

/// A robot from a URDF, in space.
///
/// Degrees of freedom are the root's coordinates, then the file's movable joints in the file's
/// order, parents moved ahead of children where the file has them otherwise. Links on fixed joints
/// are merged into what carries them. At zero the frames of all bodies have the axes of the root
/// link.
struct Robot {
  std::string file;  ///< For messages.
  std::string name;
  RootKind root = RootKind::kFixed;
  Tree<Spatial> tree;              ///< No degree of freedom is prescribed yet.
  int root_dofs = 0;               ///< 0 (fixed), 3 (planar), or 6 (floating).
  std::vector<RobotJoint> joints;  ///< Of each degree of freedom.
  /// Degrees of freedom as people count them: the root's coordinates, then the joints exactly in
  /// the file's order, also where that has children before parents.
  std::vector<int> file_order;
  std::vector<RobotLink> links;
  std::vector<RobotShape> collision_shapes;
  std::vector<RobotShape> visual_shapes;
  /// What the equations of motion can live with, but no real robot has: inertia that belongs to no
  /// body, limits of zero. A robot in a task must have none.
  std::vector<RobotFinding> findings;

  /// Index of a joint's degree of freedom, or -1. The root's coordinates are no joints.
  [[nodiscard]] int FindDof(std::string_view joint) const;
  /// Null when there is no such link.
  [[nodiscard]] const RobotLink* FindLink(std::string_view link) const;
  /// False when neither the body of the degree of freedom nor any that it carries has mass or
  /// inertia: such a one cannot be free.
  [[nodiscard]] bool MovesMass(int dof) const;
};

/// Reads a robot. Gravity is 9.81 m/s^2 along -z.
/// @param text       the URDF.
/// @param file_name  for messages.
/// @throws FileError with file, line and element when the text is not a URDF; when a mass is
/// negative, or a limit upside down; when a joint's type is unknown; when it has more than
/// Spatial::kMaxDofs degrees of freedom, or none.
Robot ParseRobot(const std::string& text, const std::string& file_name, RootKind root);

}  // namespace tumbler
