#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/core/index.h"
#include "offline/model/shape.h"

namespace tumbler {

/// The near points of two shapes a and b, [AB04, Eqs. 10 and 23-25], with a signed distance.
///
/// The paper's p_rob and p_obs are p_a and p_b here. They lie on the surfaces: they are the near
/// points x_a and x_b of the two cores, moved by the swept radii along the normal. So the normal is
/// defined in penetration too, until the cores themselves overlap.
template <class Space>
struct NearPoints {
  using Vector = typename Space::Vector;
  static constexpr int kDimension = Vector::RowsAtCompileTime;

  Vector p_a, p_b;
  double d = 0;  ///< Distance [m], negative in penetration.
  Vector u_d;    ///< Unit normal, from b to a.
  /// Whether the cores overlap, so that no normal follows from the near points. Then d is minus the
  /// sum of the radii, u_d points from the centre of b to that of a (up, if they coincide), and p_a
  /// and p_b are one point.
  bool overlap = false;
  /// Whether the near points are unique. Between parallel edges or faces they are not; then those
  /// nearest to the centres of their cores are given (least sum of squares).
  bool unique = true;
  /// The active set, [AB04, Eq. 30], of each core's coordinates: -1 or +1 at that bound (and always
  /// where the extent is zero, an equality constraint), 0 between the bounds.
  IntArray<std::int8_t, kDimension> active_a{}, active_b{};
  double core_distance_m = 0;  ///< |x_a - x_b|
};

/// Derivatives of near points when a is displaced and b stays: one entry for each basis motion of
/// the space about the origin of the coordinates in use. Those for a displacement of b follow from
/// them, since displacing both moves everything rigidly.
template <class Space>
struct NearPointsDerivative {
  static constexpr std::size_t kMotions = Space::kMotions;
  std::array<typename Space::Vector, kMotions> p_a, p_b, u_d;
  std::array<double, kMotions> d{};
};

/// The near points of two shapes, at most one of them a half-space: [AB04, Eqs. 23-25] as the
/// bounded least squares problem in the coordinates of both cores. Exact to rounding, no heap.
template <class Space>
NearPoints<Space> FindNearPoints(const PosedShape<Space>& a, const PosedShape<Space>& b);

/// The derivatives of near points by the Kuhn-Tucker system, [AB04, Eqs. 28-32]. With x = (x_a,
/// x_b), f = |x_a - x_b|^2, and one row (K x + b = 0, or D x + b = 0) for every constraint that
/// holds with equality,
///
///   H (x, lambda, mu) = [ Q K^T D^T; K 0 0; D 0 0 ] (x, lambda, mu) = (0, -b_1, -b_2)       (31)
///   d(x, lambda, mu) = H^-1 ( (0, -db_1, -db_2) - dH (x, lambda, mu) )                      (32)
///
/// The paper prints +b on the right side of (31), which contradicts its own (26) and (29).
///
/// In two cases there is no derivative, and the result is a substitute: where the near points are
/// not unique, H is singular, and the least of all solutions is taken; where the cores overlap, the
/// normal stays and a's point moves with a. No heap.
template <class Space>
NearPointsDerivative<Space> DifferentiateNearPoints(const PosedShape<Space>& a,
                                                    const PosedShape<Space>& b,
                                                    const NearPoints<Space>& near);

}  // namespace tumbler
