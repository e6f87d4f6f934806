#include "offline/model/spatial.h"

#include <cmath>

#include "common/core/functions.h"
#include "offline/model/hybrid_dynamics_body.h"

namespace tumbler {

Spatial::Rotation Spatial::RotationBy(const Axis& axis, double angle) {
  // Rodrigues' formula
  const auto [sine, c] = portable::SinCos(angle);
  const Vector s = sine * axis, v = (1 - c) * axis;
  const double xy = v.x() * axis.y(), xz = v.x() * axis.z(), yz = v.y() * axis.z();
  return {{{v.x() * axis.x() + c, xy + s.z(), xz - s.y()},
           {xy - s.z(), v.y() * axis.y() + c, yz + s.x()},
           {xz + s.y(), yz - s.x(), v.z() * axis.z() + c}}};
}

template class HybridDynamics<Spatial>;

}  // namespace tumbler
