#include "offline/model/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
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

#ifdef TUMBLER_WITH_ASSIMP
/// assimp takes the faces of a text STL that is cut off between two of them for all that it has. (A
/// binary one may begin with the same word.)
void CheckWholeStl(const std::string& text) {
  constexpr std::size_t kHead = 84, kFace = 50;  // of a binary one, in bytes
  if (!text.starts_with("solid") || text.find("endsolid") != std::string::npos) return;
  if (text.size() >= kHead && (text.size() - kHead) % kFace == 0) return;
  throw MeshError("is cut off: it has no 'endsolid'; write it again");
}

/// The text of an OBJ for assimp, which leaves out corners whose coordinates have no digit before
/// the point, and would read other files for colours.
std::string ForAssimp(const std::string& text) {
  std::string clean;
  clean.reserve(text.size());
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view words(text.data() + begin, end - begin);
    begin = end + 1;
    const bool corner = words.starts_with("v ") || words.starts_with("v\t");
    if (!words.starts_with("mtllib")) {
      for (std::size_t i = 0; i < words.size(); ++i) {
        const bool bare = corner && words[i] == '.' &&
                          std::isdigit(static_cast<unsigned char>(words[i - 1])) == 0;
        if (bare) clean += '0';
        clean += words[i];
      }
    }
    clean += '\n';
  }
  return clean;
}
#endif

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

std::string BytesOfMesh(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(stream), {});
  if (!stream.is_open() || stream.bad()) throw MeshError("cannot be read; look at its permissions");
  return bytes;
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
  std::string text = BytesOfMesh(file);
  if (text.empty()) throw MeshError("is empty; write it again");
  if (ending == ".stl") {
    CheckWholeStl(text);
  } else {
    text = ForAssimp(text);
  }
  Assimp::Importer importer;
  const aiScene* const scene =
      importer.ReadFileFromMemory(text.data(), text.size(), 0, ending.c_str() + 1);
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
