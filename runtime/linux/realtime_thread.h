#pragma once

#include <cstdint>
#include <string>

namespace tumbler {

/// How the kernel is to choose the loop's thread over others.
enum class Scheduling : std::uint8_t {
  kFifo,      ///< SCHED_FIFO: before everything of lower priority, until it sleeps.
  kDeadline,  ///< SCHED_DEADLINE: a share of the processor in every period, guaranteed and limited.
};

/// What EnterRealtime asks for.
struct RealtimeConfig {
  Scheduling scheduling = Scheduling::kFifo;
  /// Of SCHED_FIFO, 1 ... 99: above the 50 of threaded interrupts, below the kernel's own at 99.
  int priority = 80;
  /// Of SCHED_DEADLINE: the loop's period [ns], at least 2048.
  std::int64_t period_ns = 1'000'000;
  /// Of SCHED_DEADLINE: share of the period that the thread may run, 0 ... 1. A tick takes a few
  /// percent of a millisecond; what exceeds the share is throttled to the next period.
  double share = 0.3;
  /// The only processor to run on; -1: any. The kernel does not pin threads under SCHED_DEADLINE.
  int cpu = -1;
};

/// What the calling thread has for keeping its deadlines.
struct RealtimeGrant {
  bool scheduled = false;  ///< The scheduling asked for is in force, on the processor asked for.
  bool memory_locked = false;  ///< mlockall is: no page fault in the loop.
  std::string scheduling;      ///< In words, e.g. `SCHED_FIFO 80, memory locked, processor 1`.
  std::string problems;        ///< What is not in force, and what to do; empty when all is.

  [[nodiscard]] bool in_force() const { return scheduled && memory_locked; }
};

/// Puts the calling thread under a real-time policy, locks the process's memory and touches the
/// stack that the loop will use. Call it after other threads are started, since they would inherit
/// the policy.
RealtimeGrant EnterRealtime(const RealtimeConfig& config = {});

}  // namespace tumbler
