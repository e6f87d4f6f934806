// Runs the executor through every state under RealtimeSanitizer, which aborts when anything below a
// nonblocking function allocates, locks or makes a blocking system call. With an argument it
// allocates in one on purpose.

#include <array>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "common/core/realtime.h"
#include "firmware_interface/devices/mit.h"
#include "runtime/executor/executor.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/executor/safety.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

void* Allocate(std::size_t size) noexcept TUMBLER_NONBLOCKING { return std::malloc(size); }

class Check {
 public:
  explicit Check(const Primitive<float>& primitive) : primitive_(primitive) {
    configs_[1].command_id = 2;
    configs_[1].reply_id = 18;
    for (std::size_t i = 0; i < 2; ++i) {
      position_[i] = primitive.joints[i].position.control_points()[0] + 0.04F;
    }
  }

  /// Makes one run. `stop_at` and `fault_at` are ticks of it; negative: never. @returns whether it
  /// ended as it should.
  bool Run(long stop_at, long fault_at, RunOutcome expected) {
    MitDrive first(configs_[0]);
    MitDrive second(configs_[1]);
    const std::array<Drive*, 2> drives{&first, &second};
    Executor executor;
    if (executor.Configure({}, primitive_, drives) != Status::kOk) return false;
    RunProcedureConfig config;
    config.hold_ticks = 1000;
    RunProcedure procedure(config);
    TickOutput output;
    std::array<ReceivedFrame, 2> replies;
    for (long n = 0; !procedure.done(); ++n) {
      if (n == stop_at) procedure.RequestStop();
      for (std::size_t i = 0; i < 2; ++i) {
        MitReply reply;
        reply.sender = static_cast<std::uint8_t>(i + 1);
        reply.position_rad = position_[i];
        reply.error = fault_at >= 0 && n >= fault_at ? 2 : 0;
        replies[i].frame = EncodeMitReply(configs_[i], reply);
      }
      executor.Tick({n, 0, replies, Status::kOk, Status::kOk, procedure.Next(output.record)},
                    output);
      ++ticks_;
      ++visits_[static_cast<std::size_t>(output.record.state)];
      for (std::size_t i = 0; i < 2; ++i) {
        ImpedanceCommand command;
        const auto frames = output.frames[i].frames();
        if (!frames.empty() && DecodeMitCommand(configs_[i], frames[0], command) == Status::kOk &&
            command.kp_nm_per_rad > 0) {
          position_[i] = command.position_rad;
        }
      }
    }
    return procedure.outcome() == expected;
  }

  [[nodiscard]] bool WasEverywhere() const {
    for (std::size_t i = 0; i < visits_.size(); ++i) {
      if (visits_[i] == 0) {
        std::fprintf(stderr, "never in state %s\n", ToString(static_cast<ExecutorState>(i)));
        return false;
      }
    }
    return true;
  }
  [[nodiscard]] long ticks() const { return ticks_; }

 private:
  Primitive<float> primitive_;
  std::array<MitConfig, 2> configs_;
  std::array<float, 2> position_{};
  std::array<long, kExecutorStateCount> visits_{};
  long ticks_ = 0;
};

int Main(bool allocate) {
  if (allocate) {
    void* block = Allocate(64);
    std::printf("not caught: %p\n", block);
    std::free(block);
    return 0;
  }
  std::mt19937 random(80);
  Check check(testing::RandomPrimitive<float>({}, random));
  for (int i = 0; i < 4; ++i) {
    if (!check.Run(-1, -1, RunOutcome::kCompleted) ||
        !check.Run(1500 + 50 * i, -1, RunOutcome::kStopped) ||
        !check.Run(-1, 1500 + 50 * i, RunOutcome::kFault)) {
      std::fprintf(stderr, "a run did not end as it should\n");
      return 1;
    }
  }
  if (!check.WasEverywhere()) return 1;
  std::printf("%ld ticks\n", check.ticks());
  return check.ticks() >= 10000 ? 0 : 1;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char** /*argv*/) { return tumbler::Main(argc > 1); }
