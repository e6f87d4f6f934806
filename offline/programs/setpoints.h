#pragma once

#include <string>

#include "common/files/primitive_toml.h"
#include "common/files/sequence_toml.h"

namespace tumbler {

/// How a motion is played for a simulator that others wrote.
struct SetpointOptions {
  /// Setpoints a second; each holds until the next, as a drive has it.
  double rate_hz = 1000;
  /// How long the start is held first, so that the robot comes to rest on the simulator's ground.
  double lead_s = 1;
  /// How long the last pose is held.
  double last_hold_s = 2;
  /// Ends after this many cycles of a sequence, or at the branch after them (PlannedRequest).
  int cycles = 1;
  std::string branch;
};

/// The setpoints of a motion as CSV, for drives whose torque is kp (position - q) + kd (velocity -
/// q') + feed-forward torque, within the joint's limit: time, the node that is played, and of each
/// joint of the robot position, velocity, feed-forward torque, and `ctrl`, which is kp position +
/// kd velocity + torque as the actuators of ToMjcf take it. Positions and torques are those of the
/// primitives' splines, with the roles of swapped nodes; while a pose is held, the velocity is zero
/// and the torque that of the motion's end, as in the executor. Nothing limits them: they are
/// within the limits.
/// @throws std::invalid_argument  when the branch is not in the sequence, or it would never end.
std::string SetpointsCsv(const SequenceFile& file, const DriveGains& gains,
                         const SetpointOptions& options);

}  // namespace tumbler
