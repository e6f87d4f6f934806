#pragma once

#include <atomic>
#include <cstdint>

namespace tumbler {

/// What an operator may ask of a run. The last three, which end it, grow stronger in this order.
enum class OperatorRequest : std::uint8_t {
  kNone,
  kStart,        ///< Of an attended run (`RunProcedureConfig::attended`): begin.
  kBranch,       ///< Take the branch of this number where there is one.
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

/// A request with all that belongs to it; small enough for one atomic word.
struct OperatorWish {
  std::uint32_t id = 0;  ///< By which the answer is found; 0 where nobody looks for one.
  OperatorRequest request = OperatorRequest::kNone;
  std::int8_t branch = -1;   ///< The number that belongs to kBranch.
  bool quit = false;         ///< An attended run is not to wait for another start afterwards.
  std::uint8_t padding = 0;  ///< So that two equal wishes have equal bits.

  bool operator==(const OperatorWish&) const = default;
};

/// The way of an operator's wish into the control loop: one word, written by any thread or signal
/// handler, taken once. A later wish replaces an earlier one that was not taken yet, unless
/// that one is a stronger one of finish, stop and disarm; that the program is to end is never
/// forgotten.
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
  static_assert(std::atomic<OperatorWish>::is_always_lock_free);  // Also what makes it safe in a
                                                                  // signal handler.

  std::atomic<OperatorWish> slot_{OperatorWish{}};
};

}  // namespace tumbler
