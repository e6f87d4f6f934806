#include "runtime/core/run_procedure.h"

namespace tumbler {
namespace {

/// Whether every drive has replied, or reports an error.
bool WereHeard(const TickRecord& last) noexcept {
  for (std::size_t i = 0; i < last.joint_count; ++i) {
    const JointRecord& joint = last.joints[i];
    if (joint.reply_age_ticks < 0 && joint.drive_state != DriveState::kFault) return false;
  }
  return last.joint_count > 0;
}

}  // namespace

OperatorCommand RunProcedure::Go(Phase phase, OperatorCommand command) noexcept {
  phase_ = phase;
  ticks_ = 0;
  return command;
}

OperatorCommand RunProcedure::Finish(RunOutcome outcome) noexcept {
  if (outcome_ == RunOutcome::kPending) outcome_ = outcome;
  return Go(Phase::kDisarm, OperatorCommand::kDisarm);
}

OperatorCommand RunProcedure::LetDown(RunOutcome outcome) noexcept {
  if (config_.lower_ticks == 0 || lowered_) return Finish(outcome);
  if (outcome_ == RunOutcome::kPending) outcome_ = outcome;
  lowered_ = true;
  return Go(Phase::kLower, OperatorCommand::kLower);
}

Refusal RunProcedure::RequestStart(const TickRecord& last) noexcept {
  if (phase_ != Phase::kWait) return Refusal::kWrongState;
  if (last.first_fault.fault != Fault::kNone) return Refusal::kFaultLatched;
  start_ = true;
  return Refusal::kNone;
}

OperatorCommand RunProcedure::Next(const TickRecord& last) noexcept TUMBLER_NONBLOCKING {
  ++ticks_;
  if (phase_ == Phase::kDone) return OperatorCommand::kNone;
  if (phase_ == Phase::kDisarm) {
    if (ticks_ >= config_.disarmed_ticks)
      phase_ = config_.attended && !quit_ ? Phase::kWait : Phase::kDone;
    return last.state == ExecutorState::kDisarmed ? OperatorCommand::kNone
                                                  : OperatorCommand::kDisarm;
  }
  if (phase_ == Phase::kWait) {
    // Requests to a run that is over, or that has not begun, do not count for the next one.
    finish_ = finishing_ = stop_ = disarm_ = false;
    if (quit_) return Finish(RunOutcome::kStopped);
    if (!start_) return OperatorCommand::kNone;
    start_ = lowered_ = false;
    ++runs_;
    outcome_ = RunOutcome::kPending;
    refusal_ = {};
    Go(Phase::kArm, OperatorCommand::kNone);
  }
  if (disarm_) return Finish(RunOutcome::kStopped);
  const bool after_fault = phase_ == Phase::kLower && outcome_ == RunOutcome::kFault;
  if (last.first_fault.fault != Fault::kNone && phase_ != Phase::kFault && !after_fault) {
    if (outcome_ == RunOutcome::kPending) outcome_ = RunOutcome::kFault;
    return Go(Phase::kFault, OperatorCommand::kNone);
  }
  if (finish_ && phase_ != Phase::kRun) stop_ = true;
  if (stop_ && phase_ != Phase::kStop && phase_ != Phase::kFault && phase_ != Phase::kLower) {
    if (last.state == ExecutorState::kDisarmed) return Finish(RunOutcome::kStopped);
    outcome_ = RunOutcome::kStopped;
    return Go(Phase::kStop, OperatorCommand::kStop);
  }
  return GoOn(last);
}

OperatorCommand RunProcedure::GoOn(const TickRecord& last) noexcept {
  // Only refusals of this procedure's own commands count. The operator may have asked for something
  // else in between.
  const bool own = last.command == OperatorCommand::kArm || last.command == OperatorCommand::kRun;
  const Refusal refused = own ? last.refusal.refusal : Refusal::kNone;
  switch (phase_) {
    case Phase::kArm:
      if (last.state == ExecutorState::kHolding)
        return Go(Phase::kMove, OperatorCommand::kMoveToStart);
      if (last.state != ExecutorState::kDisarmed) return OperatorCommand::kNone;
      if (refused != Refusal::kNone &&
          (refused != Refusal::kNoReply || ticks_ > config_.reply_ticks_max)) {
        refusal_ = last.refusal;
        return Finish(RunOutcome::kRefused);
      }
      // Until every drive was heard, there is nothing to arm, and nothing to refuse either.
      return ticks_ > config_.reply_ticks_max || WereHeard(last) ? OperatorCommand::kArm
                                                                 : OperatorCommand::kNone;
    case Phase::kMove:
      // The first record after the command already shows the move.
      if (last.state == ExecutorState::kHolding) return Go(Phase::kStart, OperatorCommand::kRun);
      return OperatorCommand::kNone;
    case Phase::kStart:
      if (last.state == ExecutorState::kRunning) return Go(Phase::kRun, OperatorCommand::kNone);
      if (refused != Refusal::kNone &&
          (refused != Refusal::kOutsideStartSet || ticks_ > config_.start_ticks_max)) {
        refusal_ = last.refusal;
        return Finish(RunOutcome::kRefused);
      }
      return OperatorCommand::kRun;
    case Phase::kRun:
      if (last.state == ExecutorState::kHolding) return Go(Phase::kHold, OperatorCommand::kNone);
      if (!finish_ || finishing_) return OperatorCommand::kNone;
      finishing_ = true;
      return OperatorCommand::kFinish;
    case Phase::kHold:
      if (ticks_ >= config_.hold_ticks) {
        outcome_ = RunOutcome::kCompleted;
        return Go(Phase::kStop, OperatorCommand::kStop);
      }
      return OperatorCommand::kNone;
    case Phase::kStop:
      if (last.state != ExecutorState::kHolding) {
        ticks_ = 0;
        return OperatorCommand::kNone;
      }
      if (outcome_ == RunOutcome::kCompleted || ticks_ >= config_.stop_hold_ticks)
        return LetDown(outcome_);
      return OperatorCommand::kNone;
    case Phase::kFault:
      if (ticks_ >= config_.fault_ticks) return LetDown(outcome_);
      return OperatorCommand::kNone;
    case Phase::kLower:
      if (ticks_ >= config_.lower_ticks) return Finish(outcome_);
      return OperatorCommand::kNone;
    case Phase::kWait:
    case Phase::kDisarm:
    case Phase::kDone:
      break;
  }
  return OperatorCommand::kNone;
}

}  // namespace tumbler
