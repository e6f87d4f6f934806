#include "offline/pages/space_poses.h"

#include <utility>

#include "common/core/index.h"
#include "offline/pages/shown_scene.h"

namespace tumbler {
namespace {

bool IsPoint(const Shape<Spatial>& shape) {
  return shape.kind() == ShapeKind::kSphere && shape.radius_m == 0;
}

}  // namespace

int HueOf(const SpaceRobot& robot, int body) {
  int limb = 0;
  std::vector<int> of(robot.tree.dofs.size(), -1);
  for (std::size_t j = Index(robot.root_dofs); j < of.size(); ++j) {
    const int parent = robot.tree.dofs[j].parent;
    of[j] = parent < robot.root_dofs ? limb++ % 8 : of[Index(parent)];
  }
  return of[Index(body)];
}

std::vector<SpaceBody> BodiesOf(const SpaceRobot& robot) {
  std::vector<SpaceBody> bodies;
  for (int body = robot.first_body(); body < static_cast<int>(robot.tree.dofs.size()); ++body) {
    SpaceBody shown{robot.body_names[Index(body)], {}, HueOf(robot, body)};
    for (const SpaceOwnShape& own : robot.own_shapes) {
      if (own.body == body && !IsPoint(own.shape)) shown.shapes.push_back(own.shape);
    }
    for (const ContactShape<Spatial>& touching : robot.shapes) {
      if (touching.body != body || !IsPoint(touching.shape)) continue;
      shown.shapes.push_back(Shape<Spatial>::Sphere(touching.shape.centre, kShownPoint_m));
    }
    bodies.push_back(std::move(shown));
  }
  return bodies;
}

std::vector<Pose> SpacePoses::At(const SpacePosture& posture) {
  std::vector<double> q(none_.size());
  for (std::size_t i = 0; i < 3; ++i) q[i] = posture.root_m[i];
  for (std::size_t j = 0; j < posture.joints_rad.size(); ++j) q[6 + j] = posture.joints_rad[j];
  dynamics_.SetRootAxes({ToRotation(posture.root_quaternion)});
  dynamics_.SetState(q, none_);
  std::vector<Pose> poses;
  for (int body = first_; body < static_cast<int>(none_.size()); ++body)
    poses.push_back({dynamics_.rotation(body).m, dynamics_.origin() + dynamics_.position(body)});
  return poses;
}

}  // namespace tumbler
