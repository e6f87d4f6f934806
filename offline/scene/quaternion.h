#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "offline/model/pose.h"
#include "offline/model/space_vector.h"

namespace tumbler {

/// A rotation of files and messages: the unit quaternion w, x, y, z.
using Quaternion = std::array<double, 4>;

/// @pre its length is 1.
inline SpaceMatrix ToRotation(const Quaternion& q) {
  return Pose::RotationOf(q[1], q[2], q[3], q[0]);
}

/// The quaternion of a rotation, with w >= 0, by the largest of its components.
inline Quaternion ToQuaternion(const SpaceMatrix& R) {
  const double trace = R.trace();
  Quaternion q{};
  if (trace > 0) {
    const double s = 2 * std::sqrt(1 + trace);
    q = {s / 4, (R(2, 1) - R(1, 2)) / s, (R(0, 2) - R(2, 0)) / s, (R(1, 0) - R(0, 1)) / s};
  } else {
    int i = 0;
    if (R(1, 1) > R(0, 0)) i = 1;
    if (R(2, 2) > R(i, i)) i = 2;
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const double s = 2 * std::sqrt(std::max(0.0, 1 + R(i, i) - R(j, j) - R(k, k)));
    const auto at = [](int axis) { return static_cast<std::size_t>(axis) + 1; };
    q[0] = (R(k, j) - R(j, k)) / s;
    q[at(i)] = s / 4;
    q[at(j)] = (R(j, i) + R(i, j)) / s;
    q[at(k)] = (R(k, i) + R(i, k)) / s;
  }
  if (q[0] < 0) {
    for (double& part : q) part = -part;
  }
  return q;
}

}  // namespace tumbler
