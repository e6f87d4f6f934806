#pragma once

#include "common/core/primitive.h"

namespace tumbler {

/// The primitive in the scalar that the executor uses. Every number becomes the nearest float, and
/// nothing else is moved, so that ends, entry poses and seams stay consistent.
///
/// Rounding keeps the order of numbers, so positions and torques stay within their limits.
/// Velocities and accelerations are differences of rounded points and can exceed their limits by
/// rounding errors. Those limits are then widened to the rounded points, by 0.1 % at most, so that
/// the result holds its own limits exactly.
/// @throws std::invalid_argument  when rounding breaks a limit by more than that (the message names
/// joint, quantity and amount), merges knots, or a number does not fit a float.
Primitive<float> ToRuntime(const Primitive<double>& primitive);

}  // namespace tumbler
