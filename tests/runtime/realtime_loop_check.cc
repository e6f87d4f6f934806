// Runs the whole control loop but its sleep under RealtimeSanitizer, which aborts when anything in
// it allocates, locks or makes a blocking system call. Only the code that has to be instrumented is
// compiled for it; bus, drives and the ring of the telemetry are those of the ordinary libraries.

#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include "tests/support/loop_bench.h"

namespace tumbler {
namespace {

int Main() {
  TelemetryConfig config;
  config.log_file =
      (std::filesystem::temp_directory_path() / ("tumbler_loop_check_" + std::to_string(getpid())))
          .string();
  RunProcedureConfig run;
  run.attended = true;
  run.hold_ticks = 100;
  run.fault_ticks = 100;
  testing::LoopBench bench(config, run);
  std::uint32_t requests = 0;
  std::array<long, kExecutorStateCount> visits{};
  constexpr long kTicks = 30000;
  for (long i = 0; i < kTicks; ++i) {
    const TickRecord& record = bench.loop->record();
    if (record.state == ExecutorState::kDisarmed && i % 10 == 0) {
      bench.mailbox.Put({++requests, record.first_fault.fault != Fault::kNone
                                         ? OperatorRequest::kClearFaults
                                         : OperatorRequest::kStart});
    }
    if (i % 7000 == 4000) bench.mailbox.Put({++requests, OperatorRequest::kStop});
    bench.simulated[0]->set_silent(i % 9000 > 5000 && i % 9000 < 5020);
    if (!bench.loop->Step()) return 1;
    bench.telemetry.Drain();
    ++visits[static_cast<std::size_t>(record.state)];
  }
  bench.telemetry.Stop();
  std::filesystem::remove(config.log_file);
  for (std::size_t i = 0; i < visits.size(); ++i) {
    if (visits[i] == 0) {
      std::fprintf(stderr, "never in state %s\n", ToString(static_cast<ExecutorState>(i)));
      return 1;
    }
  }
  std::printf("%ld ticks of the whole loop, %d runs, %ld records\n", kTicks,
              bench.procedure->runs(), static_cast<long>(bench.telemetry.written()));
  return 0;
}

}  // namespace
}  // namespace tumbler

int main() { return tumbler::Main(); }
