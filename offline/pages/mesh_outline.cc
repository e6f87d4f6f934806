#include "offline/pages/mesh_outline.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <system_error>

#ifdef TUMBLER_WITH_ASSIMP
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#endif

namespace tumbler {
namespace {

constexpr std::size_t kMostCorners = 32;
/// Larger files hold more than a picture can show.
constexpr std::uintmax_t kLargestFile = 256U << 20U;

double Cross(const Plane::Vector& a, const Plane::Vector& b, const Plane::Vector& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

bool IsFile(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error);
}

/// The corners of a mesh in its own frame.
std::vector<SpaceVector> PointsOf(const std::string& file) {
  std::vector<SpaceVector> points;
#ifdef TUMBLER_WITH_ASSIMP
  std::string ending = std::filesystem::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending != ".stl" && ending != ".obj") return points;
  std::error_code error;
  if (std::filesystem::file_size(file, error) > kLargestFile || error) return points;
  Assimp::Importer importer;
  const aiScene* const scene = importer.ReadFile(file, 0);
  if (scene == nullptr) return points;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& mesh = *scene->mMeshes[m];
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      const aiVector3D& v = mesh.mVertices[i];
      const SpaceVector point(double{v.x}, double{v.y}, double{v.z});
      if (std::isfinite(point.norm())) points.push_back(point);
    }
  }
#else
  static_cast<void>(file);
#endif
  return points;
}

}  // namespace

std::string FindMesh(const std::string& named, const std::string& robot_file) {
  namespace fs = std::filesystem;
  constexpr std::string_view kFile = "file://", kPackage = "package://";
  std::error_code error;
  const fs::path folder = fs::absolute(robot_file, error).parent_path();
  if (named.starts_with(kPackage)) {
    const fs::path inside = named.substr(kPackage.size());
    if (inside.empty()) return "";
    const fs::path in_package = inside.lexically_relative(*inside.begin());
    fs::path above = folder;
    while (true) {
      for (const fs::path& place : {above / inside, above / in_package}) {
        if (IsFile(place)) return place.string();
      }
      if (above == above.parent_path()) return "";
      above = above.parent_path();
    }
  }
  const fs::path path = named.starts_with(kFile) ? named.substr(kFile.size()) : named;
  const fs::path from_folder = folder / path;  // the path itself where it is absolute
  return IsFile(from_folder) ? from_folder.string() : "";
}

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
