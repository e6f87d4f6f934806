#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace tumbler {

/// How far a point is from the convex hull of points; 0 inside [m].
/// @tparam Vector  of the plane or of space.
/// @pre there is a point, and all are finite.
template <class Vector>
double DistanceFromHull(const Vector& point, std::span<const Vector> points);

/// Some of many points, whose convex hull is nearly that of all.
struct HullPoints {
  std::vector<std::size_t> chosen;  ///< Indices of points that are corners of the hull of all.
  double beyond_m = 0;              ///< How far any of the others is from the hull of these.
};

/// Chooses corners of a hull one after the other, each the one that is farthest from the hull of
/// those before. It ends early where the rest is within a millionth of the hull's size.
/// @param most  that are chosen, 1 or more.
/// @pre there is a point, and all are finite.
template <class Vector>
HullPoints ChooseHullPoints(std::span<const Vector> points, std::size_t most);

}  // namespace tumbler
