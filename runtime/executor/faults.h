#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace tumbler {

/// The executor's states. `kStateTable` says more about each, and `kTransitionTable` how one leads
/// to another.
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

/// The faults that the executor finds. `kFaultTable` says what each is, in which unit its value and
/// limit are, and how it is answered.
enum class Fault : std::uint8_t {
  kNone,
  kStaleReply,
  kWrongSequence,
  kFollowingError,
  kDriveError,
  kHeartbeatLost,
  kOverTemperature,
  kBusOff,
  kErrorPassive,
  kInterfaceDown,
  kInterfaceGone,
  kLinkFailed,
  kTransmitQueueFull,
  kLateTick,
  kOperatorStop,
  kNonFinite,
  kArmingTimeout,
  kEntryMissed,
  kForeignCommand,
  kSensorLost,
  kFallen,
  kPaused,
  kPitchUnknown,
};
inline constexpr std::size_t kFaultCount = 23;  ///< Including kNone.

/// The answers to a fault. The numbers are those of messages and flight records; `kReactionTable`
/// has them in the order of their strength.
enum class Reaction : std::uint8_t {
  kIgnore,    ///< Nothing; the fault is not even latched.
  kHold,      ///< Brake within the acceleration limits and hold.
  kCollapse,  ///< Brake, and fold into the configured pose, slowly and softly.
  kDamp,      ///< Resist motion only, so that the robot sinks rather than drops.
  kDisable,   ///< Torque off.
  kRollOut,   ///< Go on with the motion to its end.
  kFold,      ///< Fold into the pose of the motion's table of aborts.
  /// As that table says of the time: kHold, kRollOut, kFold or kDamp. Only entries of `FaultTable`
  /// have this value; what is carried out is one of the others.
  kAbort,
};
inline constexpr std::size_t kReactionCount = 8;

/// Whether joints are moved or held with their normal gains, so that they have to follow.
[[nodiscard]] constexpr bool KeepsGains(Reaction reaction) noexcept {
  return reaction == Reaction::kIgnore || reaction == Reaction::kHold ||
         reaction == Reaction::kRollOut || reaction == Reaction::kFold;
}
/// Whether setpoints of position take effect in this state, under the reaction that is carried out
/// in kFault: not without torque, while drives start up, and under damping.
[[nodiscard]] constexpr bool ControlsPosition(ExecutorState state, Reaction reaction) noexcept {
  const bool loose = reaction == Reaction::kDamp || reaction == Reaction::kDisable;
  return state != ExecutorState::kDisarmed && state != ExecutorState::kArming &&
         !(state == ExecutorState::kFault && loose);
}
/// Whether the setpoints are those of a primitive's motion.
[[nodiscard]] constexpr bool PlaysMotion(ExecutorState state, Reaction reaction) noexcept {
  return state == ExecutorState::kRunning ||
         (state == ExecutorState::kFault && reaction == Reaction::kRollOut);
}
/// The stronger of two reactions.
[[nodiscard]] Reaction Stronger(Reaction a, Reaction b) noexcept;

/// Texts for messages and logs, e.g. `following error`; string literals.
[[nodiscard]] const char* ToString(ExecutorState state) noexcept;
[[nodiscard]] const char* ToString(Fault fault) noexcept;
[[nodiscard]] const char* ToString(Reaction reaction) noexcept;

/// The tables below are the one place where states, faults and reactions are described: the
/// defaults of `FaultTable`, the names, the keys of files (names with `_` for blanks and `-`) and
/// the tables of `docs/runtime.md` come from here.

struct StateInfo {
  ExecutorState state;
  const char* name;
  const char* setpoints;  ///< The setpoints that are sent in this state.
};

/// A change of state that can happen; there are no others. In addition, kDisarm leads from every
/// state to kDisarmed, and a fault that is not ignored from every state but kDisarmed to kFault.
struct TransitionInfo {
  ExecutorState from;
  ExecutorState to;
  const char* when;
};

struct ReactionInfo {
  Reaction reaction;
  const char* name;
  const char* meaning;
};

struct FaultInfo {
  Fault fault;
  const char* name;
  const char* seen_when;
  const char* value;      ///< Unit or meaning of `FaultDetail::value` and `limit`; empty: none.
  const char* limit_key;  ///< The key of files that sets the limit; empty: not configurable.
  std::array<Reaction, kExecutorStateCount> reactions;  ///< Defaults, in the order of the states.
  const char* why;                                      ///< The reason for the defaults.
};

inline constexpr std::array<StateInfo, kExecutorStateCount> kStateTable{{
    {ExecutorState::kDisarmed, "disarmed", "torque off; the drives are asked for their positions"},
    {ExecutorState::kArming, "arming",
     "each joint's measured position, velocity 0, until its drive is enabled"},
    {ExecutorState::kHolding, "holding", "the last commanded setpoint, at rest"},
    {ExecutorState::kMovingToStart, "moving to start",
     "quintic from rest to rest, from the last commanded position"},
    {ExecutorState::kRunning, "running", "the splines of the node's primitive"},
    {ExecutorState::kSettling, "settling", "the primitive's last setpoint, feed-forward included"},
    {ExecutorState::kStopping, "stopping",
     "braking from the commanded velocity at the acceleration limit"},
    {ExecutorState::kFault, "fault", "the reaction to the fault"},
}};

inline constexpr std::array<TransitionInfo, 15> kTransitionTable{{
    {ExecutorState::kDisarmed, ExecutorState::kArming, "`kArm`, unless refused"},
    {ExecutorState::kArming, ExecutorState::kHolding, "every drive was seen off, and then enabled"},
    {ExecutorState::kHolding, ExecutorState::kMovingToStart, "`kMoveToStart`, unless refused"},
    {ExecutorState::kHolding, ExecutorState::kRunning, "`kRun`, unless refused"},
    {ExecutorState::kMovingToStart, ExecutorState::kHolding, "arrived"},
    {ExecutorState::kMovingToStart, ExecutorState::kRunning,
     "a robot that gets up lies as a node begins"},
    {ExecutorState::kMovingToStart, ExecutorState::kStopping, "`kStop`"},
    {ExecutorState::kRunning, ExecutorState::kSettling,
     "the time is over and the limited setpoint has arrived"},
    {ExecutorState::kRunning, ExecutorState::kStopping, "`kStop`"},
    {ExecutorState::kSettling, ExecutorState::kRunning,
     "the edge's settle time is over, and the next node begins"},
    {ExecutorState::kSettling, ExecutorState::kMovingToStart,
     "the robot has fallen, and is to get up"},
    {ExecutorState::kSettling, ExecutorState::kHolding,
     "the primitive's settle time is over, and the sequence ends"},
    {ExecutorState::kSettling, ExecutorState::kStopping, "`kStop`"},
    {ExecutorState::kStopping, ExecutorState::kHolding, "at rest"},
    {ExecutorState::kFault, ExecutorState::kSettling,
     "`kGoHome`, unless refused: the reaction is hold, in the pose of a node's end"},
}};

/// Mildest first; last the one that stands for another.
inline constexpr std::array<ReactionInfo, kReactionCount> kReactionTable{{
    {Reaction::kIgnore, "ignore", "nothing; the fault is not latched"},
    {Reaction::kHold, "hold", "brakes at the acceleration limit and holds, with the normal gains"},
    {Reaction::kRollOut, "roll out",
     "the motion as planned, to its end, and then *hold* with the feed-forward there; only by "
     "*abort*"},
    {Reaction::kFold, "fold",
     "goes to the pose of the motion's table of aborts and holds there, within a share of the "
     "limits of velocity and acceleration, with the normal gains and no feed-forward; only by "
     "*abort*"},
    {Reaction::kCollapse, "collapse",
     "brakes, folds slowly into the configured pose and stays there, with reduced stiffness and no "
     "feed-forward"},
    {Reaction::kDamp, "damp",
     "kp = 0, no feed-forward, velocity 0 and kd = `damping_nm_s_per_rad`: the robot sinks rather "
     "than drops"},
    {Reaction::kDisable, "disable", "torque off"},
    {Reaction::kAbort, "abort",
     "as the motion's [table of aborts](#aborts) says of the time: *hold* (catch), *roll out*, "
     "*fold* or *damp*"},
}};

namespace fault_table_detail {  // so that rows are short enough to be read
inline constexpr Reaction A = Reaction::kAbort;
inline constexpr Reaction I = Reaction::kIgnore;
inline constexpr Reaction H = Reaction::kHold;
inline constexpr Reaction D = Reaction::kDamp;
inline constexpr Reaction X = Reaction::kDisable;

// clang-format off
inline constexpr std::array<FaultInfo, kFaultCount> kFaults{{
    // reactions: disarmed, arming, holding, moving to start, running, settling, stopping, fault
    {Fault::kNone, "none", "", "", "", {I, I, I, I, I, I, I, I}, ""},
    {Fault::kStaleReply, "stale reply", "a drive has sent no measured position for too long",
     "ticks", "stale_ticks_max", {I, X, H, H, A, H, H, D},
     "at rest the last setpoint is still right; in mid-swing a pause of replies is no dead drive yet"},
    {Fault::kWrongSequence, "wrong sequence",
     "more replies come than are owed by the last `stale_ticks_max` ticks: a count that such a tick "
     "raises by 2 and any other with replies lowers by 1",
     "count", "sequence_errors_max", {I, X, H, H, A, H, H, D}, "as a stale reply: what is measured is not from now"},
    {Fault::kFollowingError, "following error",
     "measured less setpoint exceeds the primitive's following tolerance", "rad", "",
     {I, X, D, D, D, D, D, D}, "something gives way or has been hit; do not push on"},
    {Fault::kDriveError, "drive error",
     "a drive reports an error, or has stopped being enabled by itself", "its code, or 0", "",
     {I, X, D, D, D, D, D, D}, "one motor is gone; holding with the other would twist the robot"},
    {Fault::kHeartbeatLost, "heartbeat lost",
     "a drive's own heartbeat has stopped (CANSimple, CiA 402): whether it is enabled is not known",
     "ticks", "", {I, X, H, H, A, H, H, D}, "as a stale reply"},
    {Fault::kOverTemperature, "over-temperature", "a drive is hotter than its `temperature_max_c`",
     "degrees C", "", {I, X, D, D, D, D, D, D}, "holding would go on heating"},
    {Fault::kBusOff, "bus-off", "the controller has left the bus, in sending or receiving",
     "status", "", {I, X, X, X, X, X, X, X}, "orders that arrive late, if at all, can only be torque off"},
    {Fault::kErrorPassive, "error-passive",
     "an error counter of the controller is above 127: nobody acknowledges, or the wire is bad",
     "controller state", "", {I, X, H, H, D, H, H, D},
     "bus-off may be next: act while orders still arrive"},
    {Fault::kInterfaceDown, "interface down", "the interface is down", "status", "",
     {I, X, X, X, X, X, X, X}, "as bus-off"},
    {Fault::kInterfaceGone, "interface gone", "the interface does not exist any more", "status", "",
     {I, X, X, X, X, X, X, X}, "as bus-off"},
    {Fault::kLinkFailed, "link failed", "the link reports another error", "status", "",
     {I, X, X, X, X, X, X, X}, "as bus-off"},
    {Fault::kTransmitQueueFull, "transmit queue full",
     "a frame was not taken (ENOBUFS), or what was sent before is not confirmed", "status", "",
     {I, X, X, X, X, X, X, X}, "a setpoint that waits in a queue would snap the joint when the bus comes back"},
    {Fault::kLateTick, "late tick",
     "too many periods were missed, or the tick number did not grow", "ticks", "late_ticks_max",
     {I, X, H, H, A, H, H, H}, "the drives obey, but the motion is late: what hurts least depends on the time"},
    {Fault::kOperatorStop, "operator stop",
     "`kStop`, where its reaction is not hold (hold is the state stopping, and not latched)", "", "",
     {I, X, H, H, A, H, H, H}, "braking within the limits is what the operator expects, but in mid-swing it may fell the robot"},
    {Fault::kNonFinite, "non-finite value", "a measurement or a setpoint is NaN or infinite",
     "the position", "", {I, X, D, D, D, D, D, D}, "nothing can be followed that is not a number"},
    {Fault::kArmingTimeout, "arming timeout", "a drive is not enabled in time", "ticks",
     "arming_ticks_max", {I, X, X, X, X, X, X, X}, "nothing is driven yet"},
    {Fault::kEntryMissed, "entry missed",
     "a joint is not within the next primitive's entry tolerance at a splice", "rad", "",
     {I, X, H, H, D, H, H, H}, "it rests where the motion before has brought it"},
    {Fault::kForeignCommand, "foreign command",
     "a drive was sent a frame that only a host sends: somebody else commands it",
     "identifier, or 0", "", {I, X, D, D, D, D, D, D},
     "of two that pull at a joint one has to give way, and the other cannot be asked"},
    {Fault::kSensorLost, "sensor lost",
     "the inertial sensor is [stale or implausible](#the-sensor)", "its status", "",
     {I, I, I, I, I, I, I, I}, "the gains fade, and the motion goes on as it was planned"},
    {Fault::kFallen, "fallen",
     "by its sensor the robot is not where the motion leaves it, within the sequence's `within_rad`, and does not [get up](#a-robot-that-falls)", "rad",
     "", {I, X, H, H, D, H, H, H}, "it lies, and no motion begins so"},
    {Fault::kPaused, "paused",
     "no setpoint was sent for so long that a drive may have let go, or the computer was suspended; "
     "nothing but *disable* is allowed",
     "ticks", "", {I, X, X, X, X, X, X, X},
     "where the robot is now, a setpoint of before would snap it back with full stiffness"},
    {Fault::kPitchUnknown, "pitch unknown",
     "at the end of a node of a sequence with beginnings the inertial sensor does not tell whether "
     "the robot has fallen: it is implausible, or has been silent or late for 1 s",
     "its status", "", {I, X, H, H, D, H, H, H}, "a robot that may lie is not driven on"},
}};
// clang-format on
}  // namespace fault_table_detail

inline constexpr const std::array<FaultInfo, kFaultCount>& kFaultTable =
    fault_table_detail::kFaults;

/// The table that says how each fault is answered in each state.
///
/// The defaults follow three rules. While disarmed nothing is driven, so nothing is a fault, and
/// arming checks everything. A robot at rest or in a slow move holds, but one in mid-swing must not
/// be frozen there: where its drives still obey, the motion's table of aborts says what hurts least
/// (kAbort), and else it is damped. Where frames may arrive late or not at all, the only order
/// worth sending is torque off.
class FaultTable {
 public:
  FaultTable() noexcept;  ///< The defaults.

  [[nodiscard]] Reaction operator()(Fault fault, ExecutorState state) const noexcept {
    return reactions_[static_cast<std::size_t>(fault)][static_cast<std::size_t>(state)];
  }

  /// Whether `Set` takes this entry. While disarmed nothing is a fault. While arming no drive is
  /// driven yet, so the reaction is kIgnore or kDisable. A stop of the operator is never ignored.
  /// After a pause nothing but kDisable is right.
  /// kAbort is for kRunning alone; kRollOut and kFold only come of it.
  [[nodiscard]] static bool IsAllowed(Fault fault, ExecutorState state, Reaction reaction) noexcept;
  /// Changes one entry. @returns false, having changed nothing, unless `IsAllowed`.
  bool Set(Fault fault, ExecutorState state, Reaction reaction) noexcept;
  /// Whether any entry is this reaction.
  [[nodiscard]] bool Has(Reaction reaction) const noexcept;

 private:
  std::array<std::array<Reaction, kExecutorStateCount>, kFaultCount> reactions_;
};

/// What the numbers of a fault or a refusal are.
enum class DetailUnit : std::uint8_t {
  kNone,
  kTicks,
  kCount,
  kCode,             ///< A drive's own code, of 32 bits.
  kIdentifier,       ///< Of a frame.
  kStatus,           ///< `Status`
  kControllerState,  ///< `CanControllerState`
  kBranch,           ///< The number of a branch.
  kRadians,
  kRadiansPerSecond,
  kCelsius,
};
/// Whether numbers of this unit are integers.
[[nodiscard]] constexpr bool IsInteger(DetailUnit unit) noexcept {
  return unit != DetailUnit::kRadians && unit != DetailUnit::kRadiansPerSecond &&
         unit != DetailUnit::kCelsius;
}
[[nodiscard]] DetailUnit UnitOf(Fault fault) noexcept;

/// A number of a fault or a refusal: an integer, or a real number, as its unit says. Codes and
/// identifiers keep all of their 32 bits.
struct DetailNumber {
  std::uint32_t bits = 0;  ///< Of an integer, or of a float.

  [[nodiscard]] static constexpr DetailNumber Real(float value) noexcept {
    return {std::bit_cast<std::uint32_t>(value)};
  }
  /// Saturates at the ends of 32 bits with sign.
  [[nodiscard]] static constexpr DetailNumber Integer(std::int64_t value) noexcept {
    using Limits = std::numeric_limits<std::int32_t>;
    return {
        static_cast<std::uint32_t>(std::clamp<std::int64_t>(value, Limits::min(), Limits::max()))};
  }
  [[nodiscard]] static constexpr DetailNumber Code(std::uint32_t value) noexcept { return {value}; }

  [[nodiscard]] constexpr float real() const noexcept { return std::bit_cast<float>(bits); }
  [[nodiscard]] constexpr std::int32_t integer() const noexcept {
    return static_cast<std::int32_t>(bits);
  }
  [[nodiscard]] constexpr std::uint32_t code() const noexcept { return bits; }
  [[nodiscard]] friend constexpr bool operator==(DetailNumber a, DetailNumber b) noexcept = default;
};

/// One fault as it was found.
struct FaultDetail {
  std::int64_t tick = 0;
  DetailNumber value;  ///< What was seen, in `UnitOf(fault)`.
  DetailNumber limit;  ///< What would have been allowed, likewise.
  Fault fault = Fault::kNone;
  std::int8_t joint = -1;  ///< Index of the joint; -1 when the fault concerns all of them.
  ExecutorState state = ExecutorState::kDisarmed;  ///< The state in which it happened.
  Reaction reaction = Reaction::kIgnore;  ///< That the table asked for; of kAbort, what it was.
};

}  // namespace tumbler
