// Runs the whole loop in real time, as on a robot: with the real clock, and telemetry in its own
// thread.

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "runtime/assembly/realtime_thread.h"
#include "tests/support/allocation_guard.h"
#include "tests/support/loop_bench.h"

namespace tumbler {
namespace {

using testing::AllocationGuard;
using testing::LoopBench;

long PageFaults() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt + usage.ru_majflt;
}

/// A clock that guards everything in the loop but its sleep, in which the simulated world runs.
class GuardingClock final : public Clock {
 public:
  explicit GuardingClock(Clock& clock) : clock_(clock) {}
  [[nodiscard]] std::int64_t now_ns() const noexcept override { return clock_.now_ns(); }
  void SleepUntil(std::int64_t time_ns) noexcept override {
    Leave();
    clock_.SleepUntil(time_ns);
    faults_before_ = PageFaults();
    guard_.emplace();
  }
  /// At the end of a tick.
  void Leave() noexcept {
    if (!guard_) return;
    guard_.reset();
    page_faults += PageFaults() - faults_before_;
  }
  long page_faults = 0;

 private:
  Clock& clock_;
  std::optional<AllocationGuard> guard_;
  long faults_before_ = 0;
};

TEST(RealtimeLoop, NeitherAllocatesNorLocksNorFaultsForAMinute) {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): no other thread changes the environment.
  const char* seconds = std::getenv("TUMBLER_LOOP_SECONDS");
  const std::int64_t ticks = 1000 * (seconds != nullptr ? std::strtol(seconds, nullptr, 10) : 60);
  TelemetryConfig config;
  config.log_file =
      (std::filesystem::temp_directory_path() / ("tumbler_loop_" + std::to_string(getpid())))
          .string();
  RunProcedureConfig run;
  run.attended = true;
  run.hold_ticks = 200;
  run.fault_ticks = 100;
  LoopBench bench(config, run);
  bench.telemetry.Start();
  PacedClock paced([&bench](std::int64_t time_ns) { bench.plant->AdvanceTo(time_ns); });
  GuardingClock clock(paced);
  bench.UseClock(clock, paced.now_ns() + 1'000'000);
  const RealtimeGrant realtime = EnterRealtime();

  std::array<std::int64_t, kExecutorStateCount> visits{};
  std::uint32_t requests = 0;
  std::int64_t done = 0;
  long warm_up_faults = 0;
  for (; done < ticks; ++done) {
    // One run follows another. When the machine stood still for too long, a run ends in a fault.
    const TickRecord& record = bench.loop->record();
    if (record.state == ExecutorState::kDisarmed && done % 10 == 0) {
      const bool clear = record.first_fault.fault != Fault::kNone;
      bench.mailbox.Put(
          {++requests, clear ? OperatorRequest::kClearFaults : OperatorRequest::kStart});
    }
    if (done % 20000 == 15000) bench.mailbox.Put({++requests, OperatorRequest::kStop});
    ASSERT_TRUE(bench.loop->Step());
    clock.Leave();
    ++visits[static_cast<std::size_t>(bench.loop->record().state)];
    if (done == 100) warm_up_faults = clock.page_faults;
  }
  bench.telemetry.Stop();
  std::filesystem::remove(config.log_file);
  const LoopStatistics& s = bench.loop->statistics();
  std::printf(
      "%ld ticks, %ld missed, %ld late; wake-up max %.0f us, tick p99.99 %.0f us; %d runs\n",
      static_cast<long>(s.ticks), static_cast<long>(s.missed_ticks),
      static_cast<long>(s.late_ticks), static_cast<double>(s.wake_up.max_ns()) * 1e-3,
      static_cast<double>(s.tick.PercentileNs(0.9999)) * 1e-3, bench.procedure->runs());
  EXPECT_EQ(s.ticks, ticks);
  EXPECT_GT(visits[static_cast<std::size_t>(ExecutorState::kRunning)], 0);
  if (realtime.memory_locked) {
    EXPECT_EQ(clock.page_faults - warm_up_faults, 0);
  }
}

}  // namespace
}  // namespace tumbler
