#pragma once

#include "offline/model/plane.h"
#include "offline/model/shape.h"

namespace tumbler {

/// The distance of two shapes.
template <class Space>
struct SignedDistance {
  /// Between the surfaces [m]. Where the shapes overlap it is minus the shortest way by which
  /// moving one frees it from the other, also where their cores cross.
  double d = 0;
  typename Space::Vector u;  ///< Unit vector, along which moving a changes d fastest.
  /// Where they meet. When both move, d changes at the rate of u times the difference between the
  /// velocities of a's and b's body at this point.
  typename Space::Vector point;
};

/// Differentiable except where the nearest points jump. No heap.
/// @pre neither is a half-space.
template <class Space>
SignedDistance<Space> FindSignedDistance(const PosedShape<Space>& a, const PosedShape<Space>& b);

}  // namespace tumbler
