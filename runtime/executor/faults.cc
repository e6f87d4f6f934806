#include "runtime/executor/faults.h"

namespace tumbler {

namespace {

// The names of a table by their numbers. Firmware links only these: the other texts of the tables
// are for documents.
template <std::size_t kCount, typename Table>
constexpr std::array<const char*, kCount> NamesOf(const Table& table) {
  std::array<const char*, kCount> names{};
  for (std::size_t i = 0; i < kCount; ++i) names[i] = table[i].name;
  return names;
}
template <std::size_t kCount>
const char* NameAt(const std::array<const char*, kCount>& names, std::size_t i,
                   const char* unknown) noexcept {
  return i < kCount ? names[i] : unknown;
}

constexpr auto kStateNames = NamesOf<kExecutorStateCount>(kStateTable);
constexpr auto kFaultNames = NamesOf<kFaultCount>(kFaultTable);
constexpr auto kReactionNames = [] {
  std::array<const char*, kReactionCount> names{};
  for (const ReactionInfo& info : kReactionTable)
    names[static_cast<std::size_t>(info.reaction)] = info.name;
  return names;
}();
constexpr auto kStrengths = [] {
  std::array<std::uint8_t, kReactionCount> strengths{};
  std::uint8_t place = 0;
  for (const ReactionInfo& info : kReactionTable)
    strengths[static_cast<std::size_t>(info.reaction)] = place++;
  return strengths;
}();

constexpr auto kDefaults = [] {
  std::array<std::array<Reaction, kExecutorStateCount>, kFaultCount> reactions{};
  for (std::size_t i = 0; i < kFaultCount; ++i) reactions[i] = kFaultTable[i].reactions;
  return reactions;
}();

// Whether each row of a table is at the place of its enumerator.
constexpr bool IsInOrder() {
  for (std::size_t i = 0; i < kFaultCount; ++i) {
    if (static_cast<std::size_t>(kFaultTable[i].fault) != i) return false;
  }
  for (std::size_t i = 0; i < kExecutorStateCount; ++i) {
    if (static_cast<std::size_t>(kStateTable[i].state) != i) return false;
  }
  return true;
}
static_assert(IsInOrder());

// Whether every reaction has a row.
constexpr bool HasEveryReaction() {
  for (const char* const name : kReactionNames) {
    if (name == nullptr) return false;
  }
  return true;
}
static_assert(HasEveryReaction());

}  // namespace

const char* ToString(ExecutorState state) noexcept {
  return NameAt(kStateNames, static_cast<std::size_t>(state), "unknown state");
}

const char* ToString(Fault fault) noexcept {
  return NameAt(kFaultNames, static_cast<std::size_t>(fault), "unknown fault");
}

const char* ToString(Reaction reaction) noexcept {
  return NameAt(kReactionNames, static_cast<std::size_t>(reaction), "unknown reaction");
}

Reaction Stronger(Reaction a, Reaction b) noexcept {
  return kStrengths[static_cast<std::size_t>(a)] < kStrengths[static_cast<std::size_t>(b)] ? b : a;
}

FaultTable::FaultTable() noexcept : reactions_(kDefaults) {}

bool FaultTable::IsAllowed(Fault fault, ExecutorState state, Reaction reaction) noexcept {
  if (fault == Fault::kNone || state == ExecutorState::kDisarmed) {
    return reaction == Reaction::kIgnore;
  }
  if (fault == Fault::kPaused) return reaction == Reaction::kDisable;
  if (reaction == Reaction::kIgnore) return fault != Fault::kOperatorStop;
  if (reaction == Reaction::kRollOut || reaction == Reaction::kFold) return false;
  if (reaction == Reaction::kAbort) return state == ExecutorState::kRunning;
  return state != ExecutorState::kArming || reaction == Reaction::kDisable;
}

bool FaultTable::Set(Fault fault, ExecutorState state, Reaction reaction) noexcept {
  if (!IsAllowed(fault, state, reaction)) return false;
  reactions_[static_cast<std::size_t>(fault)][static_cast<std::size_t>(state)] = reaction;
  return true;
}

bool FaultTable::Has(Reaction reaction) const noexcept {
  for (const auto& row : reactions_) {
    for (const Reaction entry : row) {
      if (entry == reaction) return true;
    }
  }
  return false;
}

DetailUnit UnitOf(Fault fault) noexcept {
  switch (fault) {
    case Fault::kNone:
    case Fault::kOperatorStop:
      return DetailUnit::kNone;
    case Fault::kStaleReply:
    case Fault::kHeartbeatLost:
    case Fault::kLateTick:
    case Fault::kArmingTimeout:
    case Fault::kPaused:
      return DetailUnit::kTicks;
    case Fault::kWrongSequence:
    case Fault::kSensorLost:  // The number of a SensorStatus, as of the next.
    case Fault::kPitchUnknown:
      return DetailUnit::kCount;
    case Fault::kDriveError:
      return DetailUnit::kCode;
    case Fault::kForeignCommand:
      return DetailUnit::kIdentifier;
    case Fault::kBusOff:
    case Fault::kInterfaceDown:
    case Fault::kInterfaceGone:
    case Fault::kLinkFailed:
    case Fault::kTransmitQueueFull:
      return DetailUnit::kStatus;
    case Fault::kErrorPassive:
      return DetailUnit::kControllerState;
    case Fault::kFollowingError:
    case Fault::kNonFinite:
    case Fault::kEntryMissed:
    case Fault::kFallen:
      return DetailUnit::kRadians;
    case Fault::kOverTemperature:
      return DetailUnit::kCelsius;
  }
  return DetailUnit::kNone;
}

}  // namespace tumbler
