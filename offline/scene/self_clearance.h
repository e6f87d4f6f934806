#pragma once

#include <limits>
#include <vector>

#include "offline/contact/contact_shape.h"
#include "offline/dynamics/hybrid_dynamics.h"
#include "offline/dynamics/plane.h"
#include "offline/model/planar_robot.h"

namespace tumbler {

/// The pairs of a robot's contact shapes that have to stay apart: those on different bodies that no
/// joint connects. Shapes of neighbours meet at their joint by design.
std::vector<ContactPair> SeparatePairs(const PlanarRobot& robot);

/// The nearest two of a robot's own shapes, in the plane of motion.
struct SelfClearance {
  /// Negative where the shapes overlap. Infinite for a robot without such pairs.
  double distance_m = std::numeric_limits<double>::infinity();
  ContactPair pair;  ///< Indices into the robot's shapes.
};

/// @param dynamics  the robot's, in the state that is looked at.
SelfClearance FindSelfClearance(const PlanarRobot& robot, const std::vector<ContactPair>& pairs,
                                const HybridDynamics<Plane>& dynamics);

}  // namespace tumbler
