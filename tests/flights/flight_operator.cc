#include "tests/flights/flight_operator.h"

namespace tumbler::testing {

OperatorCommand FlightOperator::Next(const TickRecord& last, ExecutorState state) {
  wants_repair_ = false;
  ++ticks_;
  if (state != state_) {
    state_ = state;
    ticks_ = 0;
    tries_ = 0;
  }
  return setting_.by_procedure ? NextOfProcedure(last, state) : NextByHand(last, state);
}

void FlightOperator::Request(FlightRequest request, const TickRecord& last) {
  switch (request) {
    case FlightRequest::kStart:
      static_cast<void>(procedure_.RequestStart(last));
      break;
    case FlightRequest::kFinish:
      procedure_.RequestFinish();
      break;
    case FlightRequest::kStop:
      procedure_.RequestStop();
      break;
    case FlightRequest::kDisarm:
      procedure_.RequestDisarm();
      break;
    case FlightRequest::kQuit:
      procedure_.RequestQuit();
      break;
  }
}

OperatorCommand FlightOperator::NextOfProcedure(const TickRecord& last, ExecutorState state) {
  const OperatorCommand command = procedure_.Next(last);
  const bool waits =
      procedure_.done() || (setting_.procedure.attended && state == ExecutorState::kDisarmed &&
                            procedure_.RequestStart(last) == Refusal::kFaultLatched);
  idle_ticks_ = waits ? idle_ticks_ + 1 : 0;
  if (!waits || idle_ticks_ <= setting_.patience_ticks) return command;
  idle_ticks_ = 0;
  wants_repair_ = true;
  // The program ends, and is started anew.
  if (procedure_.done()) procedure_ = RunProcedure(setting_.procedure);
  return OperatorCommand::kClearFaults;
}

OperatorCommand FlightOperator::Ready(const TickRecord& last) {
  const bool refused = ++tries_ > 4;
  if (last.faults != 0 || refused) {
    tries_ = 0;
    wants_repair_ = true;
    return OperatorCommand::kClearFaults;
  }
  moved_ = false;
  return OperatorCommand::kArm;
}

OperatorCommand FlightOperator::NextByHand(const TickRecord& last, ExecutorState state) {
  constexpr std::int64_t kLongRun = 2500;
  const std::int64_t patience = setting_.patience_ticks;
  const bool due = ticks_ % (patience + 1) == patience;
  switch (state) {
    case ExecutorState::kDisarmed:
      return due ? Ready(last) : OperatorCommand::kNone;
    case ExecutorState::kHolding:
      if (!due) break;
      if (++tries_ > 8) return OperatorCommand::kDisarm;
      moved_ = !moved_;
      if (random_.Chance(0.03)) return OperatorCommand::kLower;
      return moved_ ? OperatorCommand::kMoveToStart : OperatorCommand::kRun;
    case ExecutorState::kRunning:
    case ExecutorState::kSettling:
      if (ticks_ > kLongRun && due)
        return random_.Chance(0.7) ? OperatorCommand::kFinish : OperatorCommand::kStop;
      break;
    case ExecutorState::kFault:
      if (!due) break;
      if (tries_++ == 0 && last.reaction == Reaction::kHold && random_.Chance(0.7))
        return OperatorCommand::kGoHome;
      if (random_.Chance(0.1)) return OperatorCommand::kLower;
      return OperatorCommand::kDisarm;
    case ExecutorState::kArming:
    case ExecutorState::kMovingToStart:
    case ExecutorState::kStopping:
      break;
  }
  return OperatorCommand::kNone;
}

}  // namespace tumbler::testing
