#include "offline/dynamics/spatial.h"

#include <Eigen/Geometry>

namespace tumbler {

Spatial::Rotation Spatial::RotationBy(const Axis& axis, double angle) {
  return {Eigen::AngleAxisd(angle, axis).toRotationMatrix()};
}

}  // namespace tumbler
