#pragma once

#include <array>
#include <span>

#include "common/core/primitive.h"
#include "common/core/sequence.h"
#include "runtime/executor/faults.h"

namespace tumbler {

/// The gains of one joint's drive, whose law is
/// torque = kp (position - q) + kd (velocity - qdot) + feed-forward, and its temperature limit.
struct JointConfig {
  float kp_nm_per_rad = 200;
  float kd_nm_s_per_rad = 4;
  /// kd of the reaction kDamp, where kp is zero.
  float damping_nm_s_per_rad = 4;
  /// Above this a drive is a fault. Magnets and drives suffer from about 100 degrees on.
  float temperature_max_c = 80;
};

/// The reaction kCollapse. The joints brake at their acceleration limit, move with
/// `ExecutorConfig::move_fraction` of their velocity and acceleration limits to this pose, and stay
/// there.
struct CollapseConfig {
  /// Whether there is a pose. Without one no reaction may be kCollapse.
  bool configured = false;
  /// The pose, within the limits of every primitive. Positions belong to roles, like the paths of a
  /// primitive: in a node with exchanged roles joint `partner[j]` takes position j.
  std::array<float, kMaxJoints> position_rad{};
  /// Share of kp, 0.01 ... 1, where the protocol carries gains. The default is soft enough to give
  /// way to the ground.
  float stiffness = 0.3F;
};

/// Where a joint was when it was last known, such as at the end of the run before.
struct KnownPosition {
  bool known = false;
  float position_rad = 0;
  /// > 0: how far the joint turns while the drive's shaft turns once. A drive that has lost its
  /// count of turns is off by a multiple of this.
  float turn_rad = 6.2831853F;
};

/// The executor's settings. Everything about the motion itself comes with the primitive.
struct ExecutorConfig {
  /// Of the control tick.
  float period_s = 0.001F;
  /// Playback speed s, 0.1 ... 1: q(t) becomes q(s t), the velocity s q'(s t), and the feed-forward
  /// s^2 tau(s t). The factor s^2 is exact for the inertial and centrifugal share of the torque.
  /// The static share becomes too small, never too large, and the position loop makes up for it. At
  /// s = 1 the primitive is played as it is.
  float speed = 1;
  /// The share of the velocity and acceleration limits that moving to the start may use.
  float move_fraction = 0.2F;
  /// The time in which the feed-forward may go from zero to its limit. Without it splices would
  /// click.
  float torque_rise_s = 0.01F;
  /// A drive without a reply for more ticks than this is a fault. A lost reply is ordinary on CAN,
  /// five in a row are not.
  int stale_ticks_max = 5;
  /// The limit of a count that a tick with more replies than are owed raises by 2, and any other
  /// tick with replies lowers by 1. A repeated frame is ordinary on CAN, one in every third tick is
  /// not.
  int sequence_errors_max = 10;
  /// How many missed periods are made up for, 0 ... 1000. More are the fault kLateTick.
  int late_ticks_max = 2;
  /// After more ticks from one setpoint to the next nobody knows how the robot lies: a drive may
  /// have let go (its watchdog), and one that balanced has fallen. That is the fault kPaused. The
  /// default is 0.2 s; `ExecutorConfigOf` takes the shortest watchdog of the drives where that is
  /// shorter.
  int pause_ticks_max = 199;
  /// The time in which all drives have to be enabled.
  int arming_ticks_max = 500;
  /// Arming is refused when a joint is measured farther than this both from the start of the motion
  /// and from where the run before has left it. It may be that another joint moves than the one
  /// that is meant.
  float start_way_max_rad = 1e9F;
  /// Arming is refused when a joint that this executor has not moved yet is farther than this from
  /// where it was last known: it was moved by hand, or its zero has changed.
  float moved_max_rad = 1e9F;
  std::array<KnownPosition, kMaxJoints> last_known;
  /// Of a sequence: play this many cycles, and then take this branch (a number of
  /// `SequenceGraph::FindBranch`; -1: none). With 0 cycles the branch is taken at the first chance;
  /// without a branch, the sequence then goes on until a stop.
  int cycles = 0;
  int branch = -1;
  /// The node with which a run begins, by the operator's word; -1: by the sensor's pitch, where the
  /// sequence has several beginnings and there is a sensor, and else the start node.
  int begin = -1;
  /// How often in a run a robot that has fallen gets up: where the sensor says at the end of a node
  /// that the robot is not where the node leaves it, its joints move to the start, and the run goes
  /// on with the beginning in whose pose it lies. A fall beyond these is the fault kFallen. The
  /// default leaves it to the operator: joints that move under a robot that lies are no small
  /// thing.
  int get_ups_max = 0;
  std::array<JointConfig, kMaxJoints> joints;
  FaultTable reactions;
  CollapseConfig collapse;
};

/// Whether an executor can play these on this many joints: every value is within its documented
/// range, indices agree, and no primitive starts moving faster than one tick of its acceleration
/// limit.
[[nodiscard]] bool IsPlayable(const ExecutorConfig& config, const SequenceGraph<float>& graph,
                              std::span<const Primitive<float>> primitives,
                              int joint_count) noexcept;

}  // namespace tumbler
