#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "offline/problem/simulated_motion.h"
#include "offline/scene/motion_sample.h"

namespace tumbler {

/// How a sequence is played in simulation.
struct ChainOptions {
  int cycles = 20;     ///< End after so many (see NextEdge) ...
  std::string branch;  ///< ... or, if there is a name here, go on from then on until this branch.
  /// How long the last node is held [s]. Recorded exits are where the robot is after so long.
  double last_hold_s = 2;
  double step_s = 0;  ///< Integration step; 0: that of each primitive's task.
};

/// Where the root stands, roughly.
enum class Posture {
  kUpright,   ///< Within 0.1 rad of a right angle to the ground.
  kLevel,     ///< Within 0.1 rad of parallel to it.
  kInclined,  ///< Neither.
};
const char* ToString(Posture posture);

/// One node, as it was played: the motion and the hold after it.
struct Passage {
  int node = 0;
  double start_s = 0;
  double hold_s = 0;
  /// Where the robot begins, less the entry pose that the primitive was made for. Pitch without
  /// whole turns and, like that of the exit, in the role that the node plays.
  double entry_z_error_m = 0;
  double entry_pitch_error_rad = 0;
  double entry_speed = 0;  ///< Largest of the root's velocities then [m/s, rad/s].
  /// Where it is at the end of the hold, less the exit pose recorded in the primitive.
  double exit_z_error_m = 0;
  double exit_pitch_error_rad = 0;
  double exit_speed = 0;
  Posture posture = Posture::kInclined;  ///< At the end of the hold.
  double peak_torque_nm = 0;             ///< Of any joint, at every integration step.
  double torque_margin_nm = 0;  ///< Smallest limit less |torque|; a real drive would saturate at 0.
  double peak_penetration_m = 0;  ///< Into the compliant layer.
  double travelled_m = 0;         ///< Of the root, along x.
  double turned_rad = 0;          ///< Of the root, whole turns included.
};

/// Why a chain ended before its time.
struct ChainFailure {
  enum class Cause {
    kImplausible,  ///< The state left every plausible range.
    kCore,         ///< A contact went through the whole compliant layer.
    kTouch,        ///< A body touched something that it never touches in the plan.
    kFallen,       ///< The root turned far from where it is when the primitive is played alone.
    kExit,         ///< At the end of the hold, the pitch was out of the node's tolerance.
    kEntry,        ///< Height or pitch were out of the tolerances when the next node was to begin.
  };
  Cause cause = Cause::kImplausible;
  int node = 0;
  double time_s = 0;
  std::string text;  ///< What it was, with amounts.
};
const char* ToString(ChainFailure::Cause cause);

/// What became of it.
struct ChainOutcome {
  std::vector<Passage> passages;  ///< Complete ones, and the one that failed.
  std::optional<ChainFailure> failure;
  int cycles = 0;  ///< Complete ones.
  double duration_s = 0;
  double travelled_m = 0;
};

/// @throws FileError naming the first primitive whose task has other contacts or obstacles than
/// that of the first: a sequence is played on one ground.
void RequireSameGround(const SimulatedMotion& motion);

/// Plays a sequence in the nominal simulation: the dynamics, contacts and obstacles of the
/// primitives' tasks, joints exactly on their paths, RK4 with a fixed step as in Rollout. It begins
/// at rest in the entry pose of the first node; from then on the state is carried from primitive to
/// primitive, through the holds between them, and never reset. It is the robot itself that is
/// simulated: in a swapped node its joints follow each other's paths, and nothing assumes that it
/// looks the same.
/// @param visitor  called at every integration step, with the node; may be empty.
/// @throws FileError when a primitive's texts cannot be used, or as RequireSameGround does;
/// std::invalid_argument when the branch is not in the sequence, or the sequence would never end.
ChainOutcome SimulateChain(const SimulatedMotion& motion, const ChainOptions& options,
                           const std::function<void(int, const MotionSample&)>& visitor = {});

}  // namespace tumbler
