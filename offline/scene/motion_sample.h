#pragma once

#include <span>
#include <vector>

#include "offline/contact/contact_forces.h"
#include "offline/dynamics/plane.h"

namespace tumbler {

/// One instant of a simulated motion, for export and pictures.
struct MotionSample {
  double time_s = 0;
  std::vector<double> q, qd;                        ///< All degrees of freedom.
  std::vector<double> torque;                       ///< Of the actuated joints.
  std::span<const ActiveContact<Plane>> contacts;   ///< Valid during the call only.
  const HybridDynamics<Plane>* dynamics = nullptr;  ///< At this state; valid during the call only.
};

}  // namespace tumbler
