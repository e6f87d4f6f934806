#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace tumbler {

struct Robot;

/// The points with which each mesh of a robot touches, as many as a task may ask for.
inline constexpr int kFewestMeshPoints = 4, kMostMeshPoints = 64;

/// A mesh that is in contact as points.
struct MeshInContact {
  std::string shape;  ///< `LINK/INDEX`
  std::string link;
  std::uint32_t line = 0;  ///< Line of the link in the file.
  std::string file;        ///< As the robot's file names it.
  std::size_t points = 0;
  double beyond_m = 0;  ///< So far the mesh sticks out of the convex hull of the points.
};
/// For people: "collision mesh leg/0 (leg.stl) touches with 16 points, out of whose hull it sticks
/// by up to 0.31 mm".
std::string Describe(const MeshInContact& mesh);

/// A robot whose meshes are points.
struct RobotOfPoints {
  std::string urdf;
  std::vector<MeshInContact> meshes;  ///< In the order of the robot's shapes.
};

/// Makes of each collision mesh that moves up to so many corners of its convex hull, as spheres of
/// radius 0 (`WithPoints`); of a robot in the plane, of its outline there. The text then holds all
/// that contact needs: no file of a mesh is read for it any more.
/// @param urdf   the text of `robot`.
/// @param robot  names its file, from where meshes are looked for, and has the root and the locked
///               joints with which it is used.
/// @param most   points of each mesh, from kFewestMeshPoints to kMostMeshPoints.
/// @throws RobotFileError  with line and link of each mesh that cannot be used: there is no such
/// file, it cannot be read (ReadMesh), has corners that are not finite, is flat, or smaller or
/// larger than a part of a robot.
RobotOfPoints WithMeshPoints(const std::string& urdf, const Robot& robot, std::size_t most);

}  // namespace tumbler
