#pragma once

#include <string>

namespace tumbler {

/// A URDF whose links have `factor` times their mass, and inertia with it: of the same shape and
/// another density. Its numbers read back to the last bit; comments stay.
/// @param file  stands for the file in messages.
/// @param link  the only link that changes; empty: all.
/// @param factor  above 0.
/// @throws FileError  when the text is not a URDF, or has no such link with a mass.
std::string WithMassTimes(double factor, const std::string& link, const std::string& urdf,
                          const std::string& file);

}  // namespace tumbler
