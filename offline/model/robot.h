#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "offline/contact/contact_model.h"
#include "offline/dynamics/plane.h"
#include "offline/dynamics/tree.h"

namespace tumbler {

/// How the file's root link is held.
enum class RootKind {
  kFixed,     ///< To the world.
  kPlanarXz,  ///< Free in the world's x-z plane: coordinates x [m], z [m], pitch [rad] about -y.
};

/// Limits of one joint, from the URDF; infinite where the file has none.
struct RobotJointLimits {
  double lower_rad = -std::numeric_limits<double>::infinity();
  double upper_rad = std::numeric_limits<double>::infinity();
  double velocity_rad_s = std::numeric_limits<double>::infinity();
  double effort_nm = std::numeric_limits<double>::infinity();
};

/// A stroked segment for drawing, in the plane of a body's frame.
struct DrawnSegment {
  int body = -1;  ///< Degree of freedom that moves it.
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
  double radius_m = 0;
};

/// A collision shape of the file that the contact model does not use, and why.
struct IgnoredShape {
  std::string link;
  std::uint32_t line = 0;
  std::string reason;
};

/// A robot from a URDF, reduced to the x-z plane.
///
/// Degrees of freedom are the root's coordinates, then the file's movable joints in the file's
/// order (parents moved ahead of children where the file has them otherwise). Links on fixed joints
/// are merged into what carries them.
struct PlanarRobot {
  std::string name;
  Tree<Plane> tree;                      ///< No degree of freedom is prescribed yet.
  int root_dofs = 0;                     ///< 0 (fixed) or 3 (planar).
  std::vector<std::string> body_names;   ///< Link of each degree of freedom.
  std::vector<RobotJointLimits> limits;  ///< Of each degree of freedom; the root's are infinite.
  std::vector<ContactSphere<Plane>> spheres;
  std::vector<DrawnSegment> drawing;
  std::vector<IgnoredShape> ignored_shapes;

  /// Index of a joint's degree of freedom, or -1.
  [[nodiscard]] int FindDof(std::string_view joint) const;
};

/// Reads a robot. Gravity is 9.81 m/s^2 along -z.
/// @param text       the URDF.
/// @param file_name  for messages.
/// @throws FileError with file, line and element when the text is not a URDF; when a mass or
/// inertia is not physical; when a joint's type is unknown or its axis leaves the plane (revolute:
/// +-y, prismatic: in x-z); when it has more than Plane::kMaxDofs degrees of freedom, or one that
/// moves no mass.
PlanarRobot ParsePlanarRobot(const std::string& text, const std::string& file_name, RootKind root);

/// Whole content of a text file. @throws FileError naming it and the system's reason.
std::string ReadTextFile(const std::string& path);

}  // namespace tumbler
