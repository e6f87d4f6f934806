#include "offline/scene/scene.h"

#include <algorithm>
#include <stdexcept>

#include "common/core/index.h"
#include "offline/scene/joints_alike.h"

namespace tumbler {

const std::string& TouchedName(const Scene& scene, const ActiveContact<Plane>& contact) {
  if (contact.obstacle < 0) return scene.robot.shapes[Index(contact.other_shape)].name;
  return scene.obstacles[Index(contact.obstacle)].name;
}

bool SameGround(const Scene& a, const Scene& b) {
  return a.contact == b.contact && a.obstacles == b.obstacles && a.bar == b.bar &&
         a.robot.tree.gravity == b.robot.tree.gravity;
}

bool SameJoints(const Scene& a, const Scene& b) { return JointsAreAlike(a, b); }

std::vector<double> PositionsIn(const PrimitivePose& pose, const PlanarRobot& robot) {
  if (pose.joint_positions_rad.size() != robot.joint_count())
    throw std::invalid_argument("a pose needs every joint");
  if (!pose.passive_positions_rad.empty() &&
      pose.passive_positions_rad.size() != robot.passive.size())
    throw std::invalid_argument("a pose needs every passive joint, or none");
  std::vector<double> q;
  if (robot.root_dofs == 3) q = {pose.root_x_m, pose.root_z_m, pose.root_pitch_rad};
  q.resize(robot.tree.dofs.size());
  for (std::size_t j = 0; j < robot.joint_count(); ++j)
    q[robot.DofOfJoint(j)] = pose.joint_positions_rad[j];
  for (std::size_t i = 0; i < robot.passive.size(); ++i) {
    q[Index(robot.passive[i].dof)] = pose.passive_positions_rad.empty()
                                         ? robot.passive[i].rest_rad
                                         : pose.passive_positions_rad[i];
  }
  return q;
}

PrimitivePose PoseAt(std::span<const double> q, const PlanarRobot& robot) {
  PrimitivePose pose;
  if (robot.root_dofs == 3) {
    pose.root_x_m = q[0];
    pose.root_z_m = q[1];
    pose.root_pitch_rad = q[2];
  }
  pose.joint_positions_rad.reserve(robot.joint_count());
  for (std::size_t j = 0; j < robot.joint_count(); ++j)
    pose.joint_positions_rad.push_back(q[robot.DofOfJoint(j)]);
  for (const PassiveJoint& joint : robot.passive)
    pose.passive_positions_rad.push_back(q[Index(joint.dof)]);
  return pose;
}

double RootPitchAt(std::span<const double> q, const PlanarRobot& robot) {
  return robot.root_dofs == 3 ? q[2] : 0.0;
}

}  // namespace tumbler
