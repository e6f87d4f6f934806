#include "offline/scene/scene.h"

#include <stdexcept>

#include "common/index.h"

namespace tumbler {

const std::string& TouchedName(const Scene& scene, const ActiveContact<Plane>& contact) {
  if (contact.obstacle < 0) return scene.robot.shapes[Index(contact.other_shape)].name;
  return scene.obstacles[Index(contact.obstacle)].name;
}

bool SameGround(const Scene& a, const Scene& b) {
  return a.contact == b.contact && a.obstacles == b.obstacles && a.bar == b.bar &&
         a.robot.tree.gravity == b.robot.tree.gravity;
}

std::vector<double> PositionsIn(const PrimitivePose& pose, const PlanarRobot& robot) {
  if (pose.joint_positions_rad.size() != robot.joint_count())
    throw std::invalid_argument("a pose needs every joint");
  std::vector<double> q;
  if (robot.root_dofs == 3) q = {pose.root_x_m, pose.root_z_m, pose.root_pitch_rad};
  q.insert(q.end(), pose.joint_positions_rad.begin(), pose.joint_positions_rad.end());
  return q;
}

PrimitivePose PoseAt(std::span<const double> q, const PlanarRobot& robot) {
  PrimitivePose pose;
  if (robot.root_dofs == 3) {
    pose.root_x_m = q[0];
    pose.root_z_m = q[1];
    pose.root_pitch_rad = q[2];
  }
  const auto joints = q.subspan(static_cast<std::size_t>(robot.root_dofs));
  pose.joint_positions_rad.assign(joints.begin(), joints.end());
  return pose;
}

double RootPitchAt(std::span<const double> q, const PlanarRobot& robot) {
  return robot.root_dofs == 3 ? q[2] : 0.0;
}

}  // namespace tumbler
