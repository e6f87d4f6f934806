#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "offline/contact/contact_shape.h"

namespace tumbler {

struct Plane;
struct Robot;
struct Spatial;

/// A direction counts as along y, or across it, when it is off by less than this angle [rad]. So
/// much comes from the digits of a file, and is not meant.
inline constexpr double kPlaneTolerance = 1e-6;

/// A collision shape of the file that the contact model does not use, and the reason.
struct IgnoredShape {
  std::string link;
  std::uint32_t line = 0;
  std::string reason;
};

/// The collision shapes of a robot for the contact model.
template <class Space>
struct ContactShapes {
  std::vector<ContactShape<Space>> shapes;
  std::vector<IgnoredShape> ignored;
};

/// The shapes in space. Spheres and boxes stay as they are. A cylinder becomes the capsule of the
/// same radius and the same overall length, with rounded ends. Ignored are cylinders that are
/// shorter than wide, which have no such capsule, meshes, and shapes that are fixed to the world.
ContactShapes<Spatial> SpatialContactShapes(const Robot& robot);

/// The outlines of the shapes in the x-z plane: a disc for a sphere, and for a cylinder of any
/// length along y; a capsule for another cylinder; a rectangle for a box with a side along y. Other
/// boxes are ignored.
ContactShapes<Plane> PlanarContactShapes(const Robot& robot);

}  // namespace tumbler
