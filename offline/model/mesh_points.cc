#include "offline/model/mesh_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "offline/model/hull_points.h"
#include "offline/model/mesh_file.h"
#include "offline/model/plane.h"
#include "offline/model/robot.h"
#include "offline/model/symmetric_eigen.h"
#include "offline/model/urdf_edit.h"

namespace tumbler {
namespace {

/// The least and the most size of a mesh, and how far its corners may be from the frame of its body
/// [m]. Outside, the scale is another one than was meant: a robot's part in millimetres.
constexpr double kSmallestMesh = 1e-4, kMeshReach = 10;
/// A mesh is flat that is thinner than this part of its size.
constexpr double kFlat = 1e-6;

constexpr const char* kWhatElse = "or give the link spheres, cylinders or boxes instead";

/// Checks the corners of a mesh in its own frame.
void CheckFinite(const std::vector<SpaceVector>& corners) {
  for (const SpaceVector& corner : corners) {
    if (corner.allFinite()) continue;
    throw MeshError(
        fmt::format("has a corner at ({:g}, {:g}, {:g}); allowed: finite numbers; "
                    "write it again",
                    corner.x(), corner.y(), corner.z()));
  }
}

/// Checks that a mesh is a body's. @param points  in the frame of the body.
void CheckForm(const std::vector<SpaceVector>& points) {
  double reach = 0;
  SpaceVector mean = SpaceVector::Zero();
  for (const SpaceVector& point : points) reach = std::max(reach, point.norm());
  if (reach > kMeshReach) {
    throw MeshError(
        fmt::format("reaches {:.4g} m far from the frame of its body; allowed: up to {} m; "
                    "of a mesh in millimetres the scale is \"0.001 0.001 0.001\"",
                    reach, kMeshReach));
  }
  for (const SpaceVector& point : points) mean += point / static_cast<double>(points.size());
  double size = 0;
  for (const SpaceVector& point : points) size = std::max(size, 2 * (point - mean).norm());
  if (size < kSmallestMesh) {
    throw MeshError(fmt::format("is {:.2g} m large; allowed: from {} m; give it another scale, {}",
                                size, kSmallestMesh, kWhatElse));
  }
  SmallMatrix spread = SmallMatrix::Zero(3, 3);
  for (const SpaceVector& point : points) {
    const SpaceVector d = (point - mean) / size;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) spread(i, j) += d[i] * d[j];
    }
  }
  const SymmetricEigen eigen = DecomposeSymmetric(spread);
  if (!(eigen.values[0] > kFlat * kFlat * eigen.values[2])) {
    throw MeshError(fmt::format("is flat, and has no inside; close it, {}", kWhatElse));
  }
}

/// The corners of the mesh's hull, or of its outline in the plane, that stand for it.
HullPoints ChoosePoints(const std::vector<SpaceVector>& points, bool in_plane, std::size_t most) {
  if (!in_plane) return ChooseHullPoints<SpaceVector>(points, most);
  std::vector<Plane::Vector> outline;
  outline.reserve(points.size());
  for (const SpaceVector& point : points) outline.push_back(InPlane(point));
  return ChooseHullPoints<Plane::Vector>(outline, most);
}

/// Where the frame of `a` is in the other frame.
Pose Inverse(const Pose& a) {
  const SpaceMatrix back = a.rotation.transpose();
  return {back, -(back * a.translation)};
}

}  // namespace

std::string Describe(const MeshInContact& mesh) {
  constexpr double kNone_m = 1e-6;
  return fmt::format(
      "collision mesh {} ({}) touches with {} points, {}", mesh.shape, mesh.file, mesh.points,
      mesh.beyond_m < kNone_m
          ? "the corners of its hull"
          : fmt::format("out of whose hull it sticks by up to {:.2g} mm", 1e3 * mesh.beyond_m));
}

RobotOfPoints WithMeshPoints(const std::string& urdf, const Robot& robot, std::size_t most) {
  RobotOfPoints out{urdf, {}};
  std::vector<RobotFinding> mistakes;
  std::vector<ShapeAsPoints> edits;
  std::map<std::string, std::vector<SpaceVector>> read;  // by file: links share them
  const auto corners_of = [&](const RobotShape& shape) -> const std::vector<SpaceVector>& {
    const std::string file = FindMesh(shape.mesh_file, robot.file);
    if (file.empty()) {
      throw MeshError(fmt::format(
          "is not found; looked for from the folder of {}, of package:// in all folders above it; "
          "put it there, {}",
          robot.file, kWhatElse));
    }
    const auto known = read.find(file);
    return known == read.end() ? read.emplace(file, ReadMesh(file)).first->second : known->second;
  };
  for (const RobotShape& shape : robot.collision_shapes) {
    if (shape.kind != RobotShape::Kind::kMesh || shape.body < 0) continue;
    try {
      std::vector<SpaceVector> points = corners_of(shape);
      CheckFinite(points);
      const SpaceVector& scale = shape.mesh_scale;
      for (SpaceVector& p : points) {
        p = shape.pose * SpaceVector(scale.x() * p.x(), scale.y() * p.y(), scale.z() * p.z());
      }
      CheckForm(points);
      const HullPoints hull = ChoosePoints(points, robot.root != RootKind::kFloating, most);
      const Pose to_link = Inverse(robot.FindLink(shape.link)->pose);
      const std::string_view index = std::string_view(shape.name).substr(shape.link.size() + 1);
      ShapeAsPoints edit{shape.link, std::stoul(std::string(index)), {}};
      for (const std::size_t i : hull.chosen) edit.points.push_back(to_link * points[i]);
      out.meshes.push_back(
          {shape.name, shape.link, shape.line, shape.mesh_file, edit.points.size(), hull.beyond_m});
      edits.push_back(std::move(edit));
    } catch (const MeshError& error) {
      mistakes.push_back({shape.line, fmt::format("link '{}'", shape.link),
                          fmt::format("collision mesh '{}' {}", shape.mesh_file, error.what())});
    }
  }
  if (!mistakes.empty()) throw RobotFileError(robot.file, std::move(mistakes));
  if (!edits.empty()) out.urdf = WithPoints(urdf, robot.file, edits);
  return out;
}

}  // namespace tumbler
