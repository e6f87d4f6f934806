#include "runtime/faults.h"

namespace tumbler {

const char* ToString(ExecutorState state) noexcept {
  switch (state) {
    case ExecutorState::kDisarmed:
      return "disarmed";
    case ExecutorState::kArming:
      return "arming";
    case ExecutorState::kHolding:
      return "holding";
    case ExecutorState::kMovingToStart:
      return "moving to start";
    case ExecutorState::kRunning:
      return "running";
    case ExecutorState::kSettling:
      return "settling";
    case ExecutorState::kStopping:
      return "stopping";
    case ExecutorState::kFault:
      return "fault";
  }
  return "unknown state";
}

const char* ToString(Fault fault) noexcept {
  switch (fault) {
    case Fault::kNone:
      return "none";
    case Fault::kStaleReply:
      return "stale reply";
    case Fault::kFollowingError:
      return "following error";
    case Fault::kDriveError:
      return "drive error";
    case Fault::kOverTemperature:
      return "over-temperature";
    case Fault::kLinkLost:
      return "link lost";
    case Fault::kTransmitQueueFull:
      return "transmit queue full";
    case Fault::kLateTick:
      return "late tick";
    case Fault::kOperatorStop:
      return "operator stop";
    case Fault::kNonFinite:
      return "non-finite value";
    case Fault::kArmingTimeout:
      return "arming timeout";
    case Fault::kEntryMissed:
      return "entry missed";
  }
  return "unknown fault";
}

const char* ToString(Reaction reaction) noexcept {
  switch (reaction) {
    case Reaction::kIgnore:
      return "ignore";
    case Reaction::kHold:
      return "hold";
    case Reaction::kDamp:
      return "damp";
    case Reaction::kDisable:
      return "disable";
  }
  return "unknown reaction";
}

namespace {

constexpr Reaction I = Reaction::kIgnore;
constexpr Reaction H = Reaction::kHold;
constexpr Reaction D = Reaction::kDamp;
constexpr Reaction X = Reaction::kDisable;

constexpr std::array<std::array<Reaction, kExecutorStateCount>, kFaultCount> kDefaults{{
    // disarmed, arming, holding, moving to start, running, settling, stopping, fault
    {I, I, I, I, I, I, I, I},  // none
    {I, X, H, H, D, H, H, D},  // stale reply
    {I, X, D, D, D, D, D,
     D},  // following error: something gives way or has hit something; do not push on
    {I, X, D, D, D, D, D,
     D},  // drive error: one motor is gone, holding with the other would twist the robot
    {I, X, D, D, D, D, D, D},  // over-temperature: holding would go on heating
    {I, X, X, X, X, X, X, X},  // link lost
    {I, X, X, X, X, X, X, X},  // transmit queue full
    {I, X, H, H, D, H, H, H},  // late tick
    {I, X, H, H, H, H, H,
     H},  // operator stop: braking within the limits is what the operator expects everywhere
    {I, X, D, D, D, D, D, D},  // non-finite value
    {I, X, X, X, X, X, X, X},  // arming timeout
    {I, X, H, H, D, H, H, H},  // entry missed: it rests where the motion before has brought it
}};

}  // namespace

FaultTable::FaultTable() noexcept : reactions_(kDefaults) {}

void FaultTable::Set(Fault fault, ExecutorState state, Reaction reaction) noexcept {
  if (fault == Fault::kNone || state == ExecutorState::kDisarmed) return;
  reactions_[static_cast<std::size_t>(fault)][static_cast<std::size_t>(state)] = reaction;
}

}  // namespace tumbler
