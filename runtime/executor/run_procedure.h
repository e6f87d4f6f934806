#pragma once

#include <array>
#include <cstdint>

#include "common/core/realtime.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// Durations of the parts of one run [ticks].
struct RunProcedureConfig {
  /// Hold after the motion has settled.
  std::int64_t hold_ticks = 2000;
  /// The time in which every drive has to reply before arming.
  std::int64_t reply_ticks_max = 500;
  /// The time in which the joints have to come to rest in the start set after the move.
  std::int64_t start_ticks_max = 1000;
  /// How long the robot rests at the start when the move there has rocked it: when a joint's
  /// setpoint moved by more than `RunProcedure::kRocks_rad`.
  std::int64_t rest_ticks = 0;
  /// Hold after a stop of the operator, before torque off.
  std::int64_t stop_hold_ticks = 500;
  /// How long the reaction to a fault is carried out before torque off.
  std::int64_t fault_ticks = 1000;
  /// How long the drives are told torque off at the end, in case a frame is lost.
  std::int64_t disarmed_ticks = 10;
  /// How long the drives get to forget latched errors, as soon as all were heard; 0: they are not
  /// told to.
  std::int64_t clear_ticks = 0;
  /// Whether somebody attends. Then each run waits, disarmed, for RequestStart, and there may be
  /// many until RequestQuit. Otherwise there is one run, which starts by itself.
  bool attended = false;
  // What is done where the robot does not stand without torque:
  /// How long the robot is lowered before torque off; 0: it is not.
  std::int64_t lower_ticks = 0;
  /// Where it is not lowered: how long it is held before torque off; -1: until the operator
  /// disarms, or asks once more to finish or to stop.
  std::int64_t end_hold_ticks = 0;
  /// The nodes (bit i: node i of the sequence) after which the robot stays without torque.
  std::uint32_t safe_nodes = 0;
  /// Whether to go on to such a node after a fault that was answered by a hold.
  bool go_home = false;
};

/// How a run ended.
enum class RunOutcome : std::uint8_t {
  kPending,
  kCompleted,
  kRefused,  ///< `RunProcedure::refusal()` says why.
  kFault,    ///< The record's `first_fault` says which.
  kStopped,  ///< By the operator.
};

/// The hold at the end of a run, where the robot would drop without torque.
enum class EndHold : std::uint8_t {
  kNone,  ///< It is not held so.
  /// It is, since so short a time that a request to finish or to stop was meant for the motion. The
  /// motion is over: such a request asks for what is done, and does not drop the robot.
  kBegun,
  kOpen,  ///< The next such request takes the torque off.
};

/// Gives the executor the commands of a run, in their order: arm, move to the start, run, settle,
/// hold, stop, disarm. Where somebody attends, one run may follow another. Pure, like the executor.
///
/// The torque is taken off at once only where the robot stands without it: before the motion, and
/// after a node of `safe_nodes`. Elsewhere the robot is first brought there, lowered or held, as
/// the configuration says, unless a fault has taken away the means or the operator asks for torque
/// off.
///
/// A fault never makes a run longer than its reaction (`fault_ticks`): the hold at the end goes on
/// counting, requests count as before, and the outcome is kFault, whatever it was until then. Where
/// a drive does not hold its joint for `fault_ticks` of that hold, the torque is taken off.
class RunProcedure {
 public:
  /// What a joint moves in a few ticks on the way to the start without rocking the robot: some
  /// counts of an encoder. A motion is planned from rest, and a robot that rocks when it begins
  /// may fall in it.
  static constexpr float kRocks_rad = 2e-3F;

  explicit RunProcedure(const RunProcedureConfig& config) noexcept
      : config_(config),
        phase_(config.attended ? Phase::kWait : Phase::kArm),
        runs_(config.attended ? 0 : 1) {}

  /// The command for the next tick.
  /// @param last  the record of the tick before; a default record before the first.
  [[nodiscard]] OperatorCommand Next(const TickRecord& last) noexcept TUMBLER_NONBLOCKING;

  /// Begins a run, if the procedure waits for one.
  /// @param last  the record of the tick before.
  /// @returns kNone; kWrongState if it does not wait; kFaultLatched if faults have to be cleared
  /// first.
  [[nodiscard]] Refusal RequestStart(const TickRecord& last) noexcept;
  /// Ends the procedure after the present run, or at once if it waits for one.
  void RequestQuit() noexcept { quit_ = true; }
  /// Ends the sequence at the next safe node, holds for a moment and disarms. While no primitive is
  /// played, this is the same as RequestStop.
  void RequestFinish() noexcept { finish_ = true; }
  /// Stops the motion at once, within the limits, holds for a moment and disarms.
  void RequestStop() noexcept { stop_ = true; }
  /// Torque off at once.
  void RequestDisarm() noexcept { disarm_ = true; }

  /// Whether somebody has asked for its end.
  [[nodiscard]] bool quits() const noexcept { return quit_; }
  /// Whether the procedure is over: disarmed, and every drive was told so several times.
  [[nodiscard]] bool done() const noexcept { return phase_ == Phase::kDone; }
  /// The outcome of the present or the last run; kStopped if none was ever started.
  [[nodiscard]] RunOutcome outcome() const noexcept { return outcome_; }
  [[nodiscard]] EndHold end_hold() const noexcept {
    if (phase_ != Phase::kHoldOn) return EndHold::kNone;
    return ticks_ + 1 < config_.stop_hold_ticks ? EndHold::kBegun : EndHold::kOpen;
  }
  /// How many requests to finish or to stop were taken for the motion that had just ended
  /// (`EndHold::kBegun`).
  [[nodiscard]] int late_requests() const noexcept { return late_requests_; }
  /// How many runs were started.
  [[nodiscard]] int runs() const noexcept { return runs_; }
  [[nodiscard]] const RefusalDetail& refusal() const noexcept { return refusal_; }

 private:
  enum class Phase : std::uint8_t {
    kWait,
    kArm,
    kMove,
    kRest,
    kStart,
    kRun,
    kHold,
    kStop,
    kFault,
    kHome,  // on the way to a safe node after a fault
    kLower,
    kHoldOn,  // held until the operator disarms
    kDisarm,
    kDone
  };

  /// Tells the drives to forget their errors. @returns whether there is nothing more to do for
  /// that.
  bool Clear(const TickRecord& last, OperatorCommand& command) noexcept;
  /// The next command of a run that nothing interrupts.
  OperatorCommand GoOn(const TickRecord& last) noexcept;
  /// The same while the robot is to be armed. @param refused  of this procedure's own command.
  OperatorCommand Arm(const TickRecord& last, Refusal refused) noexcept;
  /// Holds the robot until somebody asks for torque off.
  OperatorCommand HoldOn(const TickRecord& last) noexcept;
  OperatorCommand Go(Phase phase, OperatorCommand command) noexcept;
  /// Whether setpoints have moved so far since this was last asked that the robot rocks.
  [[nodiscard]] bool HasMoved(const TickRecord& last) noexcept;
  /// Takes the torque off, after what has to be done before.
  OperatorCommand LetDown(RunOutcome outcome, const TickRecord& last) noexcept;
  void NoteStand(const TickRecord& last) noexcept;
  /// Takes the torque off.
  OperatorCommand Finish(RunOutcome outcome) noexcept;

  RunProcedureConfig config_;
  Phase phase_;
  std::int64_t ticks_ = 0;  // in the phase
  int runs_;
  bool start_ = false;
  bool quit_ = false;
  bool finish_ = false;
  bool finishing_ = false;  // whether the executor has been told to finish
  bool stop_ = false;
  bool disarm_ = false;
  int late_requests_ = 0;
  bool stands_ = true;    // whether the robot stands without torque, as far as is known
  bool lowered_ = false;  // whether the robot was lowered in this run
  std::array<float, kMaxJoints> known_rad_{};  // setpoints, see HasMoved
  std::int64_t clearing_ticks_ = 0;
  bool running_ = true;           // whether what is disarmed is a run, not the wait for one
  bool homed_ = false;            // whether the way home was tried in this run
  bool reacted_ = false;          // whether the reaction to a fault was waited for in this run
  std::int64_t loose_ticks_ = 0;  // of the hold at the end, since every drive held its joint
  RunOutcome outcome_ = RunOutcome::kPending;
  RefusalDetail refusal_;
};

}  // namespace tumbler
