#pragma once

#include <array>

#include "common/core/index.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// The control points of a path that its ends fix, the first three and the last three: where q and
/// qd are given, and qdd is zero [rad].
///
/// They follow from the points of the derivative, c'_i = p (c_{i+1} - c_i) / (u_{i+p+1} - u_{i+1}),
/// of which the first two and the last two are equal to the velocity. So they change linearly with
/// the duration.
struct EndPoints {
  std::array<double, 3> first{}, last{};

  /// The point i of n, which is one of these.
  [[nodiscard]] double At(int i, int n) const {
    return i < 3 ? first[Index(i)] : last[Index(i - n + 3)];
  }
};
EndPoints EndPointsOf(const ActuatedJoint& joint, int degree, double duration_s);
/// Their derivatives by the duration [rad/s].
EndPoints EndPointSlopes(const ActuatedJoint& joint, int degree);

}  // namespace tumbler
