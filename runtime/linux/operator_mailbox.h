#pragma once

#include <atomic>

#include "runtime/executor.h"

namespace tumbler {

/// The way of an operator's wish into the control loop: one word, written by any thread or signal
/// handler, taken once. A later wish replaces an earlier one that was not taken yet, unless the
/// earlier one is stronger: nothing replaces kDisarm, and only kDisarm replaces kStop.
class OperatorMailbox {
 public:
  void Put(OperatorCommand command) noexcept {
    OperatorCommand present = slot_.load(std::memory_order_relaxed);
    do {
      if (Rank(command) < Rank(present)) return;
    } while (!slot_.compare_exchange_weak(present, command, std::memory_order_release,
                                          std::memory_order_relaxed));
  }

  [[nodiscard]] OperatorCommand Take() noexcept {
    return slot_.exchange(OperatorCommand::kNone, std::memory_order_acquire);
  }

 private:
  static constexpr int Rank(OperatorCommand command) noexcept {
    if (command == OperatorCommand::kDisarm) return 3;
    if (command == OperatorCommand::kStop) return 2;
    return command == OperatorCommand::kNone ? 0 : 1;
  }
  static_assert(std::atomic<OperatorCommand>::is_always_lock_free);  // Also what makes it safe in a
                                                                     // signal handler.

  std::atomic<OperatorCommand> slot_{OperatorCommand::kNone};
};

}  // namespace tumbler
