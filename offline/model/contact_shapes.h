#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "offline/model/contact_shape.h"
#include "offline/model/plane.h"

namespace tumbler {

struct Robot;
struct RobotShape;
struct Spatial;

/// A direction counts as along y, or across it, when it is off by less than this angle [rad]. So
/// much comes from the digits of a file, and is not meant.
inline constexpr double kPlaneTolerance = 1e-6;

/// A collision shape of the file that the contact model does not use, and the reason.
struct IgnoredShape {
  std::string link, shape;  ///< The shape: `LINK/INDEX`.
  std::uint32_t line = 0;
  std::string reason;  ///< What follows its name in a sentence.
  bool mesh = false;   ///< Whether points could take its place (WithMeshPoints).
};

/// The collision shapes of a robot for the contact model.
template <class Space>
struct ContactShapes {
  std::vector<ContactShape<Space>> shapes;
  std::vector<IgnoredShape> ignored;
};

/// A shape that a body of the robot fills, for its distance from the robot's other bodies.
struct OwnShape {
  std::string name;    ///< `LINK/INDEX`; of a shape that is only drawn, `LINK/visual/INDEX`.
  std::string link;    ///< The link of the file.
  int body = 0;        ///< Index of the degree of freedom that moves it; -1 is the world.
  Shape<Plane> shape;  ///< Its outline in the body's x-z plane.
  /// Where it is across the plane. The robot moves in the plane, so this never changes.
  double y_min_m = 0, y_max_m = 0;
  bool drawn_only = false;  ///< Whether it is a visual shape, and no collision shape is the same.
};

/// The shapes in space. Spheres and boxes stay as they are. A cylinder becomes the capsule of the
/// same radius and the same overall length, with rounded ends. Ignored are cylinders that are
/// shorter than wide, which have no such capsule, meshes, and shapes that are fixed to the world.
ContactShapes<Spatial> SpatialContactShapes(const Robot& robot);

/// The outlines of the shapes in the x-z plane: a disc for a sphere, and for a cylinder of any
/// length along y; a capsule for another cylinder; a rectangle for a box with a side along y. Other
/// boxes are ignored.
ContactShapes<Plane> PlanarContactShapes(const Robot& robot);

/// A shape in space as SpatialContactShapes has it, and of a cylinder that has none there, a box
/// around it. Empty for meshes.
std::optional<Shape<Spatial>> SpatialOutline(const RobotShape& shape);

/// The outline of a shape in the x-z plane as PlanarContactShapes has it, and of a box or a
/// cylinder that has none there, a rectangle around it. Empty for meshes.
std::optional<Shape<Plane>> PlanarOutline(const RobotShape& shape);

/// What the robot's bodies fill: the outlines of its collision shapes, those fixed to the world
/// included, and of the visual shapes that have an outline and are no copy of a collision shape.
std::vector<OwnShape> PlanarOwnShapes(const Robot& robot);

}  // namespace tumbler
