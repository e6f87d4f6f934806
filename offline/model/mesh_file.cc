#include "offline/model/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <system_error>

#ifdef TUMBLER_WITH_ASSIMP
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#endif

namespace tumbler {
namespace {

/// Larger files hold more than pictures can show, or contact can use.
constexpr std::uintmax_t kLargestMesh = 256U << 20U;

bool IsFile(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error);
}

}  // namespace

std::string FindMesh(const std::string& named, const std::string& robot_file) {
  namespace fs = std::filesystem;
  constexpr std::string_view kFile = "file://";
  std::error_code error;
  const fs::path folder = fs::absolute(robot_file, error).parent_path();
  for (const std::string_view package : {"package://", "model://"}) {
    if (!named.starts_with(package)) continue;
    const fs::path inside = named.substr(package.size());
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

std::vector<SpaceVector> ReadMesh(const std::string& file) {
#ifdef TUMBLER_WITH_ASSIMP
  std::string ending = std::filesystem::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending != ".stl" && ending != ".obj")
    throw MeshError("is neither STL nor OBJ; make one of these of it");
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error) throw MeshError(fmt::format("cannot be read: {}", error.message()));
  if (size > kLargestMesh) {
    throw MeshError(fmt::format("has {} MiB; allowed: up to {}; take one with fewer faces",
                                size >> 20U, kLargestMesh >> 20U));
  }
  Assimp::Importer importer;
  const aiScene* const scene = importer.ReadFile(file, 0);
  if (scene == nullptr)
    throw MeshError(fmt::format("cannot be read: {}; write it again", importer.GetErrorString()));
  std::vector<SpaceVector> points;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& mesh = *scene->mMeshes[m];
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      const aiVector3D& v = mesh.mVertices[i];
      points.emplace_back(double{v.x}, double{v.y}, double{v.z});
    }
  }
  if (points.empty()) throw MeshError("is empty: it has no face; write it again");
  return points;
#else
  static_cast<void>(file);
  throw MeshError(
      "is not read: this build has no assimp (-DTUMBLER_WITH_ASSIMP=OFF, or it was not installed); "
      "build with it, or give the link spheres, cylinders or boxes");
#endif
}

}  // namespace tumbler
