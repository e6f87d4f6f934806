#include "runtime/executor/tick.h"

namespace tumbler {

const char* ToString(ReplyStatus status) noexcept {
  switch (status) {
    case ReplyStatus::kOk:
      return "ok";
    case ReplyStatus::kNoNewData:
      return "no new data";
    case ReplyStatus::kRepeated:
      return "repeated";
    case ReplyStatus::kOkSomeLost:
      return "ok, some lost";
    case ReplyStatus::kOkSomeLate:
      return "ok, some late";
  }
  return "unknown reply status";
}

const char* ToString(OperatorCommand command) noexcept {
  switch (command) {
    case OperatorCommand::kNone:
      return "none";
    case OperatorCommand::kArm:
      return "arm";
    case OperatorCommand::kMoveToStart:
      return "move to start";
    case OperatorCommand::kRun:
      return "run";
    case OperatorCommand::kStop:
      return "stop";
    case OperatorCommand::kDisarm:
      return "disarm";
    case OperatorCommand::kClearFaults:
      return "clear faults";
    case OperatorCommand::kFinish:
      return "finish";
    case OperatorCommand::kGoHome:
      return "go home";
    case OperatorCommand::kLower:
      return "lower";
    case OperatorCommand::kBranch:
      return "branch";
  }
  return "unknown command";
}

const char* ToString(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::kNone:
      return "none";
    case Refusal::kWrongState:
      return "not possible in this state";
    case Refusal::kNotConfigured:
      return "no primitive is loaded";
    case Refusal::kFaultLatched:
      return "a fault is latched";
    case Refusal::kNoReply:
      return "a drive does not reply";
    case Refusal::kNoHeartbeat:
      return "a drive's heartbeat has stopped";
    case Refusal::kTurnsLost:
      return "a joint is whole turns of its drive away from where it was last known: the drive has "
             "lost its zero";
    case Refusal::kMoved:
      return "a joint is far from where it was last known";
    case Refusal::kFarFromStart:
      return "a joint is far from the motion's start: is it the right joint, with the right zero? "
             "(tumbler run --start-within)";
    case Refusal::kDriveError:
      return "a drive reports an error";
    case Refusal::kTooHot:
      return "a drive is too hot";
    case Refusal::kOutsideLimits:
      return "a joint is outside its position limits";
    case Refusal::kNotAtStart:
      return "the commanded pose is not the start of the primitive";
    case Refusal::kOutsideStartSet:
      return "a joint is outside the start set of the primitive";
    case Refusal::kNoSuchBranch:
      return "the sequence has no such branch";
    case Refusal::kPitchUnknown:
      return "the sensor does not tell how the robot lies: say it (tumbler run --from)";
    case Refusal::kNotAtRest:
      return "the robot still turns";
    case Refusal::kLiesOtherwise:
      return "the robot lies otherwise than at any beginning of the sequence, or than was said "
             "(tumbler run --from): the nearest is off by";
  }
  return "unknown refusal";
}

DetailUnit UnitOf(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::kNone:
    case Refusal::kWrongState:
    case Refusal::kNotConfigured:
    case Refusal::kFaultLatched:
      return DetailUnit::kNone;
    case Refusal::kNoReply:
    case Refusal::kNoHeartbeat:
      return DetailUnit::kTicks;
    case Refusal::kDriveError:
      return DetailUnit::kCode;
    case Refusal::kNoSuchBranch:
      return DetailUnit::kBranch;
    case Refusal::kPitchUnknown:
      return DetailUnit::kCount;
    case Refusal::kNotAtRest:
      return DetailUnit::kRadiansPerSecond;
    case Refusal::kTooHot:
      return DetailUnit::kCelsius;
    case Refusal::kOutsideLimits:
    case Refusal::kNotAtStart:
    case Refusal::kOutsideStartSet:
    case Refusal::kFarFromStart:
    case Refusal::kTurnsLost:
    case Refusal::kMoved:
    case Refusal::kLiesOtherwise:
      return DetailUnit::kRadians;
  }
  return DetailUnit::kNone;
}

}  // namespace tumbler
