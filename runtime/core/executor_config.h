#pragma once

#include <array>
#include <span>

#include "common/primitive.h"
#include "common/sequence.h"
#include "runtime/core/faults.h"

namespace tumbler {

/// What the executor asks of one joint's drive, whose law is
/// torque = kp (position - q) + kd (velocity - qdot) + feed-forward.
struct JointConfig {
  float kp_nm_per_rad = 200;
  float kd_nm_s_per_rad = 4;
  float damping_nm_s_per_rad = 4;  ///< kd of the reaction kDamp, where kp is zero.
  float temperature_max_c =
      80;  ///< Below the 100 degrees or so at which magnets and drives suffer.
};

/// The reaction kCollapse. The joints brake at their acceleration limit, move with
/// `ExecutorConfig::move_fraction` of their velocity and acceleration limits to this pose, and stay
/// there.
struct CollapseConfig {
  bool configured = false;  ///< Without a pose no reaction may be kCollapse.
  /// The pose, by roles like the paths of a primitive: in a node with exchanged roles joint
  /// `partner[j]` takes position j. Within every primitive's limits.
  std::array<float, kMaxJoints> position_rad{};
  /// Share of kp, 0.01 ... 1, where the protocol carries gains: soft enough to give way to the
  /// ground.
  float stiffness = 0.3F;
};

/// How the executor behaves; everything that belongs to the motion itself comes with the primitive.
struct ExecutorConfig {
  float period_s = 0.001F;  ///< Of the control tick.
  /// Playback speed s, 0.1 ... 1: q(t) becomes q(s t), velocity s q'(s t), and the feed-forward s^2
  /// tau(s t). The factor s^2 is exact for its inertial and centrifugal share; what is static in it
  /// is then too small, never too large, and left to the position loop. At s = 1 the primitive is
  /// played as it is.
  float speed = 1;
  float move_fraction =
      0.2F;  ///< Share of the velocity and acceleration limits that moving to the start may use.
  float torque_rise_s =
      0.01F;  ///< Time for the feed-forward from zero to its limit: takes the click out of splices.
  int stale_ticks_max = 5;  ///< A lost reply is ordinary on CAN, five in a row are not.
  /// Of the count that a tick with replies out of order raises by 2 and one in order lowers by 1: a
  /// repeated frame is ordinary on CAN, one in every third tick is not.
  int sequence_errors_max = 10;
  int late_ticks_max = 2;      ///< Missed periods that are made up for; beyond, kLateTick.
  int arming_ticks_max = 500;  ///< For all drives to start up.
  /// Of a sequence: so many cycles, and then the branch of this number
  /// (`SequenceGraph::FindBranch`; -1: none). 0 cycles: the branch at the first chance, or, without
  /// one, on until a stop.
  int cycles = 0;
  int branch = -1;
  std::array<JointConfig, kMaxJoints> joints;
  FaultTable reactions;
  CollapseConfig collapse;
};

/// Whether an executor can play these on so many joints: every value is within its documented
/// range, indices agree, and no primitive starts moving faster than one tick of its acceleration
/// limit.
[[nodiscard]] bool IsPlayable(const ExecutorConfig& config, const SequenceGraph<float>& graph,
                              std::span<const Primitive<float>> primitives,
                              int joint_count) noexcept;

}  // namespace tumbler
