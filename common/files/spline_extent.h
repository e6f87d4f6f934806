#pragma once

#include <array>
#include <vector>

#include "common/core/primitive.h"

namespace tumbler {

/// The range of a curve over its whole time.
///
/// A curve lies within the smallest and the largest of its control points, but mostly far inside:
/// the velocity of a motion reaches half of its largest control point. Where a curve is cut into
/// pieces, the control points of the pieces come nearer to it, by the square of their number
/// [PT97, 5.3]. What they bound is bounded for all t.
///
/// Offline, and before a loop starts: with heap.
///
/// [Ram89] L. Ramshaw, Blossoms are polar forms, 1989.
/// [PT97] L. Piegl, W. Tiller, The NURBS Book, 2nd edition, 1997.
struct Extent {
  double min = 0;
  double max = 0;
  double min_at_s = 0;  ///< A time at which the curve is as small, but for what is said below
  double max_at_s = 0;  ///< or as large.
};

/// Encloses derivative d of a spline, 0 <= d <= its kMaxDerivative, for all t. It is wider than the
/// curve by at most 1e-9 of the largest control point of the derivative.
template <typename Scalar>
Extent ExtentOf(const BSpline<Scalar, kMaxControlPoints>& spline, int d);

/// The control points of derivative d, 0 <= d <= kMaxDerivative, after each of its spans was cut
/// into `parts` of the same length: (parts - 1) more of them for each span. They are linear in the
/// spline's own control points.
std::vector<double> RefinedControlPoints(const BSpline<double, kMaxControlPoints>& spline, int d,
                                         int parts);

extern template Extent ExtentOf(const BSpline<double, kMaxControlPoints>& spline, int d);
extern template Extent ExtentOf(const BSpline<float, kMaxControlPoints>& spline, int d);

}  // namespace tumbler
