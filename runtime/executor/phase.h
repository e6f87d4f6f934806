#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "runtime/executor/faults.h"

namespace tumbler {

/// What the executor does: its states, finer than what it tells. Every phase is published as one
/// `ExecutorState`, and the fault table answers by that.
enum class Phase : std::uint8_t {
  kDisarmed,
  kArming,
  kHolding,
  kMovingToStart,
  kGettingUp,  ///< A move to the start, within a run, because the robot has fallen.
  kRunning,
  kRunningHome,  ///< After a fault that was held: on the way to the next safe node.
  kSettling,
  kSettlingHome,
  kStopping,
  kLowering,         ///< A hold whose stiffness fades away.
  kLoweringInFault,  ///< The same of the answer to a fault.
  kFault,
};
inline constexpr std::size_t kPhaseCount = 13;

/// The state as which a phase is published: in records, messages and the fault table.
[[nodiscard]] constexpr ExecutorState StateOf(Phase phase) noexcept {
  using enum ExecutorState;
  constexpr std::array<ExecutorState, kPhaseCount> kStates{
      kDisarmed, kArming,   kHolding,  kMovingToStart, kMovingToStart, kRunning, kRunning,
      kSettling, kSettling, kStopping, kHolding,       kFault,         kFault};
  return kStates[static_cast<std::size_t>(phase)];
}

[[nodiscard]] constexpr bool IsFault(Phase phase) noexcept {
  return phase >= Phase::kLoweringInFault;
}
[[nodiscard]] constexpr bool IsLowering(Phase phase) noexcept {
  return phase >= Phase::kLowering && phase <= Phase::kLoweringInFault;
}
[[nodiscard]] constexpr bool IsRunning(Phase phase) noexcept {
  return phase == Phase::kRunning || phase == Phase::kRunningHome;
}
[[nodiscard]] constexpr bool IsGoingHome(Phase phase) noexcept {
  return phase == Phase::kRunningHome || phase == Phase::kSettlingHome;
}
/// Whether the setpoints are on a way, of which a pose in the middle is not one to stay in.
[[nodiscard]] constexpr bool IsOnTheWay(Phase phase) noexcept {
  return phase >= Phase::kMovingToStart && phase <= Phase::kRunningHome;
}
/// Whether a run goes on, from its beginning to its hold.
[[nodiscard]] constexpr bool IsInSequence(Phase phase) noexcept {
  return phase >= Phase::kGettingUp && phase <= Phase::kSettlingHome;
}

}  // namespace tumbler
