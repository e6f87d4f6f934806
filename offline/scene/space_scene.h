#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/model/contact_law.h"
#include "offline/model/contact_shapes.h"
#include "offline/model/joint_limits.h"
#include "offline/model/locked_joint.h"
#include "offline/model/obstacle.h"
#include "offline/model/planar_robot.h"
#include "offline/model/pose.h"
#include "offline/model/robot.h"
#include "offline/model/spatial.h"
#include "offline/model/tree.h"
#include "offline/scene/motor.h"
#include "offline/scene/self_clearance.h"

namespace tumbler {

/// A robot with a floating root, for tasks in space. Degrees of freedom are those of `Robot`, in
/// the same order: x, y, z, pitch, roll and yaw of the root, then the joints, each of which has a
/// motor.
struct SpaceRobot {
  std::string name;
  std::string file;  ///< The robot's file.
  Tree<Spatial> tree;
  int root_dofs = 6;
  std::vector<std::string> body_names;   ///< Link of each degree of freedom.
  std::vector<RobotLink> links;          ///< All links, by their names in the file.
  std::vector<PassiveJoint> passive;     ///< None yet.
  std::vector<LockedJoint> locked;       ///< Joints of the file that are no degrees of freedom.
  std::vector<RobotJointLimits> limits;  ///< Of each degree of freedom; the root's are infinite.
  std::vector<double> dry_friction_nm;   ///< Of each degree of freedom, by the file.
  std::vector<ContactShape<Spatial>> shapes;  ///< For contact.
  std::vector<SpaceOwnShape> own_shapes;      ///< For the robot's distance from itself.
  std::vector<IgnoredShape> ignored_shapes;

  /// The degrees of freedom after the root's are its joints.
  [[nodiscard]] std::size_t joint_count() const {
    return tree.dofs.size() - static_cast<std::size_t>(root_dofs);
  }
  [[nodiscard]] std::size_t DofOfJoint(std::size_t joint) const {
    return static_cast<std::size_t>(root_dofs) + joint;
  }
  /// The first degree of freedom that moves a body.
  [[nodiscard]] int first_body() const { return root_dofs - 1; }
  [[nodiscard]] static bool IsPassive(int /*dof*/) { return false; }
  /// Index of a joint's degree of freedom, or -1.
  [[nodiscard]] int FindDof(std::string_view joint) const;
  /// The link with this name; null when there is none.
  [[nodiscard]] const RobotLink* FindLink(std::string_view link) const;
  [[nodiscard]] double mass_kg() const;
};

/// The moving links that no contact shape is on, with commas between; empty: there are none.
std::string LinksWithoutContact(const SpaceRobot& robot);

/// @pre its root is floating.
/// @throws RobotFileError with ObstaclesToPlanningInSpace, if there are any, and when there are
/// more than Spatial::kMaxDofs degrees of freedom.
SpaceRobot ReduceToSpace(const Robot& robot);

/// Puts the robot on ground that rises along x by this angle, in axes of which x is along the
/// ground: gravity is turned the other way, as in the plane.
void Tilt(SpaceRobot& robot, double slope_rad);

/// A scene for simulation in space, as `Scene` is one in the plane: a robot that nothing holds, the
/// obstacles that it can touch, and the law of their contacts.
struct SpaceScene {
  /// Joints that follow a path are prescribed; the others, and the root, are free.
  SpaceRobot robot;
  /// Those of the robot's joints, in their order; empty: they have neither friction nor a
  /// torque-speed curve.
  std::vector<Motor> motors;
  ContactLaw contact;
  /// The ground, and everything that stands on it.
  std::vector<Obstacle<Spatial>> obstacles;
  /// What the robot has to keep apart of itself. No force acts between its own shapes.
  SelfContact self_contact;
};

/// The name of what a contact's shape touches.
const std::string& TouchedName(const SpaceScene& scene, const ActiveContact<Spatial>& contact);

/// Whether the joints of two scenes with the same URDF are alike: motors and dampers.
bool SameJoints(const SpaceScene& a, const SpaceScene& b);

/// Whether the two have the same obstacles, contact and gravity.
bool SameGround(const SpaceScene& a, const SpaceScene& b);

/// Where the root's frame is, and the joints. In space no three numbers say how a root is turned
/// without a singularity, so an orientation goes with them.
struct SpacePose {
  /// Positions of all degrees of freedom [m, rad]; the angles of the root are 0.
  std::vector<double> q;
  SpaceMatrix orientation = SpaceMatrix::Identity();  ///< Of the root's frame in the world.
};

/// The height of the root at which the robot just touches the obstacles [m].
/// @throws std::runtime_error  when it cannot be put above them.
double TouchingHeight(const SpaceScene& scene, const SpacePose& pose);

/// Finds the pose in which the robot rests on the obstacles with its joints held, by a simulation
/// that puts it just above them and lets it go.
/// @param pose  its root's height is not used.
/// @throws std::runtime_error  when it cannot be put above the obstacles, turns by more than a
/// right angle, or is not at rest after 5 s.
SpacePose RestPose(const SpaceScene& scene, SpacePose pose);

}  // namespace tumbler
