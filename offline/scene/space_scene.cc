#include "offline/scene/space_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "common/core/functions.h"
#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/robot_review.h"
#include "offline/scene/joints_alike.h"
#include "offline/scene/lowest_height.h"
#include "offline/scene/scene_dynamics.h"

namespace tumbler {
namespace in_space {
namespace {

constexpr double kStep_s = 1e-4;
constexpr double kTime_s = 5;
/// Numerical air resistance. It shortens the rocking and has no effect at rest.
constexpr double kAir_per_s = 5;
constexpr std::size_t kHeight = 2;

/// Puts a robot into a pose, at rest.
void Place(const SpacePose& pose, SpaceDynamics& robot) {
  RootChart<Spatial> chart;
  chart.axes = pose.orientation;
  robot.Use(chart);
  std::copy(pose.q.begin(), pose.q.end(), robot.q.begin());
}

/// What the robot's bodies fill: its collision shapes but for meshes and their points, and the
/// visual shapes that are no meshes and no copy of a collision shape.
std::vector<SpaceOwnShape> OwnShapesOf(const Robot& robot) {
  std::vector<SpaceOwnShape> shapes;
  for (const bool drawn : {false, true}) {
    const std::size_t known = shapes.size();
    for (const RobotShape& shape : drawn ? robot.visual_shapes : robot.collision_shapes) {
      const std::optional<Shape<Spatial>> outline = SpatialOutline(shape);
      if (!outline || shape.body < 0 || shape.mesh_point) continue;
      SpaceOwnShape own{shape.name, shape.link, shape.body, *outline, drawn};
      if (drawn) own.name.insert(own.link.size(), "/visual");
      const auto end = shapes.begin() + static_cast<std::ptrdiff_t>(known);
      const bool copy = drawn && std::any_of(shapes.begin(), end, [&own](const auto& other) {
                          return other.body == own.body && other.shape == own.shape;
                        });
      if (!copy) shapes.push_back(std::move(own));
    }
  }
  return shapes;
}

/// Whether a half-space slopes, by less than dry friction would hold a robot on.
bool SlopesGently(const SpaceScene& scene) {
  const SpaceVector up = (-scene.robot.tree.gravity).normalized();
  return std::ranges::any_of(scene.obstacles, [&](const Obstacle<Spatial>& obstacle) {
    const double along = up.dot(obstacle.shape.normal),
                 across = up.cross(obstacle.shape.normal).norm();
    return obstacle.shape.half_space && across > 1e-12 && across < scene.contact.mu * along;
  });
}

/// Whether nothing moves any more. On a slope, friction that grows with the speed of slipping lets
/// the robot creep, which counts as rest where it goes on evenly (but for the air), below the speed
/// at which friction is fully there.
bool AtRest(const SpaceDynamics& robot, const SpaceScene& scene, bool slopes) {
  constexpr double kStill = 1e-7, kFree = 1e-5;
  constexpr int kTranslations = 3;
  return std::ranges::all_of(robot.free, [&](int dof) {
    const double speed = std::abs(robot.qd[dof]);
    if (slopes && dof < kTranslations) {
      return speed < scene.contact.v_max_m_per_s &&
             std::abs(robot.qdd[dof]) < kFree + 1.01 * kAir_per_s * speed;
    }
    return std::abs(robot.qd[dof]) < kStill && std::abs(robot.qdd[dof]) < kFree;
  });
}

}  // namespace
}  // namespace in_space

int SpaceRobot::FindDof(std::string_view joint) const {
  for (std::size_t j = Index(root_dofs); j < tree.dofs.size(); ++j) {
    if (tree.dofs[j].name == joint) return static_cast<int>(j);
  }
  return -1;
}

const RobotLink* SpaceRobot::FindLink(std::string_view link) const {
  const auto found = std::ranges::find(links, link, &RobotLink::name);
  return found == links.end() ? nullptr : &*found;
}

double SpaceRobot::mass_kg() const {
  double mass = 0;
  for (const Dof<Spatial>& dof : tree.dofs) mass += dof.mass_kg;
  return mass;
}

std::string LinksWithoutContact(const SpaceRobot& robot) {
  std::string names;
  for (int body = robot.first_body(); body < static_cast<int>(robot.tree.dofs.size()); ++body) {
    if (std::ranges::any_of(robot.shapes, [body](const auto& shape) { return shape.body == body; }))
      continue;
    names += (names.empty() ? "" : ", ") + robot.body_names[Index(body)];
  }
  return names;
}

SpaceRobot ReduceToSpace(const Robot& robot) {
  std::vector<RobotFinding> obstacles = ObstaclesToPlanningInSpace(robot);
  if (robot.tree.dofs.size() > Index(Spatial::kMaxDofs)) {
    obstacles.push_back({0, "robot",
                         fmt::format("has {} degrees of freedom, its root's included; allowed: up "
                                     "to {}, lock some joints",
                                     robot.tree.dofs.size(), Spatial::kMaxDofs)});
  }
  if (!obstacles.empty()) throw RobotFileError(robot.file, obstacles);
  SpaceRobot out;
  out.name = robot.name;
  out.file = robot.file;
  out.tree = robot.tree;
  out.root_dofs = robot.root_dofs;
  for (const RobotJoint& joint : robot.joints) {
    out.body_names.push_back(joint.link);
    out.limits.push_back(joint.limits);
    out.dry_friction_nm.push_back(joint.dry_friction_nm);
  }
  out.links = robot.links;
  out.locked = robot.locked;
  ContactShapes<Spatial> contact = SpatialContactShapes(robot);
  out.shapes = std::move(contact.shapes);
  out.ignored_shapes = std::move(contact.ignored);
  out.own_shapes = in_space::OwnShapesOf(robot);
  return out;
}

void Tilt(SpaceRobot& robot, double slope_rad) {
  const auto [s, c] = portable::SinCos(slope_rad);
  const SpaceVector g = robot.tree.gravity;
  robot.tree.gravity = {c * g.x() + s * g.z(), g.y(), c * g.z() - s * g.x()};
}

bool SameJoints(const SpaceScene& a, const SpaceScene& b) { return JointsAreAlike(a, b); }

bool SameGround(const SpaceScene& a, const SpaceScene& b) {
  return a.contact == b.contact && a.obstacles == b.obstacles &&
         a.robot.tree.gravity == b.robot.tree.gravity;
}

const std::string& TouchedName(const SpaceScene& scene, const ActiveContact<Spatial>& contact) {
  if (contact.obstacle < 0) return scene.robot.shapes[Index(contact.other_shape)].name;
  return scene.obstacles[Index(contact.obstacle)].name;
}

double TouchingHeight(const SpaceScene& scene, const SpacePose& pose) {
  SpaceDynamics robot(scene);
  in_space::Place(pose, robot);
  return LowestHeight(robot, scene, in_space::kHeight);
}

SpacePose RestPose(const SpaceScene& scene, SpacePose pose) {
  SpaceDynamics robot(scene);
  in_space::Place(pose, robot);
  robot.q[in_space::kHeight] = LowestHeight(robot, scene, in_space::kHeight);
  const SpaceVector up = pose.orientation.transpose().col(2);  // in the root's frame
  RootChart<Spatial> chart;
  chart.axes = pose.orientation;
  SpaceDynamics::State y = robot.AtRest({robot.q.data(), robot.n});
  const std::size_t free = robot.free.size();
  const bool slopes = in_space::SlopesGently(scene);
  for (int step = 0; step < static_cast<int>(in_space::kTime_s / in_space::kStep_s); ++step) {
    const auto slope = [&](int, const SpaceDynamics::State& y_s, double* k) {
      robot.SetFree(y_s);
      robot.TouchAndSolve();
      robot.TakeSlope(k);
      return step == 0 || !in_space::AtRest(robot, scene, slopes);
    };
    const bool moved =
        StepSemiImplicitEuler(y, free, in_space::kStep_s, slope, in_space::kAir_per_s);
    chart.MoveOn(&y[RootChart<Spatial>::kFirst], &y[free + RootChart<Spatial>::kFirst]);
    robot.Use(chart);
    for (std::size_t i = 0; i < free; ++i) pose.q[Index(robot.free[i])] = y[i];
    pose.orientation = chart.axes;
    if (!moved) return pose;
    const bool upright = up.dot(chart.axes.transpose().col(2)) >= 0;
    if (!(upright && std::abs(pose.q[in_space::kHeight]) <= 2 * kLowestReach_m &&
          std::isfinite(pose.q[0])))
      break;
  }
  throw std::runtime_error(
      fmt::format("the robot does not come to rest at its start: it ends at x {:.4g} m, y {:.4g} "
                  "m, z {:.4g} m, "
                  "with its root's z at ({:.3g}, {:.3g}, {:.3g})",
                  pose.q[0], pose.q[1], pose.q[2], pose.orientation.col(2).x(),
                  pose.orientation.col(2).y(), pose.orientation.col(2).z()));
}

}  // namespace tumbler
