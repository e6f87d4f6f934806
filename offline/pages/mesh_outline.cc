#include "offline/pages/mesh_outline.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "offline/model/mesh_file.h"

namespace tumbler {
namespace {

constexpr std::size_t kMostCorners = 32;
double Cross(const Plane::Vector& a, const Plane::Vector& b, const Plane::Vector& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// The corners of a mesh in its own frame; none where it cannot be read.
std::vector<SpaceVector> PointsOf(const std::string& file) {
  try {
    std::vector<SpaceVector> points = ReadMesh(file);
    std::erase_if(points, [](const SpaceVector& point) { return !std::isfinite(point.norm()); });
    return points;
  } catch (const MeshError&) {
    return {};
  }
}

}  // namespace

std::vector<Plane::Vector> ConvexHull(std::vector<Plane::Vector> points) {
  const auto before = [](const Plane::Vector& a, const Plane::Vector& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(points.begin(), points.end(), before);
  // Andrew's monotone chain: the lower side from left to right, then the upper one back.
  std::vector<Plane::Vector> hull;
  const auto add = [&hull](const Plane::Vector& point, std::size_t least) {
    while (hull.size() >= least + 2 && Cross(hull[hull.size() - 2], hull.back(), point) <= 0)
      hull.pop_back();
    hull.push_back(point);
  };
  for (const Plane::Vector& point : points) add(point, 0);
  const std::size_t lower = hull.size() - (hull.empty() ? 0 : 1);
  for (auto point = points.rbegin(); point != points.rend(); ++point) {
    if (point != points.rbegin()) add(*point, lower);
  }
  if (hull.size() > 1) hull.pop_back();
  return hull;
}

Outline MeshOutline(const DrawnMesh& mesh, const std::string& robot_file) {
  const std::string file = FindMesh(mesh.file, robot_file);
  if (file.empty()) return {};
  std::vector<Plane::Vector> points;
  for (const SpaceVector& own : PointsOf(file)) {
    const SpaceVector point =
        mesh.pose *
        SpaceVector(mesh.scale.x() * own.x(), mesh.scale.y() * own.y(), mesh.scale.z() * own.z());
    points.emplace_back(point.x(), point.z());
  }
  Outline outline{ConvexHull(std::move(points)), 0};
  std::vector<Plane::Vector>& corners = outline.corners;
  if (corners.size() < 3) return {};
  const auto lost = [&corners](std::size_t i) {
    const std::size_t n = corners.size();
    return Cross(corners[(i + n - 1) % n], corners[i], corners[(i + 1) % n]);
  };
  while (corners.size() > kMostCorners) {
    std::size_t least = 0;
    for (std::size_t i = 1; i < corners.size(); ++i) {
      if (lost(i) < lost(least)) least = i;
    }
    corners.erase(corners.begin() + static_cast<std::ptrdiff_t>(least));
  }
  return outline;
}

}  // namespace tumbler
