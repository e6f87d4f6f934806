#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/files/purpose.h"
#include "offline/problem/simulated_motion.h"
#include "offline/scene/motion_sample.h"

namespace tumbler {

/// Options for playing a sequence in simulation.
struct ChainOptions {
  /// The chain ends after this many cycles (see NextEdge), unless a branch is named.
  int cycles = 20;
  /// When a branch is named, the chain goes on after its cycles until it can take this branch.
  std::string branch;
  /// How long the last node is held. The exit recorded in a primitive is where the robot is after
  /// 2 s. A motion that ends in motion is not held, and one on a bar until what it is for has been
  /// judged, at most so long.
  double last_hold_s = 2;
  /// Integration step; 0: the step of each primitive's task.
  double step_s = 0;
};

/// The inclination of the root, roughly, or where the centre of mass of a robot on a bar is. In
/// space a root is level whose z is vertical, up or down.
enum class Posture {
  kUpright,   ///< Within 0.1 rad of a right angle to the ground.
  kLevel,     ///< Within 0.1 rad of parallel to the ground.
  kInclined,  ///< Neither; or on a bar, neither of the next two.
  kHanging,   ///< Within 0.1 rad of straight below the bar, seen from there.
  kAbove,     ///< Likewise above it.
  kFixed,     ///< Always that of a root that is fixed to the world.
};
const char* ToString(Posture posture);

/// One node as it was played: the motion, and the hold after it.
struct PlayedNode {
  int node = 0;
  double start_s = 0;
  double hold_s = 0;
  /// The root's pose at the start, less the entry pose of the primitive. Errors of pitch leave out
  /// whole turns and are in the role that the node plays; in space they are angles between what is
  /// vertical in both frames (TiltBetween).
  double entry_z_error_m = 0;
  double entry_pitch_error_rad = 0;
  /// The largest of the root's velocities at the start [m/s, rad/s].
  double entry_speed = 0;
  /// The root's pose at the end of the hold, less the exit pose recorded in the primitive.
  double exit_z_error_m = 0;
  double exit_pitch_error_rad = 0;
  /// The largest of the root's velocities at the end of the hold [m/s, rad/s].
  double exit_speed = 0;
  /// The posture at the end of the hold.
  Posture posture = Posture::kInclined;
  /// The largest |torque| of any joint's motor at any integration step.
  double peak_torque_nm = 0;
  /// The smallest limit at a motor's speed less |torque|. A real drive would saturate at 0.
  double torque_margin_nm = 0;
  /// The deepest penetration into the compliant layer.
  double peak_penetration_m = 0;
  /// How far the root moved along x; in space, in any level direction.
  double travelled_m = 0;
  /// How far the root turned, whole turns included; in space about the vertical, as the sum of all
  /// small turns.
  double turned_rad = 0;
  /// What the motion is for, each target at its instant, in the coordinates of its task: as if it
  /// had begun where its primitive begins, in space also with the heading that it has there. What
  /// is asked for at the end of the settle phase and later is taken just before the next motion
  /// begins, where there is one. Of a target whose instant the chain did not reach there is no
  /// result.
  std::vector<JudgedTarget> purpose;
};

/// Why a chain ended before its time.
struct ChainFailure {
  enum class Cause {
    kImplausible,  ///< The state left every plausible range.
    kCore,         ///< A contact went through the whole compliant layer.
    kTouch,        ///< A body touched something that it never touches in the plan.
    kOverlap,      ///< Shapes of the robot that are to stay apart went through each other.
    kStop,         ///< A joint without a motor went beyond its limits.
    kFallen,       ///< The root turned far from where it is when the primitive is played alone.
    kExit,         ///< At the end of the hold, pitch or tilt were out of the node's tolerance.
    kPurpose,      ///< A target of what the motion is for was missed.
    kEntry,        ///< Height, pitch or tilt did not fit when the next node was to begin.
  };
  Cause cause = Cause::kImplausible;
  int node = 0;
  double time_s = 0;
  /// The cause for people, with amounts.
  std::string text;
};
const char* ToString(ChainFailure::Cause cause);

/// The outcome of a chain.
struct ChainOutcome {
  /// All complete passages, and the one that failed.
  std::vector<PlayedNode> passages;
  std::optional<ChainFailure> failure;
  /// Number of complete cycles.
  int cycles = 0;
  double duration_s = 0;
  double travelled_m = 0;  ///< From the start to the end, as of a passage.

  /// How many targets were judged in the passages, and how many were not.
  struct Judged {
    int judged = 0, not_judged = 0;
  };
  [[nodiscard]] Judged CountJudged() const;
};

/// Plays a sequence in the nominal simulation: the dynamics, contacts and obstacles of the
/// primitives' tasks, joints exactly on their paths, RK4 with a fixed step as in Rollout. It begins
/// at rest in the entry pose of the first node. From then on the state is carried from primitive to
/// primitive, through the holds between them, and never reset. In a swapped node the joints follow
/// each other's paths; the simulated robot stays as it is and need not be symmetric.
/// @param motion   of a robot in the plane or in space.
/// @param visitor  called at every integration step in the plane, with the node; may be empty.
/// @throws FileError when a primitive's texts cannot be used, or the sequence would never end,
/// or as RequireSameGround does; std::invalid_argument when the branch is not in the sequence,
/// or when its primitives have different passive joints, or any while joints exchange their roles.
ChainOutcome SimulateChain(const SimulatedMotion& motion, const ChainOptions& options,
                           const std::function<void(int, const MotionSample&)>& visitor = {});
/// The same with a visitor in space.
/// @pre the motion is of a robot in space.
ChainOutcome SimulateChainInSpace(const SimulatedMotion& motion, const ChainOptions& options,
                                  const std::function<void(int, const SpaceSample&)>& visitor = {});

}  // namespace tumbler
