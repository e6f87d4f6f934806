#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/contact_shape.h"
#include "offline/model/contact_shapes.h"
#include "offline/model/joint_limits.h"
#include "offline/model/locked_joint.h"
#include "offline/model/plane.h"
#include "offline/model/pose.h"
#include "offline/model/robot_finding.h"
#include "offline/model/root_kind.h"
#include "offline/model/spatial.h"
#include "offline/model/tree.h"

namespace tumbler {

struct Robot;

/// A shape for drawing, in the plane of a body's frame.
struct DrawnShape {
  int body = -1;  ///< Degree of freedom that moves it; -1 is the world.
  Shape<Plane> shape;
};

/// A mesh for drawing, of which only the file's name is known.
struct DrawnMesh {
  int body = -1;  ///< Degree of freedom that moves it; -1 is the world.
  std::string file;
  SpaceVector scale{1, 1, 1};
  Pose pose;  ///< In the body's frame.
};

/// A link of the file in the plane, those on fixed joints included.
struct PlanarLink {
  std::string name;
  int body = -1;                     ///< Degree of freedom that moves it; -1 is the world.
  std::array<double, 2> origin_m{};  ///< Of its frame, in the body's: x and z.
  std::array<double, 2> x_axis{1, 0}, z_axis{0, 1};  ///< Likewise.
  bool in_plane = true;  ///< Whether these axes lie in the plane, as those of the body do.
};

/// A joint without a motor. A spring acts in it, and the damper that its tree has.
struct PassiveJoint {
  int dof = 0;
  double stiffness_nm_per_rad = 0;  ///< N/m where it is prismatic.
  double rest_rad = 0;              ///< Where the spring is slack [rad, m].

  bool operator==(const PassiveJoint&) const = default;
};

/// A robot reduced to the x-z plane. Degrees of freedom are those of `Robot`, in the same order.
struct PlanarRobot {
  std::string name;
  std::string file;                      ///< The robot's file, of which meshes are found.
  Tree<Plane> tree;                      ///< Only a bar's x and z are prescribed yet.
  RootKind root = RootKind::kFixed;      ///< Not floating.
  int root_dofs = 0;                     ///< 0 (fixed) or 3 (planar, hinge).
  std::vector<std::string> body_names;   ///< Link of each degree of freedom.
  std::vector<PlanarLink> links;         ///< All links, by their names in the file.
  std::vector<PassiveJoint> passive;     ///< In the order of degrees of freedom; a task says which.
  std::vector<LockedJoint> locked;       ///< Joints of the file that are no degrees of freedom.
  std::vector<RobotJointLimits> limits;  ///< Of each degree of freedom; the root's are infinite.
  /// Of each degree of freedom, by the file. The motors of a scene, or of a twin, have it; the
  /// dynamics of the tree do not.
  std::vector<double> dry_friction_nm;
  std::vector<ContactShape<Plane>> shapes;  ///< For contact.
  std::vector<OwnShape> own_shapes;         ///< For the robot's distance from itself.
  std::vector<DrawnShape> drawing;
  std::vector<DrawnMesh> drawn_meshes;
  std::vector<IgnoredShape> ignored_shapes;

  /// Whether a bar holds the origin of the root's frame, so that of the root only the pitch is
  /// free.
  [[nodiscard]] bool hinged() const { return root == RootKind::kHingeY; }
  /// The first degree of freedom that moves a body: of a root's three it is the last one, and the
  /// base of a fixed root is no body.
  [[nodiscard]] int first_body() const { return root_dofs == 0 ? 0 : root_dofs - 1; }
  /// The degrees of freedom after the root's are its joints. Those that are not passive are
  /// counted: each has a motor.
  [[nodiscard]] std::size_t joint_count() const {
    return tree.dofs.size() - static_cast<std::size_t>(root_dofs) - passive.size();
  }
  [[nodiscard]] std::size_t DofOfJoint(std::size_t joint) const {
    std::size_t dof = static_cast<std::size_t>(root_dofs) + joint;
    for (const PassiveJoint& other : passive) {
      if (static_cast<std::size_t>(other.dof) <= dof) ++dof;
    }
    return dof;
  }
  [[nodiscard]] bool IsPassive(int dof) const {
    for (const PassiveJoint& joint : passive) {
      if (joint.dof == dof) return true;
    }
    return false;
  }
  /// Index of a joint's degree of freedom, or -1.
  [[nodiscard]] int FindDof(std::string_view joint) const;
};

/// Why a degree of freedom leaves the plane: a revolute axis other than +-y, or a prismatic one
/// that is not in x-z. None: it does not.
std::optional<std::string> LeavesPlane(const Dof<Spatial>& dof);

/// What stands between a robot and a task with it, but for the number of its degrees of freedom:
/// joints that leave the plane, masses, inertias or limits that are not physical and joints that
/// are not modelled (`Robot::findings`), and degrees of freedom that move no mass.
/// @pre its root is not floating.
std::vector<RobotFinding> ObstaclesToPlanning(const Robot& robot);

/// The robot in its x-z plane, in which it stays. Only moments of inertia about y count there.
/// @pre its root is not floating.
/// @throws RobotFileError with ObstaclesToPlanning, if there are any, and when there are more than
/// Plane::kMaxDofs degrees of freedom.
PlanarRobot ReduceToPlane(const Robot& robot);

/// The moving links that no contact shape is on, with commas between; empty: there are none. They
/// pass through the ground and all else.
std::string LinksWithoutContact(const PlanarRobot& robot);

/// Puts the robot on ground that rises to the right by this angle, in axes of which x is along the
/// ground: gravity is turned the other way.
void Tilt(PlanarRobot& robot, double slope_rad);

/// `ReduceToPlane` of `ParseRobot`. @throws as these do.
PlanarRobot ParsePlanarRobot(const std::string& text, const std::string& file_name, RootKind root,
                             const LockedJoints& locked = {});

}  // namespace tumbler
