#pragma once

#include <atomic>
#include <cstdint>

#include "runtime/executor.h"

namespace tumbler {

/// What an operator wants.
struct OperatorWish {
  OperatorCommand command = OperatorCommand::kNone;
  std::int8_t branch = -1;  ///< The number that belongs to kBranch.
};

/// The way of an operator's wish into the control loop: one word, written by any thread or signal
/// handler, taken once. A later wish replaces an earlier one that was not taken yet, unless the
/// earlier one is stronger: nothing replaces kDisarm, only kDisarm replaces kStop, and only these
/// two replace kFinish.
class OperatorMailbox {
 public:
  void Put(OperatorWish wish) noexcept {
    OperatorWish present = slot_.load(std::memory_order_relaxed);
    do {
      if (Rank(wish.command) < Rank(present.command)) return;
    } while (!slot_.compare_exchange_weak(present, wish, std::memory_order_release,
                                          std::memory_order_relaxed));
  }
  void Put(OperatorCommand command) noexcept { Put(OperatorWish{command, -1}); }

  [[nodiscard]] OperatorWish Take() noexcept {
    return slot_.exchange({}, std::memory_order_acquire);
  }

 private:
  static constexpr int Rank(OperatorCommand command) noexcept {
    if (command == OperatorCommand::kDisarm) return 4;
    if (command == OperatorCommand::kStop) return 3;
    if (command == OperatorCommand::kFinish) return 2;
    return command == OperatorCommand::kNone ? 0 : 1;
  }
  static_assert(std::atomic<OperatorWish>::is_always_lock_free);  // Also what makes it safe in a
                                                                  // signal handler.

  std::atomic<OperatorWish> slot_{OperatorWish{}};
};

}  // namespace tumbler
