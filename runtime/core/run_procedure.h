#pragma once

#include <cstdint>

#include "common/realtime.h"
#include "runtime/core/tick.h"

namespace tumbler {

/// How long the parts of one run may take and last.
struct RunProcedureConfig {
  std::int64_t hold_ticks = 2000;      ///< Holding after the motion has settled.
  std::int64_t reply_ticks_max = 500;  ///< For every drive to reply before arming.
  std::int64_t start_ticks_max =
      1000;  ///< For the joints to come to rest in the start set after the move.
  std::int64_t stop_hold_ticks = 500;  ///< Holding after an operator stop, before torque off.
  std::int64_t fault_ticks = 1000;     ///< Carrying out the reaction to a fault, before torque off.
  std::int64_t disarmed_ticks = 10;    ///< Saying torque off at the end, in case a frame is lost.
  /// Disarmed, wait for RequestStart before each run, and for the next one after it, until
  /// RequestQuit. Otherwise there is one run, which starts by itself.
  bool attended = false;
};

/// How a run ended.
enum class RunOutcome : std::uint8_t {
  kPending,
  kCompleted,
  kRefused,  ///< `RunProcedure::refusal()` says why.
  kFault,    ///< The record's `first_fault` says which.
  kStopped,  ///< By the operator.
};

/// The operator of a run: arm, move to the start, run, settle, hold, stop, disarm; of one, or of
/// one after another where somebody attends. Pure, like the executor.
class RunProcedure {
 public:
  explicit RunProcedure(const RunProcedureConfig& config) noexcept
      : config_(config),
        phase_(config.attended ? Phase::kWait : Phase::kArm),
        runs_(config.attended ? 0 : 1) {}

  /// The command for the next tick.
  /// @param last  the record of the tick before; a default record before the first.
  [[nodiscard]] OperatorCommand Next(const TickRecord& last) noexcept TUMBLER_NONBLOCKING;

  /// Begins a run where one is waited for.
  /// @param last  the record of the tick before.
  /// @returns kNone; kWrongState where none is waited for; kFaultLatched: clear the faults first.
  [[nodiscard]] Refusal RequestStart(const TickRecord& last) noexcept;
  /// After this run, or at once where one is waited for, it is over.
  void RequestQuit() noexcept { quit_ = true; }
  /// Ends the sequence at the next safe node, holds for a moment and disarms. Where no primitive is
  /// being played, the same as RequestStop.
  void RequestFinish() noexcept { finish_ = true; }
  /// Stops the motion at once, within the limits, holds for a moment and disarms.
  void RequestStop() noexcept { stop_ = true; }
  /// Torque off at once.
  void RequestDisarm() noexcept { disarm_ = true; }

  /// Over: disarmed, and every drive told so several times.
  [[nodiscard]] bool done() const noexcept { return phase_ == Phase::kDone; }
  /// Of the present run, or the last. Stopped, where none was ever started.
  [[nodiscard]] RunOutcome outcome() const noexcept { return outcome_; }
  [[nodiscard]] int runs() const noexcept { return runs_; }  ///< Started.
  [[nodiscard]] const RefusalDetail& refusal() const noexcept { return refusal_; }

 private:
  enum class Phase : std::uint8_t {
    kWait,
    kArm,
    kMove,
    kStart,
    kRun,
    kHold,
    kStop,
    kFault,
    kDisarm,
    kDone
  };

  /// The command of a run that nothing has come between.
  OperatorCommand GoOn(const TickRecord& last) noexcept;
  OperatorCommand Go(Phase phase, OperatorCommand command) noexcept;
  OperatorCommand Finish(RunOutcome outcome) noexcept;

  RunProcedureConfig config_;
  Phase phase_;
  std::int64_t ticks_ = 0;  // in the phase
  int runs_;
  bool start_ = false;
  bool quit_ = false;
  bool finish_ = false;
  bool finishing_ = false;  // The executor knows.
  bool stop_ = false;
  bool disarm_ = false;
  RunOutcome outcome_ = RunOutcome::kPending;
  RefusalDetail refusal_;
};

}  // namespace tumbler
