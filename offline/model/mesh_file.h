#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "offline/model/space_vector.h"

namespace tumbler {

/// Says of the file of a mesh why it cannot be used, and what to do.
struct MeshError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The file of a mesh as a robot file names it: an absolute path or `file://`, a path from the
/// robot file's folder, or `package://NAME/...`, which is looked for in that folder and in all
/// above it: with NAME, and as if the package's own folder had another name; `model://` likewise.
/// Empty: there is none.
std::string FindMesh(const std::string& named, const std::string& robot_file);

/// The bytes of a file. @throws MeshError  where it cannot be read.
std::string BytesOfMesh(const std::string& file);

/// The corners of a mesh in its own frame, one after the other as its faces have them. They need
/// not be finite.
/// @throws MeshError  where it is neither STL nor OBJ, is too large, cannot be read or has no
///                    corner, and in a build without assimp.
std::vector<SpaceVector> ReadMesh(const std::string& file);

}  // namespace tumbler
