#pragma once

#include <span>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/model/plane.h"
#include "offline/model/space_vector.h"
#include "offline/model/spatial.h"

namespace tumbler {

/// One instant of a simulated motion, for export and pictures.
template <class Space>
struct MotionSampleIn {
  double time_s = 0;
  /// Positions [m, rad] and velocities [m/s, rad/s] of all degrees of freedom. In space the angles
  /// of the root are 0, and their rates are its angular velocity about its own -y, x and z.
  std::vector<double> q, qd;
  /// Torques of the actuated joints' motors, friction included [N m].
  std::vector<double> torque;
  /// Valid during the call only.
  std::span<const ActiveContact<Space>> contacts;
  /// The dynamics in this state. Valid during the call only.
  const HybridDynamics<Space>* dynamics = nullptr;
  /// Of the root's frame in the world, in space; in the plane the pitch says all.
  SpaceMatrix orientation = SpaceMatrix::Identity();
};

using MotionSample = MotionSampleIn<Plane>;
using SpaceSample = MotionSampleIn<Spatial>;

}  // namespace tumbler
