#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "offline/model/space_vector.h"

namespace tumbler {

/// A link's inertia, as it is to be.
struct LinkInertia {
  std::string link;
  double mass_factor = 1;     ///< Of mass and moments.
  double moment_factor = 1;   ///< Of the moments, besides.
  double centre_shift_m = 0;  ///< Added to the centre of mass, along the link's x.
};

/// A URDF in which links have other inertias. All else stays, but for the layout of the text.
/// @param name  stands for the file in messages.
/// @throws FileError  when the text is no XML, or a link or its inertia is missing.
std::string WithInertias(const std::string& urdf, const std::string& name,
                         std::span<const LinkInertia> links);

/// A collision shape that becomes points.
struct ShapeAsPoints {
  std::string link;
  std::size_t index = 0;            ///< Of the shape among the link's collision shapes.
  std::vector<SpaceVector> points;  ///< In the link's frame; at least one.
};

/// A URDF in which collision shapes are spheres of radius 0 that are named `kMeshPoint`. The first
/// point of a shape takes its place and the others come behind the link's other collision shapes,
/// so that all others keep their indices. All else keeps its text and line.
/// @param name  stands for the file in messages.
/// @throws FileError  when the text is no URDF, or a link or its shape is missing.
std::string WithPoints(const std::string& urdf, const std::string& name,
                       std::span<const ShapeAsPoints> shapes);

}  // namespace tumbler
