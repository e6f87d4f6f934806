#pragma once

#include <atomic>
#include <cstdint>

namespace tumbler {

/// The requests of an operator to a run. The last three end it, the later ones more urgently.
enum class OperatorRequest : std::uint8_t {
  kNone,
  kStart,        ///< Begin a run, where somebody attends (`RunProcedureConfig::attended`).
  kBranch,       ///< Take the branch of this number as soon as a node offers it.
  kClearFaults,  ///< While disarmed: forget the latched faults.
  kFinish,       ///< End at the next safe node, hold for a moment, disarm.
  kStop,         ///< Brake at once within the limits, hold for a moment, disarm.
  kDisarm,       ///< Torque off at once.
};

[[nodiscard]] constexpr const char* ToString(OperatorRequest request) noexcept {
  switch (request) {
    case OperatorRequest::kNone:
      return "nothing";
    case OperatorRequest::kStart:
      return "start";
    case OperatorRequest::kBranch:
      return "branch";
    case OperatorRequest::kClearFaults:
      return "clear";
    case OperatorRequest::kFinish:
      return "finish";
    case OperatorRequest::kStop:
      return "stop";
    case OperatorRequest::kDisarm:
      return "disarm";
  }
  return "unknown request";
}

/// Whether a request ends a motion. Such a one is obeyed wherever it can be.
[[nodiscard]] constexpr bool IsTowardsRest(OperatorRequest request) noexcept {
  return request >= OperatorRequest::kFinish;
}

/// A request with everything that belongs to it, small enough for one atomic word and aligned like
/// one: clang calls a library for an atomic value that might lie across two words.
struct alignas(8) OperatorWish {
  std::uint32_t id = 0;  ///< The answer carries it too; 0 where nobody waits for an answer.
  OperatorRequest request = OperatorRequest::kNone;
  std::int8_t branch = -1;   ///< The branch's number for kBranch.
  bool quit = false;         ///< Whether the program is to end after the run.
  std::uint8_t padding = 0;  ///< Makes two equal wishes have equal bits.

  bool operator==(const OperatorWish&) const = default;
};

/// Carries an operator's wish into the control loop. Any thread or signal handler may put a wish
/// there, and the loop takes it once. A later wish replaces an earlier one that was not taken yet,
/// unless the earlier one is finish, stop or disarm and more urgent. The wish that the program is
/// to end is never forgotten.
class OperatorMailbox {
 public:
  void Put(OperatorWish wish) noexcept {
    OperatorWish present = slot_.load(std::memory_order_relaxed);
    OperatorWish merged;
    do {
      merged = wish.request < Weakest(present.request) ? present : wish;
      merged.quit = wish.quit || present.quit;
    } while (!slot_.compare_exchange_weak(present, merged, std::memory_order_release,
                                          std::memory_order_relaxed));
  }

  [[nodiscard]] OperatorWish Take() noexcept {
    return slot_.exchange({}, std::memory_order_acquire);
  }

 private:
  /// The weakest request that may replace this one.
  static constexpr OperatorRequest Weakest(OperatorRequest present) noexcept {
    return present < OperatorRequest::kFinish ? OperatorRequest::kNone : present;
  }
  // Signal handlers may only use atomics that are free of locks.
  static_assert(std::atomic<OperatorWish>::is_always_lock_free);

  std::atomic<OperatorWish> slot_{OperatorWish{}};
};

}  // namespace tumbler
