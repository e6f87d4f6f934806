#pragma once

#include <cstdint>
#include <string>

namespace tumbler {

/// The policy by which the kernel prefers the loop's thread to others.
enum class Scheduling : std::uint8_t {
  kFifo,      ///< SCHED_FIFO: goes before everything of lower priority, until it sleeps.
  kDeadline,  ///< SCHED_DEADLINE: has a guaranteed, limited share of the processor in every period.
};

/// The request to EnterRealtime.
struct RealtimeConfig {
  Scheduling scheduling = Scheduling::kFifo;
  /// Priority under SCHED_FIFO, 1 ... 99. Threaded interrupts have 50, the kernel's own threads 99.
  int priority = 80;
  /// The loop's period under SCHED_DEADLINE [ns], at least 2048.
  std::int64_t period_ns = 1'000'000;
  /// The share of the period that the thread may run under SCHED_DEADLINE, 0 ... 1. A tick takes a
  /// few percent of a millisecond. When the thread exceeds its share, it has to wait for the next
  /// period.
  double share = 0.3;
  /// The only processor to run on; -1: any. The kernel does not pin threads under SCHED_DEADLINE.
  int cpu = -1;
};

/// The settings that the kernel has granted to the calling thread.
struct RealtimeGrant {
  bool scheduled = false;      ///< Whether scheduling and processor are as asked for.
  bool memory_locked = false;  ///< Whether mlockall is in force: no page fault in the loop.
  std::string scheduling;      ///< In words, e.g. `SCHED_FIFO 80, memory locked, processor 1`.
  std::string problems;        ///< What is not in force, and what to do; empty when all is.

  [[nodiscard]] bool in_force() const { return scheduled && memory_locked; }
};

/// Puts the calling thread under a real-time policy, locks the process's memory and touches the
/// stack that the loop will use. Call it after other threads are started, since they would inherit
/// the policy.
RealtimeGrant EnterRealtime(const RealtimeConfig& config = {});

/// What EnterRealtime would be granted, found out on a thread of its own. The memory stays locked.
RealtimeGrant TryRealtime(const RealtimeConfig& config = {});

/// While it lives, keeps the processors out of sleep states that take long to leave: it holds
/// /dev/cpu_dma_latency at 0 us (kernel Documentation/power/pm_qos_interface.rst). Without the
/// permission to open that it does nothing.
class CpuAwake {
 public:
  explicit CpuAwake(const char* device = "/dev/cpu_dma_latency");
  ~CpuAwake();
  CpuAwake(const CpuAwake&) = delete;
  CpuAwake& operator=(const CpuAwake&) = delete;

  [[nodiscard]] bool held() const noexcept { return descriptor_ >= 0; }

 private:
  int descriptor_ = -1;
};

}  // namespace tumbler
