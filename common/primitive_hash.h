#pragma once

#include <string>
#include <string_view>

#include "common/primitive.h"

namespace tumbler {

/// FNV-1a (64 bit) of a text as `fnv1a64:` and 16 hexadecimal digits. It finds accidents, not
/// forgeries.
std::string HashOfText(std::string_view text);

/// The same hash of everything that the runtime plays: names, duration, settle time, tolerances,
/// limits, degrees, knots and coefficients, each double by its bits.
std::string HashOfCoefficients(const Primitive<double>& primitive);

}  // namespace tumbler
