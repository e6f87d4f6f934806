#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/primitive.h"
#include "common/realtime.h"
#include "common/sequence.h"
#include "common/status.h"
#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/frame.h"
#include "firmware_interface/drives/drive.h"
#include "runtime/core/faults.h"
#include "runtime/core/safety.h"

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

/// What the operator, or the program that stands for one, asks in one tick.
enum class OperatorCommand : std::uint8_t {
  kNone,
  kArm,          ///< disarmed -> arming -> holding, at the measured position.
  kMoveToStart,  ///< holding -> moving to start -> holding.
  kRun,          ///< holding at the start -> running -> settling -> ... -> holding.
  kStop,    ///< Anything that moves -> stopping -> holding; the fault table's row kOperatorStop.
  kDisarm,  ///< Any state -> disarmed: torque off at once.
  kClearFaults,  ///< disarmed: forgets the latched faults, and tells the drives to forget theirs.
  kFinish,       ///< running, settling: end at the next safe node.
  kBranch,       ///< running, settling: take `TickInput::branch` where there is one.
};

/// Why a command was not followed. A refusal changes nothing.
enum class Refusal : std::uint8_t {
  kNone,
  kWrongState,
  kNotConfigured,
  kFaultLatched,   ///< Clear the faults first.
  kNoReply,        ///< A drive is silent [ticks since its last reply].
  kDriveError,     ///< A drive reports an error [its code].
  kTooHot,         ///< [degrees C]
  kOutsideLimits,  ///< A joint is measured outside its position limits [rad].
  kNotAtStart,     ///< A joint's commanded position is not the primitive's first: move to the start
                   ///< [rad].
  kOutsideStartSet,  ///< A joint is measured too far from the primitive's first position [rad].
  kNoSuchBranch,     ///< The sequence has no branch of this number [the number].
  kNoHeartbeat,      ///< A drive's heartbeat has stopped [ticks since the last].
};

[[nodiscard]] const char* ToString(OperatorCommand command) noexcept;
[[nodiscard]] const char* ToString(Refusal refusal) noexcept;

/// A refusal with its numbers, in the unit of the refusal.
struct RefusalReport {
  float value = 0;
  float limit = 0;
  Refusal refusal = Refusal::kNone;
  std::int8_t joint = -1;
};

/// All that the world tells the executor in one tick.
struct TickInput {
  std::int64_t tick = 0;  ///< Control periods since the schedule began; grows by one, and by more
                          ///< after a missed one.
  std::span<const ReceivedFrame> received;  ///< Since the tick before, in order.
  Status receive_status = Status::kOk;      ///< kOk or kWouldBlock while the link is up.
  Status send_status = Status::kOk;         ///< First failure of sending the tick before's frames.
  OperatorCommand command = OperatorCommand::kNone;
  std::int8_t branch = -1;  ///< The number that belongs to kBranch.
  CanControllerState controller = CanControllerState::kErrorActive;
};

/// What the replies of one drive in one tick are worth, as AUTOSAR's end-to-end protection has it.
/// None of the protocols numbers its frames, so this is told by counting them against the setpoints
/// (`ReplyRhythm`). Not to be known are a reply that took the place of a lost one, and, of a drive
/// that sends by its own clock, a repeated one within its rate.
enum class ReplyStatus : std::uint8_t {
  kOk,             ///< New, and as many as there should be.
  kNoNewData,      ///< None.
  kRepeated,       ///< More than setpoints are unanswered.
  kOkSomeLost,     ///< New, after ticks without.
  kWrongSequence,  ///< Those of earlier ticks came together with a newer one.
};
[[nodiscard]] const char* ToString(ReplyStatus status) noexcept;

/// One joint in one tick: planned, limited, as encoded on the wire, and measured.
struct JointRecord {
  JointSetpoint planned;
  float planned_acceleration_rad_s2 = 0;  ///< s^2 q''(s t) while running, else zero.
  JointSetpoint limited;
  JointSetpoint encoded;
  JointSetpoint measured;  ///< From the reply to the tick before's setpoint.
  float temperature_c = 0;
  std::int32_t reply_age_ticks = -1;  ///< 0: replied since the tick before; -1: never.
  DriveState drive_state = DriveState::kUnknown;
  ReplyStatus reply_status = ReplyStatus::kOk;
  std::uint32_t drive_error = 0;  ///< The drive's own code.
  bool limit_active = false;      ///< planned was outside a limit.
};

/// Everything about one tick. Trivially copyable: it goes into rings and logs as it is.
struct TickRecord {
  std::int64_t tick = 0;
  float primitive_time_s = 0;                      ///< Position in the primitive, 0 ... duration.
  std::uint32_t faults = 0;                        ///< Latched: bit i is Fault i.
  ExecutorState state = ExecutorState::kDisarmed;  ///< In which this tick's frames were planned.
  Reaction reaction = Reaction::kIgnore;           ///< Carried out in state kFault.
  OperatorCommand command = OperatorCommand::kNone;
  std::uint8_t joint_count = 0;
  std::int8_t node = 0;     ///< Of the sequence: the one being played, or played last.
  std::int32_t cycles = 0;  ///< Complete, since kRun.
  FaultReport first_fault;  ///< Since the last clear: the cause, not its consequences.
  RefusalReport refusal;    ///< Of this tick's command.
  std::array<JointRecord, kMaxJoints> joints;
};

/// Frames to send and the record of the tick. What lies beyond `record.joint_count` is left as it
/// was.
struct TickOutput {
  std::array<FrameBatch, kMaxJoints> frames;
  TickRecord record;
};

/// Plays a sequence of primitives, or a single one, on one to eight drives: a pure function of its
/// inputs, tick by tick.
///
/// There is no clock, bus, heap, exception or log in here; a recorded series of inputs gives the
/// same frames on every machine. Every tick writes every drive. Arming starts from the measured
/// positions; holds, moves, runs and stops start from the last commanded setpoint, so that no
/// transition makes the command jump. Nothing leaves without passing `LimitSetpoint`, and it is the
/// limited setpoint that decides when a motion is over. Faults are latched and answered by
/// `ExecutorConfig::reactions`; after kDisarm, kClearFaults forgets them.
class Executor {
 public:
  /// Serves no joint and plays nothing until configured.
  Executor() = default;

  /// @param graph       is copied. Its loader has proved it (`common/sequence_toml.h`).
  /// @param primitives  that its nodes name by index; they must outlive the executor unchanged, and
  ///                    all move the same joints in the same order.
  /// @param drives      one for each joint, in that order; they must outlive the executor.
  /// @retval kInvalidArgument  a value is outside its documented range, a pointer is null, counts
  ///                           or indices do not agree, or a primitive starts moving faster than
  ///                           one tick of its acceleration limit.
  /// @retval kWouldBlock       not disarmed. Unless kOk is returned nothing was changed.
  Status Configure(const ExecutorConfig& config, const SequenceGraph<float>& graph,
                   std::span<const Primitive<float>> primitives,
                   std::span<Drive* const> drives) noexcept;
  /// A single primitive, which must outlive the executor unchanged.
  Status Configure(const ExecutorConfig& config, const Primitive<float>& primitive,
                   std::span<Drive* const> drives) noexcept {
    return Configure(config, GraphOf(primitive), {&primitive, 1}, drives);
  }

  /// One control period.
  void Tick(const TickInput& input, TickOutput& output) noexcept TUMBLER_NONBLOCKING;

  [[nodiscard]] ExecutorState state() const noexcept { return state_; }
  [[nodiscard]] int joint_count() const noexcept { return joint_count_; }
  [[nodiscard]] const SequenceGraph<float>& graph() const noexcept { return graph_; }
  /// Ticks that the present node's primitive takes at the configured speed and period.
  [[nodiscard]] std::int64_t run_ticks() const noexcept { return run_ticks_; }

 private:
  using Basis = JointMotion<float>::Spline::Basis;

  struct Joint {
    Drive* drive = nullptr;
    const JointMotion<float>* motion = nullptr;  ///< Of the present node.
    SafetyLimits limits;
    float acceleration_max_rad_s2 = 0;
    bool shares_position_knots = false;  ///< With joint 0.
    bool shares_torque_knots = false;
    JointSetpoint commanded;  ///< Last limited setpoint.
    DriveFeedback measured;
    DriveState drive_state = DriveState::kUnknown;
    std::int32_t reply_age_ticks = -1;
    bool was_enabled = false;  ///< Since arming.
    ReplyRhythm rhythm;
    ReplyStatus reply_status = ReplyStatus::kOk;
    int replies = 0;          ///< In this tick.
    int unanswered = 0;       ///< Setpoints.
    int in_order = 0;         ///< Ticks in a row with one reply.
    int sequence_errors = 0;  ///< See `ExecutorConfig::sequence_errors_max`.
    float move_from_rad = 0;
    Basis position_basis;
    Basis torque_basis;
  };

  [[nodiscard]] std::span<Joint> joints() noexcept {
    return {joints_.data(), static_cast<std::size_t>(joint_count_)};
  }
  void TakeReplies(const TickInput& input, int elapsed) noexcept;
  void JudgeReplies(Joint& joint, int elapsed) const noexcept;
  void DetectLinkFaults(const TickInput& input) noexcept;
  void DetectDriveFaults(int index) noexcept;
  void DetectFaults(const TickInput& input, std::int64_t elapsed) noexcept;
  void Latch(Fault fault, int joint, float value, float limit) noexcept;
  void Obey(const TickInput& input) noexcept;
  [[nodiscard]] bool InSequence() const noexcept {
    return state_ == ExecutorState::kRunning || state_ == ExecutorState::kSettling;
  }
  [[nodiscard]] RefusalReport CheckArm() const noexcept;
  [[nodiscard]] RefusalReport CheckMove() const noexcept;
  [[nodiscard]] RefusalReport CheckRun() const noexcept;
  [[nodiscard]] const JointMotion<float>& FirstMotion(int joint) const noexcept;
  void StartMove() noexcept;
  void SetNode(int node) noexcept;
  [[nodiscard]] int NextEdgeHere() const noexcept;
  void FollowEdge(int edge) noexcept;
  void Enter(ExecutorState state) noexcept;
  void Plan(int elapsed, TickRecord& record) noexcept;
  void PlanArming(TickRecord& record) noexcept;
  void PlanMove(TickRecord& record) noexcept;
  void PlanRun(TickRecord& record) noexcept;
  void PlanBrake(int elapsed, TickRecord& record) noexcept;
  void PlanCollapse(int elapsed, TickRecord& record) noexcept;
  void Advance(const TickRecord& record) noexcept;
  void Send(int elapsed, TickOutput& output) noexcept;

  ExecutorConfig config_;
  SequenceGraph<float> graph_;
  std::span<const Primitive<float>> primitives_;
  const Primitive<float>* primitive_ = nullptr;  ///< Of the present node.
  std::array<Joint, kMaxJoints> joints_;
  int joint_count_ = 0;
  float time_per_tick_s_ = 0;  ///< period * speed
  std::int64_t run_ticks_ = 0;
  std::int64_t move_ticks_ = 0;

  std::int64_t tick_ = 0;
  bool ticked_ = false;
  ExecutorState state_ = ExecutorState::kDisarmed;
  std::int64_t ticks_in_state_ = 0;  ///< The tick of the transition is number 0.
  float primitive_time_s_ = 0;
  int node_ = 0;
  int cycles_done_ = 0;
  int wanted_branch_ = -1;    ///< That the operator has asked for, until it is taken.
  bool branched_ = false;     ///< The configured branch has been taken.
  bool finish_ = false;       ///< End at the next safe node.
  bool keep_torque_ = false;  ///< Holding what the primitive ended with, feed-forward included.
  Reaction reaction_ = Reaction::kIgnore;
  std::uint32_t faults_ = 0;
  FaultReport first_fault_;
  RefusalReport refusal_;
  DriveRequest unarmed_request_ = DriveRequest::kDisable;  ///< What a tick without torque asks for.
};

}  // namespace tumbler
