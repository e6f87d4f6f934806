#pragma once

#include "offline/problem/simulated_motion.h"
#include "offline/twin/twin.h"

namespace tumbler::testing {

/// The contacts of MuJoCo: its `solref`, on the ground that is the model.
struct MujocoContacts {
  double time_constant_s = 0.02;  ///< It goes with the inverse root of the ground's stiffness.
  double damping_ratio = 1;
  /// Of that ground. One with other stiffness and damping has contacts that differ by as much.
  ContactLaw model;
};

/// MuJoCo in place of our own physics, behind our drives and their bus. The robot is the one that
/// tumbler export writes, with the friction of the scene's ground. Steps are as long as the twin's,
/// 50 us, and in each of them a drive computes its torque anew.
/// @param motion  of a robot in the plane.
TwinEngine MujocoEngine(const SimulatedMotion& motion, const MujocoContacts& contacts);

}  // namespace tumbler::testing
