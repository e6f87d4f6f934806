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
#include "runtime/executor/feedback_controller.h"
#include "runtime/executor/joint.h"
#include "runtime/executor/phase.h"
#include "runtime/executor/pitch_estimate.h"
#include "runtime/executor/sequencer.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// Plays a sequence of primitives, or a single one, on one to kMaxJoints drives: a pure function of
/// its inputs, tick by tick.
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
  /// @param pitch       by which primitives with feedback are played with it, and falls are seen;
  ///                    it must outlive the executor. Null: there is none, and nothing is fed back.
  /// @retval kInvalidArgument  a value is outside its documented range, a pointer is null, counts
  ///                           or indices do not agree, or a primitive starts moving faster than
  ///                           one tick of its acceleration limit.
  /// @retval kWouldBlock       not disarmed. Unless kOk is returned nothing was changed.
  Status Configure(const ExecutorConfig& config, const SequenceGraph<float>& graph,
                   std::span<const Primitive<float>> primitives, std::span<Drive* const> drives,
                   PitchEstimate* pitch = nullptr) noexcept;
  /// The same for a single primitive, which must outlive the executor unchanged.
  Status Configure(const ExecutorConfig& config, const Primitive<float>& primitive,
                   std::span<Drive* const> drives, PitchEstimate* pitch = nullptr) noexcept {
    return Configure(config, GraphOf(primitive), {&primitive, 1}, drives, pitch);
  }

  /// Executes one control period.
  void Tick(const TickInput& input, TickOutput& output) noexcept TUMBLER_NONBLOCKING;

  [[nodiscard]] ExecutorState state() const noexcept { return StateOf(phase_); }
  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  [[nodiscard]] int joint_count() const noexcept { return joint_count_; }
  [[nodiscard]] const SequenceGraph<float>& graph() const noexcept { return sequencer_.graph(); }
  /// Without a setpoint for more ticks than this the drives may have let go.
  [[nodiscard]] int pause_ticks_max() const noexcept { return config_.pause_ticks_max; }
  /// How many ticks the present node's primitive takes at the configured speed and period.
  [[nodiscard]] std::int64_t run_ticks() const noexcept { return run_ticks_; }

 private:
  // What a phase goes by, beside its time.
  struct Move {  ///< kMovingToStart and kGettingUp.
    std::int64_t ticks = 0;
    float fall_rad = 0;  ///< How far a robot that gets up was from where its node leaves it.
  };
  struct Hold {                 ///< All phases at rest, and those that brake to it.
    bool keeps_torque = false;  ///< Whether the pose is that of a node's end, and its feed-forward.
  };
  struct Lowering {  ///< kLowering and kLoweringInFault.
    int ticks = 0;
  };
  struct Answer {  ///< kFault and kLoweringInFault; in other phases there is none.
    Reaction reaction = Reaction::kIgnore;
    const AbortSpan<float>* abort = nullptr;  ///< Of the time in the primitive when it began.
    std::int64_t late_ticks = 0;              ///< Missed then, and while the motion is rolled out.
  };

  [[nodiscard]] std::span<Joint> joints() noexcept {
    return {joints_.data(), static_cast<std::size_t>(joint_count_)};
  }
  // The tick and the states: executor.cc.
  void TakeReplies(const TickInput& input, int elapsed) noexcept;
  [[nodiscard]] std::int32_t AgeOf(const ReceivedFrame& received) const noexcept;
  [[nodiscard, gnu::cold]] std::int32_t AgeOfOld(std::int64_t frame_ns) const noexcept;
  void Send(int elapsed, TickOutput& output) noexcept;
  void Advance(const TickRecord& record) noexcept;
  void SetNode(int node) noexcept;
  void EndNode() noexcept;
  void FollowEdge(int edge) noexcept;
  // Cold: what is seldom done is compiled for its size. A small processor has no space for copies.
  [[nodiscard, gnu::cold]] bool AnswerFall() noexcept;
  [[gnu::cold]] void BeginAnew() noexcept;
  [[nodiscard, gnu::cold]] bool AnswerUnclear(std::int64_t waited_ticks) noexcept;
  [[gnu::cold]] void LatchFall(float fall_rad) noexcept;
  [[nodiscard]] bool AtRest() const noexcept;
  [[nodiscard]] bool TellsFalls() const noexcept {
    return pitch_ != nullptr && graph().beginning_count > 0;
  }
  [[nodiscard]] float FarFromEnd() const noexcept;

  // The transitions: executor.cc. Each sets all that the phase which it enters goes by.
  void Enter(Phase phase) noexcept;
  [[gnu::cold]] void BeginArming() noexcept;
  void StartMove(Phase phase) noexcept;
  void Play(int node, Phase phase) noexcept;
  void Settle(Phase phase) noexcept;
  [[gnu::cold]] void BreakOff() noexcept;
  [[gnu::cold]] void Lower() noexcept;
  [[gnu::cold]] void Disarm() noexcept;

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

  // Commands: executor_commands.cc.
  void Obey(const TickInput& input) noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckArm() const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckKnown(int joint) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckMove() const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckFirstLimits() const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckRun(int& node) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckBeginning(int& node) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail FindBeginning(int& node) const noexcept;
  [[nodiscard, gnu::cold]] RefusalDetail CheckGoHome() const noexcept;
  [[nodiscard]] const JointMotion<float>& FirstMotion(int joint) const noexcept;

  // Setpoints: executor_plan.cc.
  [[nodiscard, gnu::cold]] std::int64_t MoveTicks() noexcept;
  void Plan(int elapsed, TickRecord& record) noexcept;
  void PlanArming(TickRecord& record) noexcept;
  void PlanMove(TickRecord& record) noexcept;
  void PlanRun(TickRecord& record) noexcept;
  [[gnu::cold]] void PlanBetween(TickRecord& record) const noexcept;
  void PlanBrake(int elapsed, TickRecord& record) noexcept;
  void PlanFold(int elapsed, std::span<const float> pose, float share, TickRecord& record) noexcept;

  inline void Correct(int elapsed, TickRecord& record) noexcept;

  // What was configured.
  ExecutorConfig config_;
  std::span<const Primitive<float>> primitives_;
  std::array<Joint, kMaxJoints> joints_;
  int joint_count_ = 0;
  float time_per_tick_s_ = 0;  ///< period * speed
  PitchEstimate* pitch_ = nullptr;

  // The tick.
  std::int64_t tick_ = 0;
  std::int64_t time_ns_ = 0;   ///< Of the tick.
  std::int64_t fresh_ns_ = 0;  ///< One period before: what came since then is new.
  bool ticked_ = false;
  int foreign_joint_ = -1;  ///< Whose drive somebody else has commanded since the last tick; or -1.
  std::uint32_t foreign_id_ = 0;  ///< Of that frame.
  RefusalDetail refusal_;

  // What is played.
  Sequencer sequencer_;
  FeedbackController feedback_;
  const Primitive<float>* primitive_ = nullptr;  ///< Of the present node.
  std::int64_t run_ticks_ = 0;
  float primitive_time_s_ = 0;

  // The phase, and what belongs to some of them.
  Phase phase_ = Phase::kDisarmed;
  std::int64_t ticks_in_phase_ = 0;  ///< The tick of the transition is number 0.
  Move move_;
  Hold hold_;
  Lowering lowering_;
  Answer answer_;
  DriveRequest unarmed_request_ = DriveRequest::kDisable;  ///< The request of ticks without torque.

  // Faults are latched across phases.
  std::uint32_t faults_ = 0;
  std::uint32_t earlier_faults_ = 0;  ///< Those before kGoHome; as latched as the others.
  FaultDetail first_fault_;
};

}  // namespace tumbler
