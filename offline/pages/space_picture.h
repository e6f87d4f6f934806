#pragma once

#include <array>
#include <string>
#include <vector>

#include "offline/pages/space_page.h"

namespace tumbler {

/// A parallel projection. World: x right, z up, y away from who sees it from the side.
struct SpaceView {
  SpaceVector right, up, toward;  ///< Unit vectors in the world; the last one to the viewer.

  /// @param azimuth_rad    of the viewer: 0 is the side, from -y; pi/2 the front, from +x.
  /// @param elevation_rad  of the viewer: 0 is level, pi/2 above.
  static SpaceView From(double azimuth_rad, double elevation_rad);

  /// Right, up and towards the viewer [m].
  friend SpaceVector operator*(const SpaceView& view, const SpaceVector& point) {
    return {view.right.dot(point), view.up.dot(point), view.toward.dot(point)};
  }
};

/// A box along the world's axes [m].
struct SpaceExtent {
  SpaceVector low, high;

  static SpaceExtent None();
  void Add(const SpaceVector& point);
  [[nodiscard]] SpaceVector size() const { return high - low; }
  [[nodiscard]] SpaceVector middle() const { return 0.5 * (low + high); }
};

/// The extent of the robot in a frame.
SpaceExtent ExtentOf(const SpaceMotionPage& page, const SpaceFrame& frame);

/// The part of a half-space's surface that is drawn, with its grid: the points
/// origin + s along_s + t along_t of a range. On ground, s and t are the world's x and y, so that
/// the shadow of a point straight above has the point's x and y.
struct SpaceCarpet {
  SpaceVector origin, along_s, along_t, normal;
  std::array<double, 2> s, t;  ///< From, to: multiples of `step_m`.
  double step_m = 0;           ///< Of the grid.
  /// The part of the range that is not inside other half-spaces: corners of a convex polygon.
  std::vector<std::array<double, 2>> outline;
  bool ground = false;  ///< Otherwise it is a wall, on which nothing has a shadow.
};

/// The carpets of all half-spaces around an extent, as far as they are not inside each other.
std::vector<SpaceCarpet> CarpetsOf(const SpaceMotionPage& page, const SpaceExtent& around,
                                   double step_m);

/// 1, 2 or 5 times a power of ten, at most this number.
double NiceBelow(double value);

/// `#rrggbb` of each body.
std::vector<std::string> BodyColours(const SpaceMotionPage& page);
/// `#rrggbb` of obstacles.
inline constexpr const char* kObstacleColour = "#a8a194";

/// Where a picture is, and how large.
struct SpaceCamera {
  SpaceView view;
  SpaceVector target;     ///< This point of the world is at (0, 0) of the picture.
  double px_per_m = 100;  ///< y of the picture is down.
  double m_per_n = 0;     ///< Length of the arrow of a force; 0: none are drawn.
};

/// Elements of SVG: carpets, shadows, solids from back to front, and forces.
///
/// Solids that touch a box are wholly in front of it or behind it, as their middle is; long
/// capsules are cut into pieces. That is right where they do not go through each other.
///
/// A carpet of which the back is seen has its grid alone.
///
/// Their classes are `carpet`, `grid`, `shadow` and `force`; their gradients are those of
/// SolidGradients.
std::string PaintFrame(const SpaceMotionPage& page, const SpaceFrame& frame,
                       const std::vector<SpaceCarpet>& carpets, const SpaceCamera& camera);

/// The gradients that PaintFrame refers to, for a `defs`.
std::string SolidGradients(const SpaceMotionPage& page);

}  // namespace tumbler
