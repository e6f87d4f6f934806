#include "runtime/executor/run_procedure.h"

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

/// Whether every drive holds its joint, so that holding on holds the robot, by replies of this age
/// at most.
bool IsHeld(const TickRecord& last, std::int64_t age_ticks_max) noexcept {
  for (std::size_t i = 0; i < last.joint_count; ++i) {
    const JointRecord& joint = last.joints[i];
    if (joint.drive_state != DriveState::kEnabled || joint.reply_age_ticks > age_ticks_max)
      return false;
  }
  return KeepsGains(last.reaction);
}

/// Whether it may pass within a moment that a run cannot begin: the robot or its joints still move,
/// or a report of the sensor is late.
bool MayPass(Refusal refusal) noexcept {
  return refusal == Refusal::kOutsideStartSet || refusal == Refusal::kNotAtRest ||
         refusal == Refusal::kLiesOtherwise || refusal == Refusal::kPitchUnknown;
}

bool IsFaulty(const TickRecord& last) noexcept { return last.first_fault.fault != Fault::kNone; }

/// Whether there is a fault beside the operator's stop, which is latched like one where its
/// reaction is not a plain hold.
bool HasFailed(const TickRecord& last) noexcept {
  return (last.faults & ~(1U << static_cast<unsigned>(Fault::kOperatorStop))) != 0;
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

OperatorCommand RunProcedure::LetDown(RunOutcome outcome, const TickRecord& last) noexcept {
  if (outcome_ == RunOutcome::kPending) outcome_ = outcome;
  if (stands_ || lowered_ || last.reaction == Reaction::kDisable) return Finish(outcome);
  if (config_.lower_ticks > 0) {
    lowered_ = true;
    return Go(Phase::kLower, OperatorCommand::kLower);
  }
  // A pause of replies, which is no fault, is no reason to drop the robot.
  if (config_.end_hold_ticks != 0 && IsHeld(last, config_.fault_ticks)) {
    finish_ = stop_ = false;  // What was asked for is done. From now on it means torque off.
    loose_ticks_ = 0;
    return Go(Phase::kHoldOn, OperatorCommand::kNone);
  }
  return Finish(outcome);
}

/// Notes whether the robot stands without torque where it is. A hold, a stop and a fault leave it
/// where it was.
void RunProcedure::NoteStand(const TickRecord& last) noexcept {
  if (last.state == ExecutorState::kDisarmed) stands_ = true;
  if (last.state == ExecutorState::kRunning) stands_ = false;
  if (last.state == ExecutorState::kSettling)
    stands_ = (config_.safe_nodes >> static_cast<unsigned>(last.node) & 1U) != 0;
}

bool RunProcedure::HasMoved(const TickRecord& last) noexcept {
  bool moved = false;
  for (std::size_t i = 0; i < last.joint_count; ++i) {
    const float at_rad = last.joints[i].limited.position_rad;
    const float by_rad = at_rad - known_rad_[i];
    moved = moved || by_rad > kRocks_rad || by_rad < -kRocks_rad;
    known_rad_[i] = at_rad;
  }
  return moved;
}

Refusal RunProcedure::RequestStart(const TickRecord& last) noexcept {
  if (phase_ != Phase::kWait) return Refusal::kWrongState;
  if (IsFaulty(last)) return Refusal::kFaultLatched;
  start_ = true;
  return Refusal::kNone;
}

OperatorCommand RunProcedure::Next(const TickRecord& last) noexcept TUMBLER_NONBLOCKING {
  ++ticks_;
  if (phase_ == Phase::kDone) return OperatorCommand::kNone;
  if (phase_ == Phase::kDisarm) {
    // A fault may come in the very tick that takes the torque off.
    if (ticks_ == 1 && HasFailed(last) && running_ && outcome_ != RunOutcome::kRefused)
      outcome_ = RunOutcome::kFault;
    if (ticks_ >= config_.disarmed_ticks)
      phase_ = config_.attended && !quit_ ? Phase::kWait : Phase::kDone;
    return last.state == ExecutorState::kDisarmed ? OperatorCommand::kNone
                                                  : OperatorCommand::kDisarm;
  }
  NoteStand(last);
  if (phase_ == Phase::kWait) {
    // Whoever asks for rest in the tick of a start gets it.
    if (finish_ || stop_ || disarm_) start_ = false;
    // Requests to a run that is over, or that has not begun, do not count for the next one.
    finish_ = finishing_ = stop_ = disarm_ = false;
    running_ = false;
    if (quit_) return Finish(RunOutcome::kStopped);
    if (!start_) return OperatorCommand::kNone;
    start_ = lowered_ = homed_ = reacted_ = false;
    running_ = true;
    clearing_ticks_ = 0;
    ++runs_;
    outcome_ = RunOutcome::kPending;
    refusal_ = {};
    Go(Phase::kArm, OperatorCommand::kNone);
  }
  if (HasFailed(last)) outcome_ = RunOutcome::kFault;  // whatever the run was to be before
  if (disarm_) return Finish(RunOutcome::kStopped);
  if (phase_ == Phase::kHoldOn) return HoldOn(last);
  // The reaction to a fault is waited for once. What ends the run after it goes on to its end.
  // Lowering goes on through a fault that is answered by a hold.
  const bool after_fault =
      (phase_ == Phase::kLower && (reacted_ || last.reaction <= Reaction::kHold)) ||
      (phase_ == Phase::kHome && reacted_);
  if (IsFaulty(last) && phase_ != Phase::kFault && !after_fault) {
    reacted_ = true;
    if (outcome_ == RunOutcome::kPending) outcome_ = RunOutcome::kFault;
    return Go(Phase::kFault, OperatorCommand::kNone);
  }
  if (finish_ && phase_ != Phase::kRun && phase_ != Phase::kHome) stop_ = true;
  if (stop_ && phase_ != Phase::kStop && phase_ != Phase::kFault && phase_ != Phase::kLower) {
    if (last.state == ExecutorState::kDisarmed) return Finish(RunOutcome::kStopped);
    if (outcome_ != RunOutcome::kFault) outcome_ = RunOutcome::kStopped;
    return Go(Phase::kStop, OperatorCommand::kStop);
  }
  return GoOn(last);
}

OperatorCommand RunProcedure::HoldOn(const TickRecord& last) noexcept {
  // A fault does not end the hold, and does not begin it anew: a drive may answer again.
  constexpr int kFresh_ticks = 5;
  loose_ticks_ = IsHeld(last, kFresh_ticks) ? 0 : loose_ticks_ + 1;
  if (loose_ticks_ > 0 && loose_ticks_ >= config_.fault_ticks) return Finish(outcome_);
  const bool over = config_.end_hold_ticks > 0 && ticks_ >= config_.end_hold_ticks;
  // A request in the first moments was meant for the motion.
  const bool wished = finish_ || stop_;
  const bool asked = wished && ticks_ >= config_.stop_hold_ticks;
  if (wished && !asked) ++late_requests_;
  finish_ = stop_ = false;
  return over || asked ? Finish(outcome_) : OperatorCommand::kNone;
}

bool RunProcedure::Clear(const TickRecord& last, OperatorCommand& command) noexcept {
  if (clearing_ticks_ >= config_.clear_ticks || ticks_ > config_.reply_ticks_max) return true;
  if (clearing_ticks_ == 0) {
    if (!WereHeard(last)) return false;
    command = OperatorCommand::kClearFaults;
  }
  if (++clearing_ticks_ == config_.clear_ticks) ticks_ = 0;
  return false;
}

OperatorCommand RunProcedure::Arm(const TickRecord& last, Refusal refused) noexcept {
  if (last.state == ExecutorState::kHolding) {
    static_cast<void>(HasMoved(last));  // from here
    return Go(Phase::kMove, OperatorCommand::kMoveToStart);
  }
  if (last.state != ExecutorState::kDisarmed) return OperatorCommand::kNone;
  if (OperatorCommand clear = OperatorCommand::kNone; !Clear(last, clear)) return clear;
  if (refused != Refusal::kNone &&
      (refused != Refusal::kNoReply || ticks_ > config_.reply_ticks_max)) {
    refusal_ = last.refusal;
    return Finish(RunOutcome::kRefused);
  }
  // Until every drive was heard, there is nothing to arm, and nothing to refuse either.
  return ticks_ > config_.reply_ticks_max || WereHeard(last) ? OperatorCommand::kArm
                                                             : OperatorCommand::kNone;
}

OperatorCommand RunProcedure::GoOn(const TickRecord& last) noexcept {
  // Only refusals of this procedure's own commands count. The operator may have asked for something
  // else in between.
  const bool own = last.command == OperatorCommand::kArm || last.command == OperatorCommand::kRun;
  const Refusal refused = own ? last.refusal.refusal : Refusal::kNone;
  switch (phase_) {
    case Phase::kArm:
      return Arm(last, refused);
    case Phase::kMove:
      // The first record after the command already shows the move.
      if (last.state != ExecutorState::kHolding) return OperatorCommand::kNone;
      if (config_.rest_ticks > 0 && HasMoved(last)) return Go(Phase::kRest, OperatorCommand::kNone);
      return Go(Phase::kStart, OperatorCommand::kRun);
    case Phase::kRest:
      return ticks_ < config_.rest_ticks ? OperatorCommand::kNone
                                         : Go(Phase::kStart, OperatorCommand::kRun);
    case Phase::kStart:
      if (last.state == ExecutorState::kRunning) return Go(Phase::kRun, OperatorCommand::kNone);
      if (refused != Refusal::kNone && (!MayPass(refused) || ticks_ > config_.start_ticks_max)) {
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
        return LetDown(outcome_, last);
      return OperatorCommand::kNone;
    case Phase::kFault:
      // What is done after a fault comes after the motion that is rolled out.
      if (last.reaction == Reaction::kRollOut) ticks_ = 0;
      if (ticks_ < config_.fault_ticks) return OperatorCommand::kNone;
      // After a stop of the operator nothing moves any more.
      if (config_.go_home && !homed_ && !stands_ && last.reaction == Reaction::kHold &&
          HasFailed(last)) {
        homed_ = true;
        return Go(Phase::kHome, OperatorCommand::kGoHome);
      }
      return LetDown(outcome_, last);
    case Phase::kHome:
      if (last.state == ExecutorState::kHolding) return Go(Phase::kStop, OperatorCommand::kStop);
      if (last.state != ExecutorState::kFault) return OperatorCommand::kNone;
      if (last.command == OperatorCommand::kGoHome) return LetDown(outcome_, last);  // refused
      return Go(Phase::kFault, OperatorCommand::kNone);
    case Phase::kLower:
      if (ticks_ >= config_.lower_ticks) return Finish(outcome_);
      return OperatorCommand::kNone;
    case Phase::kHoldOn:
    case Phase::kWait:
    case Phase::kDisarm:
    case Phase::kDone:
      break;
  }
  return OperatorCommand::kNone;
}

}  // namespace tumbler
