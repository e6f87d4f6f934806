#include "offline/pages/run_picture.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "common/core/functions.h"
#include "common/files/sequence_toml.h"
#include "offline/model/robot.h"
#include "offline/pages/robot_paths.h"
#include "offline/pages/run_data.h"
#include "offline/pages/run_plan.h"
#include "offline/pages/shown_scene.h"
#include "offline/problem/simulated_motion.h"

namespace tumbler {
namespace {

constexpr double kVisualOpacity = 0.5;
constexpr SceneColor kGroundColor{0.75, 0.75, 0.72, 1.0};
/// The ground's extent to either side of the plane of motion [m].
constexpr double kGroundHalfWidth_m = 0.5;
/// A corner as far away as this belongs to a half-space [m].
constexpr double kFarAway_m = 500;
constexpr double kShownPart = 1.0 / 50;

std::array<double, 3> ToArray(const SpaceVector& v) { return {v.x(), v.y(), v.z()}; }

FramePose ToPose(const Pose& X) {
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 3; ++i)
    rotation.row(i) << X.rotation(i, 0), X.rotation(i, 1), X.rotation(i, 2);
  const Eigen::Quaterniond q(rotation);
  return {ToArray(X.translation), {q.x(), q.y(), q.z(), q.w()}};
}

/// Adds shapes to the links whose bodies carry them. Body b is link b + `shift`.
void AddShapes(const std::vector<RobotShape>& shapes, double opacity, int shift,
               RobotPicture& picture) {
  for (const RobotShape& shape : shapes) {
    const int link = shape.body + shift;
    if (shape.kind == RobotShape::Kind::kMesh || shape.mesh_point || link < 0) continue;
    SceneSolid solid;
    solid.pose = ToPose(shape.pose);
    solid.color = {1, 1, 1, opacity};
    const double diameter = 2 * shape.radius_m;
    switch (shape.kind) {
      case RobotShape::Kind::kSphere:
        solid.kind = SceneSolid::Kind::kSphere;
        solid.size_m = {diameter, diameter, diameter};
        break;
      case RobotShape::Kind::kCylinder:
        solid.kind = SceneSolid::Kind::kCylinder;
        solid.size_m = {diameter, diameter, shape.length_m};
        break;
      default:
        solid.size_m = ToArray(shape.size_m);
    }
    picture.links[static_cast<std::size_t>(link)].shapes.push_back(solid);
  }
}

/// The outline of a convex polygon with a radius swept around it, counter-clockwise.
std::vector<std::array<double, 2>> RoundedOutline(const ReportObstacle& obstacle) {
  const auto& corners = obstacle.corners_m;
  if (obstacle.radius_m <= 0) return corners;
  constexpr int kSteps = 32;  // of a whole turn
  std::vector<std::array<double, 2>> outline;
  // The outermost corner in each direction carries the arc of that direction.
  for (int i = 0; i < kSteps; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSteps;
    const portable::SineCosine of = portable::SinCos(angle);
    const double s = of.sine, c = of.cosine;
    const auto outermost = std::max_element(
        corners.begin(), corners.end(),
        [c, s](const auto& a, const auto& b) { return c * a[0] + s * a[1] < c * b[0] + s * b[1]; });
    outline.push_back(
        {(*outermost)[0] + obstacle.radius_m * c, (*outermost)[1] + obstacle.radius_m * s});
  }
  return outline;
}

/// Draws what is in the plane as thick as the ground is wide.
SceneTriangles Extrude(const std::vector<std::array<double, 2>>& outline) {
  SceneTriangles triangles;
  triangles.color = kGroundColor;
  const auto add = [&triangles](const std::array<double, 2>& p, double y) {
    triangles.points_m.push_back({p[0], y, p[1]});
  };
  const double w = kGroundHalfWidth_m;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const auto& a = outline[i];
    const auto& b = outline[(i + 1) % outline.size()];
    add(a, -w), add(b, -w), add(b, w);
    add(a, -w), add(b, w), add(a, w);
    if (i == 0 || i + 1 == outline.size()) continue;
    add(outline[0], -w), add(a, -w), add(b, -w);
    add(outline[0], w), add(b, w), add(a, w);
  }
  return triangles;
}

SceneTriangles DrawObstacle(ReportObstacle obstacle) {
  auto& corners = obstacle.corners_m;
  const bool far = std::any_of(corners.begin(), corners.end(), [](const auto& corner) {
    return portable::Length(corner[0], corner[1]) > kFarAway_m;
  });
  if (far) {
    // The first and the last corner are on the surface of a half-space.
    const std::array<double, 2> middle{(corners.front()[0] + corners.back()[0]) / 2,
                                       (corners.front()[1] + corners.back()[1]) / 2};
    for (auto& corner : corners) {
      for (std::size_t i = 0; i < 2; ++i)
        corner[i] = middle[i] + kShownPart * (corner[i] - middle[i]);
    }
  }
  return Extrude(RoundedOutline(obstacle));
}

/// The part of a half-space's surface around the origin, or the sides of a box around a solid.
SceneTriangles DrawObstacle(const Shape<Spatial>& shape) {
  constexpr double kHalfSide_m = 2;
  SceneTriangles triangles;
  triangles.color = kGroundColor;
  const auto add = [&triangles](const SpaceVector& p) { triangles.points_m.push_back(ToArray(p)); };
  const auto add_side = [&add](const SpaceVector& middle, const SpaceVector& s,
                               const SpaceVector& t) {
    for (const auto& [i, j] : {std::pair(-1.0, -1.0), {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}})
      add(middle + s * i + t * j);
  };
  if (shape.half_space) {
    const SpaceVector& n = shape.normal;
    const SpaceVector other = std::abs(n.x()) < 0.9 ? SpaceVector::UnitX() : SpaceVector::UnitY();
    const SpaceVector t = n.cross(other).normalized();
    // Below the origin, where that is not far away.
    const SpaceVector middle = n * shape.centre.dot(n);
    add_side(middle, t.cross(n) * kHalfSide_m, t * kHalfSide_m);
    return triangles;
  }
  std::array<SpaceVector, 3> half;
  for (int i = 0; i < 3; ++i) {
    half[static_cast<std::size_t>(i)] =
        shape.rotation * SpaceVector::Unit(i) * (shape.half_extents[i] + shape.radius_m);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const SpaceVector &a = half[(i + 1) % 3], &b = half[(i + 2) % 3];
    add_side(shape.centre + half[i], a, b);
    add_side(shape.centre - half[i], b, a);
  }
  return triangles;
}

RobotPicture PictureOf(const SequenceFile& motion, const std::vector<std::string>& joints) {
  const SimulatedMotion simulated(motion, TaskSpaces::kPlaneAndSpace);
  const Problem& problem = simulated.ProblemOf(0);
  const bool fixed = !problem.space && problem.scene.robot.root_dofs == 0;
  const Robot robot = ParseRobot(
      motion.primitives.front().provenance.robot_urdf,
      motion.primitives.front().provenance.robot_file,
      problem.space ? RootKind::kFloating : problem.scene.robot.root,
      PositionsOf(problem.space ? problem.space->scene.robot.locked : problem.scene.robot.locked));
  RobotPicture picture;
  picture.fixed_root = fixed;
  for (const PassiveJoint& joint : problem.scene.robot.passive) {
    picture.passive.push_back(
        problem.scene.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].name);
  }
  PictureLink root;
  root.name = robot.links.front().name;
  picture.links.push_back(std::move(root));
  const int root_body = robot.root_dofs - 1;
  for (int body = robot.root_dofs; body < static_cast<int>(robot.tree.dofs.size()); ++body) {
    const auto& dof = robot.tree.dofs[static_cast<std::size_t>(body)];
    PictureLink link;
    link.name = robot.joints[static_cast<std::size_t>(body)].link;
    link.parent = dof.parent - root_body;
    const auto joint = std::find(joints.begin(), joints.end(), dof.name);
    const auto passive = std::ranges::find(picture.passive, dof.name);
    link.joint =
        joint != joints.end() ? static_cast<int>(joint - joints.begin())
        : passive != picture.passive.end()
            ? static_cast<int>(joints.size()) + static_cast<int>(passive - picture.passive.begin())
            : -1;
    link.slides = dof.kind == JointKind::kPrismatic;
    link.axis = ToArray(link.slides ? dof.direction : dof.axis);
    link.offset = ToArray(dof.offset);
    picture.links.push_back(std::move(link));
  }
  AddShapes(robot.visual_shapes, kVisualOpacity, -root_body, picture);
  AddShapes(robot.collision_shapes, 1, -root_body, picture);
  if (problem.space) {
    for (const Obstacle<Spatial>& obstacle : problem.space->scene.obstacles)
      picture.ground.push_back(DrawObstacle(obstacle.shape));
    return picture;
  }
  const ReportData scene = ReportScene(problem);
  for (const ReportObstacle& obstacle : scene.obstacles)
    picture.ground.push_back(DrawObstacle(obstacle));
  return picture;
}

/// As pages show it.
class PlanOfRun final : public RunPlanner {
 public:
  /// Simulates the plan of every node, so that what cannot be simulated is refused before the run.
  PlanOfRun(const SequenceFile& motion, std::int64_t period_ns, std::optional<int> begin)
      : paths_(motion), plan_(paths_, static_cast<double>(period_ns) / 1e9, begin) {
    for (int node = 0; node < motion.graph.node_count; ++node)
      static_cast<void>(paths_.PlanOf(node));
  }

  std::optional<PlannedInstant> Take(const TickEntry& entry) override {
    time_ns_ = entry.notes.deadline_ns;
    return InstantOf(plan_.Take(TickOf(entry, 0)));
  }
  std::optional<PlannedInstant> Last() override { return InstantOf(plan_.Last()); }

 private:
  /// The first link of a page is the root's.
  [[nodiscard]] std::optional<PlannedInstant> InstantOf(
      const std::optional<ReportSample>& sample) const {
    if (!sample) return std::nullopt;
    const std::array<double, 3>& root = sample->link_poses.front();
    std::vector<double> joints = sample->joint_positions_rad;
    joints.insert(joints.end(), sample->passive_positions_rad.begin(),
                  sample->passive_positions_rad.end());
    return PlannedInstant{time_ns_, {root[0], root[1], root[2]}, std::move(joints)};
  }

  RobotPaths paths_;
  RunPlan plan_;
  std::int64_t time_ns_ = 0;
};

std::unique_ptr<RunPlanner> PlannerOf(const SequenceFile& motion, std::int64_t period_ns,
                                      std::optional<int> begin) {
  if (motion.primitives.front().entry.is_in_space()) return nullptr;
  return std::make_unique<PlanOfRun>(motion, period_ns, begin);
}

}  // namespace

PictureSource MakePictureSource() { return {PictureOf, PlannerOf}; }

}  // namespace tumbler
