#pragma once

#include <array>
#include <vector>

#include "offline/model/hybrid_dynamics.h"
#include "offline/pages/space_page.h"
#include "offline/scene/quaternion.h"
#include "offline/scene/space_scene.h"

namespace tumbler {

/// A colour for each limb: what hangs on the root by one of its joints.
/// @returns as SpaceBody::hue.
int HueOf(const SpaceRobot& robot, int body);

/// What pages show of a robot in space: a body for each of its links that move, the root first.
std::vector<SpaceBody> BodiesOf(const SpaceRobot& robot);

/// Where a robot's root is, how it is turned, and where its joints are.
struct SpacePosture {
  std::array<double, 3> root_m{};
  Quaternion root_quaternion{1, 0, 0, 0};
  std::vector<double> joints_rad;  ///< In the robot's order.
};

/// Finds where the bodies of a robot in space are.
class SpacePoses {
 public:
  explicit SpacePoses(const SpaceRobot& robot)
      : first_(robot.first_body()), dynamics_(robot.tree), none_(robot.tree.dofs.size()) {}

  /// The poses of BodiesOf, in its order.
  std::vector<Pose> At(const SpacePosture& posture);

 private:
  int first_;
  HybridDynamics<Spatial> dynamics_;
  std::vector<double> none_;  // no velocities
};

}  // namespace tumbler
