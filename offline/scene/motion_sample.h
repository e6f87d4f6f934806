#pragma once

#include <span>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/model/plane.h"

namespace tumbler {

/// One instant of a simulated motion, for export and pictures.
struct MotionSample {
  double time_s = 0;
  /// Positions [m, rad] and velocities [m/s, rad/s] of all degrees of freedom.
  std::vector<double> q, qd;
  /// Torques of the actuated joints' motors, friction included [N m].
  std::vector<double> torque;
  /// Valid during the call only.
  std::span<const ActiveContact<Plane>> contacts;
  /// The dynamics in this state. Valid during the call only.
  const HybridDynamics<Plane>* dynamics = nullptr;
};

}  // namespace tumbler
