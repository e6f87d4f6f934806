#pragma once

#include <string>
#include <vector>

#include "offline/model/outline.h"
#include "offline/model/planar_robot.h"

namespace tumbler {

/// The convex hull of a mesh in the plane of its body, for pictures, with 32 corners at most: of
/// more, those go that it loses least with. Empty where there is no such file, where it is neither
/// STL nor OBJ, or cannot be read, and in a build without assimp.
Outline MeshOutline(const DrawnMesh& mesh, const std::string& robot_file);

/// The convex hull of points, counter-clockwise and without corners on its sides.
std::vector<Plane::Vector> ConvexHull(std::vector<Plane::Vector> points);

}  // namespace tumbler
