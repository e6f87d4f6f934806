#pragma once

#include <map>
#include <string>
#include <vector>

#include "offline/model/joint_limits.h"

namespace tumbler {

/// Joints that are held where a task has them, and where that is [rad, m]. The links that such a
/// joint connects are one body.
using LockedJoints = std::map<std::string, double>;

/// A joint that is held.
struct LockedJoint {
  std::string name;
  double position_rad = 0;  ///< m where it is prismatic.
  RobotJointLimits limits;  ///< By the file: where it could be. A joint of no such type is at 0.
  std::string with;         ///< The joint that it follows, with which it was locked; empty: itself.

  bool operator==(const LockedJoint& other) const {
    return name == other.name && position_rad == other.position_rad;
  }
};

/// The same joints, for reading the robot again.
inline LockedJoints PositionsOf(const std::vector<LockedJoint>& locked) {
  LockedJoints positions;
  for (const LockedJoint& joint : locked) positions.emplace(joint.name, joint.position_rad);
  return positions;
}

}  // namespace tumbler
