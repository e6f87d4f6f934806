#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace tumbler {

/// What the executor is doing. `docs/runtime.md` draws the transitions.
enum class ExecutorState : std::uint8_t {
  kDisarmed,       ///< Torque off; the drives are asked for their positions all the same.
  kArming,         ///< The drives are starting up, each at its measured position.
  kHolding,        ///< At rest at the last commanded setpoint.
  kMovingToStart,  ///< On a quintic from rest to rest, towards the primitive's first position.
  kRunning,        ///< Playing the primitive.
  kSettling,       ///< The primitive has ended; its last setpoint is held for its settle time.
  kStopping,       ///< Braking from the commanded velocity, within the acceleration limits.
  kFault,          ///< Carrying out the reaction to a fault until the operator disarms.
};
inline constexpr std::size_t kExecutorStateCount = 8;

/// What can go wrong. `FaultReport::value` and `limit` are in the unit given here.
enum class Fault : std::uint8_t {
  kNone,
  kStaleReply,      ///< A drive has been silent too long [ticks].
  kFollowingError,  ///< A joint is too far from the setpoint it was sent [rad].
  kDriveError,      ///< A drive reports an error [its code; 0: it stopped being enabled by itself].
  kOverTemperature,    ///< [degrees C]
  kLinkLost,           ///< The bus is off, down or failing [Status].
  kTransmitQueueFull,  ///< Frames are not leaving the queue: nobody acknowledges them [Status].
  kLateTick,       ///< More control periods were missed than are made up for [ticks], or time went
                   ///< backwards.
  kOperatorStop,   ///< The operator asked for a stop.
  kNonFinite,      ///< A measurement or a setpoint is NaN or infinite.
  kArmingTimeout,  ///< A drive did not become enabled [ticks].
  kEntryMissed,    ///< A joint is not where the next primitive of the sequence begins [rad].
};
inline constexpr std::size_t kFaultCount = 12;  ///< Including kNone.

/// What to do about a fault, mildest first.
enum class Reaction : std::uint8_t {
  kIgnore,   ///< Nothing; the fault is not even latched.
  kHold,     ///< Brake within the acceleration limits and hold.
  kDamp,     ///< No position, no feed-forward: the motors only resist motion, so the robot sinks
             ///< rather than drops.
  kDisable,  ///< Torque off.
};
inline constexpr std::size_t kReactionCount = 4;

/// Texts for messages and logs, e.g. `following error`; string literals.
[[nodiscard]] const char* ToString(ExecutorState state) noexcept;
[[nodiscard]] const char* ToString(Fault fault) noexcept;
[[nodiscard]] const char* ToString(Reaction reaction) noexcept;

/// The one table that says how each fault is answered in each state.
///
/// The defaults follow three rules. While disarmed nothing is driven, so nothing is a fault: arming
/// checks it all. A robot at rest or in a slow move holds; one in mid-swing must not be frozen
/// there, so it is damped. Where frames may be arriving late or not at all, the only order worth
/// sending is torque off: a setpoint that waits in a queue would snap the joint when the bus comes
/// back.
class FaultTable {
 public:
  FaultTable() noexcept;  ///< The defaults.

  [[nodiscard]] Reaction operator()(Fault fault, ExecutorState state) const noexcept {
    return reactions_[static_cast<std::size_t>(fault)][static_cast<std::size_t>(state)];
  }
  /// Changes one entry. The disarmed column and the row of kNone stay kIgnore.
  void Set(Fault fault, ExecutorState state, Reaction reaction) noexcept;

 private:
  std::array<std::array<Reaction, kExecutorStateCount>, kFaultCount> reactions_;
};

/// One fault as it was found.
struct FaultReport {
  std::int64_t tick = 0;
  float value = 0;  ///< What was seen, in the unit of the fault.
  float limit = 0;  ///< What would have been allowed.
  Fault fault = Fault::kNone;
  std::int8_t joint = -1;  ///< Index of the joint; -1 when it concerns all of them.
  ExecutorState state = ExecutorState::kDisarmed;  ///< In which it happened.
  Reaction reaction = Reaction::kIgnore;           ///< What the table asked for.
};

}  // namespace tumbler
