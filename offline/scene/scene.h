#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/model/contact_forces.h"
#include "offline/model/contact_law.h"
#include "offline/model/obstacle.h"
#include "offline/model/planar_robot.h"
#include "offline/model/plane.h"
#include "offline/scene/motor.h"
#include "offline/scene/self_clearance.h"

namespace tumbler {

/// A scene for simulation: a robot, the obstacles that it can touch, and the law of their contacts.
/// A task describes a scene, and its primitive carries the description along (`TaskOf`).
struct Scene {
  /// Joints that follow a path are prescribed; the others are free.
  PlanarRobot robot;
  /// Those of the robot's joints, in their order; empty: nothing is known of them, and they have
  /// neither friction nor a torque-speed curve. The viscous friction is in the robot's dampings,
  /// too.
  std::vector<Motor> motors;
  ContactLaw contact;
  /// x and z of the bar that a robot with a hinge hangs from [m].
  Plane::Vector bar = Plane::Vector::Zero();
  /// The ground, and everything that stands on it.
  std::vector<Obstacle<Plane>> obstacles;
  /// What the robot has to keep apart of itself. No force acts between its own shapes.
  SelfContact self_contact;
};

/// The name of what a contact's shape touches: an obstacle, or another shape of the robot.
const std::string& TouchedName(const Scene& scene, const ActiveContact<Plane>& contact);

/// Whether two scenes have the same ground: contact law, obstacles and bar.
bool SameGround(const Scene& a, const Scene& b);

/// Whether the joints of two scenes with the same URDF are alike: motors, springs and dampers.
bool SameJoints(const Scene& a, const Scene& b);

/// Positions of all degrees of freedom of a robot in this pose [m, rad]. Passive joints are where
/// their springs are slack when the pose has none of them.
/// @throws std::invalid_argument when the pose does not have one position for each joint.
std::vector<double> PositionsIn(const PrimitivePose& pose, const PlanarRobot& robot);

/// The pose of a robot at these positions of all its degrees of freedom.
PrimitivePose PoseAt(std::span<const double> q, const PlanarRobot& robot);

/// The pitch of the robot's root at these positions [rad]. 0 when the root is fixed.
double RootPitchAt(std::span<const double> q, const PlanarRobot& robot);

}  // namespace tumbler
