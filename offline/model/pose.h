#pragma once

#include "offline/model/space_vector.h"

namespace tumbler {

/// Where a frame is in another one.
struct Pose {
  SpaceMatrix rotation = SpaceMatrix::Identity();
  SpaceVector translation = SpaceVector::Zero();

  /// The rotation of the unit quaternion w + x i + y j + z k.
  static SpaceMatrix RotationOf(double x, double y, double z, double w) {
    const double tx = 2 * x, ty = 2 * y, tz = 2 * z;
    return {{1 - (ty * y + tz * z), ty * x + tz * w, tz * x - ty * w},
            {ty * x - tz * w, 1 - (tx * x + tz * z), tz * y + tx * w},
            {tz * x + ty * w, tz * y - tx * w, 1 - (tx * x + ty * y)}};
  }

  friend SpaceVector operator*(const Pose& a, const SpaceVector& point) {
    return a.rotation * point + a.translation;
  }
  /// Where a frame is whose pose in the frame of `a` is b.
  friend Pose operator*(const Pose& a, const Pose& b) {
    return {a.rotation * b.rotation, a * b.translation};
  }
};

}  // namespace tumbler
