#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/core/primitive.h"
#include "common/core/realtime.h"
#include "common/core/sequence.h"
#include "common/core/status.h"
#include "firmware_interface/devices/drive.h"
#include "runtime/executor/executor_config.h"
#include "runtime/executor/faults.h"
#include "runtime/executor/numbers.h"
#include "runtime/executor/reply_watch.h"
#include "runtime/executor/safety.h"
#include "runtime/executor/sensor_watch.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// The inertial sensor of a robot.
struct ExecutorSensor {
  InertialSensor* device = nullptr;  ///< Null: there is none, and nothing is fed back.
  SensorSettings settings;
};

/// Plays a sequence of primitives, or a single one, on one to eight drives: a pure function of its
/// inputs, tick by tick.
///
/// There is no clock, bus, heap, exception or log in here. A recorded series of inputs gives the
/// same frames on every machine.
///
/// Every tick writes every drive. Arming starts from the measured positions; holds, moves, runs and
/// stops start from the last commanded setpoint, so that no transition makes the command jump.
/// Every setpoint passes `LimitSetpoint`, and the limited setpoint decides when a motion is over.
/// Faults are latched and answered by `ExecutorConfig::reactions`; after kDisarm, kClearFaults
/// forgets them.
class Executor {
 public:
  /// Serves no joint and plays nothing until configured.
  Executor() = default;

  /// Prepares the executor to play a sequence. Allowed while disarmed.
  /// @param graph       is copied. Its loader has proved it (`common/files/sequence_toml.h`).
  /// @param primitives  the primitives to which the graph's nodes refer by index. They must outlive
  ///                    the executor unchanged, and all move the same joints in the same order.
  /// @param drives      one for each joint, in that order. They must outlive the executor.
  /// @param sensor      by which primitives with feedback are played with it; it must outlive the
  ///                    executor.
  /// @retval kInvalidArgument  a value is outside its documented range, a pointer is null, counts
  ///                           or indices do not agree, or a primitive starts moving faster than
  ///                           one tick of its acceleration limit.
  /// @retval kWouldBlock       not disarmed. Unless kOk is returned nothing was changed.
  Status Configure(const ExecutorConfig& config, const SequenceGraph<float>& graph,
                   std::span<const Primitive<float>> primitives, std::span<Drive* const> drives,
                   const ExecutorSensor& sensor = {}) noexcept;
  /// The same for a single primitive, which must outlive the executor unchanged.
  Status Configure(const ExecutorConfig& config, const Primitive<float>& primitive,
                   std::span<Drive* const> drives, const ExecutorSensor& sensor = {}) noexcept {
    return Configure(config, GraphOf(primitive), {&primitive, 1}, drives, sensor);
  }

  /// Executes one control period.
  void Tick(const TickInput& input, TickOutput& output) noexcept TUMBLER_NONBLOCKING;

  [[nodiscard]] ExecutorState state() const noexcept { return state_; }
  [[nodiscard]] int joint_count() const noexcept { return joint_count_; }
  [[nodiscard]] const SequenceGraph<float>& graph() const noexcept { return graph_; }
  /// Without a setpoint for more ticks than this the drives may have let go.
  [[nodiscard]] int pause_ticks_max() const noexcept { return config_.pause_ticks_max; }
  /// How many ticks the present node's primitive takes at the configured speed and period.
  [[nodiscard]] std::int64_t run_ticks() const noexcept { return run_ticks_; }

 private:
  using Basis = JointMotion<float>::Spline::Basis;

  struct Joint {
    Drive* drive = nullptr;
    const JointMotion<float>* motion = nullptr;  ///< In the present node.
    SafetyLimits limits;
    float acceleration_max_rad_s2 = 0;
    bool shares_position_knots = false;  ///< Whether the path has the knots of joint 0's.
    bool shares_torque_knots = false;    ///< Whether the feed-forward has the knots of joint 0's.
    JointSetpoint commanded;             ///< The last limited setpoint.
    DriveFeedback measured;
    float zero_if_finite = 0;  ///< NaN where a number of `measured` is not finite, else zero.
    DriveState drive_state = DriveState::kUnknown;
    ReplyWatch replies;
    bool was_off = false;      ///< Whether the drive was seen not to be enabled since arming began.
    bool was_enabled = false;  ///< Whether the drive has been enabled since arming.
    float move_from_rad = 0;
    float left_rad = 0;     ///< The last setpoint before torque off.
    bool was_left = false;  ///< Whether there was one.
    Basis position_basis;
    Basis torque_basis;
    const JointFeedback<float>* feedback = nullptr;  ///< In the present node.
    float angle_factor = 0;     ///< By how much link less sensor turn while the joint turns.
    float uncorrected_rad = 0;  ///< The last setpoint without its correction.
    float correction_rad = 0;

    void Measure(const DriveFeedback& report) noexcept {
      measured = report;
      zero_if_finite = ZeroIfFinite(measured.position_rad, measured.velocity_rad_s,
                                    measured.torque_nm, measured.temperature_c);
    }
    [[nodiscard]] bool IsMeasuredFinite() const noexcept { return zero_if_finite == 0; }
  };

  [[nodiscard]] std::span<Joint> joints() noexcept {
    return {joints_.data(), static_cast<std::size_t>(joint_count_)};
  }
  [[nodiscard]] bool InSequence() const noexcept {
    return state_ == ExecutorState::kRunning || state_ == ExecutorState::kSettling || gets_up_;
  }

  // The tick and the states: executor.cc.
  void TakeReplies(const TickInput& input, int elapsed) noexcept;
  [[nodiscard]] std::int32_t AgeOf(const ReceivedFrame& received) const noexcept;
  [[nodiscard, gnu::cold]] std::int32_t AgeOfOld(std::int64_t frame_ns) const noexcept;
  void Send(int elapsed, TickOutput& output) noexcept;
  void Enter(ExecutorState state) noexcept;
  void Advance(const TickRecord& record) noexcept;
  void SetNode(int node) noexcept;
  [[nodiscard]] int NextEdgeHere() const noexcept;
  void FollowEdge(int edge) noexcept;
  [[nodiscard]] int InPlaceOf(int node) const noexcept;
  void NoteFall() noexcept;
  void EndNode() noexcept;
  // Cold: what is seldom done is compiled for its size. A small processor has no space for copies.
  [[nodiscard, gnu::cold]] bool AnswerFall() noexcept;
  [[gnu::cold]] void BeginAnew() noexcept;
  [[nodiscard, gnu::cold]] bool AnswerUnclear(std::int64_t waited_ticks) noexcept;
  [[gnu::cold]] void LatchFall() noexcept;
  [[gnu::cold]] void CountCycle() noexcept;
  [[gnu::cold]] void TakeCycleBack() noexcept;
  [[nodiscard]] bool AtRest() const noexcept;
  [[nodiscard]] float FarFromEnd() const noexcept;

  // Faults: executor_faults.cc.
  void DetectFaults(const TickInput& input, std::int64_t elapsed) noexcept;
  [[gnu::cold]] void DetectLateness(std::int64_t elapsed) noexcept;
  void DetectStaleReply(int index) noexcept;
  void DetectLinkFaults(const TickInput& input) noexcept;
  void DetectDriveFaults(int index) noexcept;
  void NoteForeignCommand(const CanFrame& frame) noexcept;
  void Latch(Fault fault, int joint, DetailNumber value, DetailNumber limit) noexcept;
  [[nodiscard]] Reaction ReactionTo(Fault fault, std::int64_t late_ticks = 0) const noexcept;
  [[nodiscard]] bool IsTooLate(const AbortSpan<float>& span,
                               std::int64_t late_ticks) const noexcept;
  void React(Reaction reaction) noexcept;

  // Commands: executor_commands.cc.
  void Obey(const TickInput& input) noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckArm() const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckKnown(int joint) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckMove() const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckFirstLimits() const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckRun(int& node) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckBeginning(int& node) const noexcept;
  [[nodiscard, gnu::cold]] float FarFromBeginning(bool told, int& node) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail FindBeginning(int& node) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckGoHome() const noexcept;
  [[nodiscard]] const JointMotion<float>& FirstMotion(int joint) const noexcept;

  // Setpoints: executor_plan.cc.
  [[gnu::cold]] void StartMove() noexcept;
  void Plan(int elapsed, TickRecord& record) noexcept;
  void PlanArming(TickRecord& record) noexcept;
  void PlanMove(TickRecord& record) noexcept;
  void PlanRun(TickRecord& record) noexcept;
  [[gnu::cold]] void PlanBetween(TickRecord& record) const noexcept;
  void PlanBrake(int elapsed, TickRecord& record) noexcept;
  void PlanFold(int elapsed, std::span<const float> pose, float share, TickRecord& record) noexcept;

  // Feedback: executor_feedback.cc. Only with a sensor.
  void SetFeedback() noexcept;
  [[nodiscard]] bool MeasureError(bool moving) noexcept;
  inline void Fade(bool moving, float time_s) noexcept;
  void Correct(int elapsed, TickRecord& record) noexcept;

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
  std::int64_t time_ns_ = 0;   ///< Of the tick.
  std::int64_t fresh_ns_ = 0;  ///< One period before: what came since then is new.
  bool ticked_ = false;
  ExecutorState state_ = ExecutorState::kDisarmed;
  std::int64_t ticks_in_state_ = 0;  ///< The tick of the transition is number 0.
  float primitive_time_s_ = 0;
  int node_ = 0;
  int cycles_done_ = 0;
  bool cycle_unchecked_ = false;  ///< Whether the last of them may yet turn out to end in a fall.
  int get_ups_ = 0;               ///< In this run.
  /// In this run: the nodes in which the robot fell, and whose `after_fall` is played since. A bit
  /// for each.
  std::uint32_t fell_in_ = 0;
  bool gets_up_ = false;    ///< Whether the joints move to the start because the robot fell.
  float fall_rad_ = 0;      ///< How far the last robot that fell was from where its node leaves it.
  int wanted_branch_ = -1;  ///< The branch that the operator has asked for, until it is taken.
  bool branched_ = false;   ///< Whether the configured branch has been taken.
  bool finish_ = false;     ///< Whether to end at the next safe node.
  bool lowering_ = false;   ///< Whether the robot is being lowered.
  int lowering_ticks_ = 0;  ///< For how long.
  bool keep_torque_ = false;  ///< Whether a hold keeps the last feed-forward of the primitive.
  Reaction reaction_ = Reaction::kIgnore;
  bool follows_ = true;  ///< Whether joints have to follow their setpoints, once armed.
  const AbortSpan<float>* abort_ = nullptr;  ///< Of the time in the primitive when a fault began.
  std::int64_t late_ticks_ = 0;              ///< Missed then, and while the motion is rolled out.
  int foreign_joint_ = -1;  ///< Whose drive somebody else has commanded since the last tick; or -1.
  std::uint32_t foreign_id_ = 0;  ///< Of that frame.
  std::uint32_t faults_ = 0;
  std::uint32_t earlier_faults_ = 0;  ///< Those before kGoHome; as latched as the others.
  FaultDetail first_fault_;
  RefusalDetail refusal_;
  InertialSensor* sensor_ = nullptr;
  SensorWatch sensor_watch_;
  bool angle_has_torque_knots_ = false;  ///< Whether the plan's angle has joint 0's of the torque.
  Basis angle_basis_;
  int gain_knot_ = 0;             ///< Before the present time in the primitive.
  float held_s_ = 0;              ///< Since the end of the primitive, while its feedback acts.
  float error_rad_ = 0;           ///< Of the fed-back angle, when it was known last.
  float rate_error_rad_s_ = 0;    ///< Of its rate.
  float share_ = 0;               ///< Of the feedback that is in force.
  bool corrects_ = false;         ///< Whether the last setpoint was corrected.
  bool knows_error_ = false;      ///< Whether the errors above were known in the last tick.
  bool starts_ = false;           ///< Whether the primitive has just begun.
  bool plays_open_loop_ = false;  ///< Whether its start was too far from the plan.
  DriveRequest unarmed_request_ = DriveRequest::kDisable;  ///< The request of ticks without torque.
};

}  // namespace tumbler
