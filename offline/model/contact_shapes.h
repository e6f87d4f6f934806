#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "offline/contact/contact_shape.h"

namespace tumbler {

struct Plane;
struct Robot;
struct Spatial;

/// A collision shape of the file that the contact model does not use, and why.
struct IgnoredShape {
  std::string link;
  std::uint32_t line = 0;
  std::string reason;
};

/// The collision shapes of a robot as contact sees them.
template <class Space>
struct ContactShapes {
  std::vector<ContactShape<Space>> shapes;
  std::vector<IgnoredShape> ignored;
};

/// Spheres and boxes are what they are. A cylinder becomes the capsule of the same radius and the
/// same overall length, its ends rounded; one that is shorter than wide has none and is ignored, as
/// are meshes and what is fixed to the world.
ContactShapes<Spatial> SpatialContactShapes(const Robot& robot);

/// Their outlines in the x-z plane: of a sphere a disc, of a capsule a capsule (a disc where it
/// lies along y, as does a cylinder of any length), of a box with a side along y a rectangle. Any
/// other box is ignored.
ContactShapes<Plane> PlanarContactShapes(const Robot& robot);

}  // namespace tumbler
