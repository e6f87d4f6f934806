#pragma once

#include <cstddef>

#include "offline/model/tree.h"
#include "offline/problem/problem.h"

namespace tumbler {

/// What the quantities of a joint are measured in, for messages. (Names of keys say those of a
/// joint that turns.)
struct JointUnits {
  const char* position;
  const char* velocity;
  const char* force;  ///< Or torque.
};

constexpr JointUnits UnitsOf(JointKind kind) {
  return kind == JointKind::kPrismatic ? JointUnits{"m", "m/s", "N"}
                                       : JointUnits{"rad", "rad/s", "N m"};
}

inline JointUnits UnitsOf(const Problem& problem, const ActuatedJoint& joint) {
  return problem.WithScene([&joint](const auto& scene) {
    return UnitsOf(scene.robot.tree.dofs[static_cast<std::size_t>(joint.dof)].kind);
  });
}

}  // namespace tumbler
