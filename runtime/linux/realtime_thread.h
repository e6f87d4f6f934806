#pragma once

#include <string>

namespace tumbler {

/// What the calling thread has for keeping its deadlines.
struct RealtimeReport {
  bool fifo = false;           ///< SCHED_FIFO is in force.
  bool memory_locked = false;  ///< mlockall is: no page fault in the loop.
  std::string problems;        ///< Why not, and what to do; empty when both are in force.

  [[nodiscard]] bool in_force() const { return fifo && memory_locked; }
};

/// Puts the calling thread under SCHED_FIFO, locks the process's memory and touches the stack that
/// the loop will use. Call it after other threads are started, since they would inherit the policy.
/// @param priority  1 ... 99; above the 50 of threaded interrupts, below the kernel's own at 99.
RealtimeReport EnterRealtime(int priority = 80);

}  // namespace tumbler
