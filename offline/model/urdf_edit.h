#pragma once

#include <span>
#include <string>

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

}  // namespace tumbler
