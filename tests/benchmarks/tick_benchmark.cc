// Time of the executor's parts: evaluation of a quintic spline, and a holding and a running tick
// for 1 to 8 joints.

#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "firmware_interface/devices/mit.h"
#include "runtime/executor/executor.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

void EvaluateSpline(benchmark::State& state) {
  std::mt19937 random(1);
  const auto primitive = testing::RandomPrimitive<float>({}, random);
  const auto& spline = primitive.joints[0].position;
  float t = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(spline.Evaluate(t));
    t = t < 1.2F ? t + 0.001F : 0.0F;
  }
}
BENCHMARK(EvaluateSpline);

/// An executor with MIT drives. It is given their last replies again and again.
class Bench {
 public:
  explicit Bench(int joints) {
    std::mt19937 random(2);
    testing::MotionShape shape;
    shape.joint_count = joints;
    shape.duration_s = 1000;  // Long enough for any benchmark at one tick a turn...
    shape.control_points = 24;
    Primitive<float> primitive = testing::RandomPrimitive<float>(shape, random);
    primitive.following_tolerance_rad = 100;  // ...with joints that stay where they are.
    std::vector<Drive*> pointers;
    for (int i = 0; i < joints; ++i) {
      MitConfig config;
      config.command_id = static_cast<std::uint16_t>(i + 1);
      config.reply_id = static_cast<std::uint16_t>(i + 101);
      drives_.push_back(std::make_unique<MitDrive>(config));
      pointers.push_back(drives_.back().get());
      MitReply reply;
      reply.sender = static_cast<std::uint8_t>(i + 1);
      reply.position_rad =
          primitive.joints[static_cast<std::size_t>(i)].position.control_points()[0];
      replies_.push_back({EncodeMitReply(config, reply), 0});
    }
    if (executor_.Configure({}, primitive, pointers) != Status::kOk) std::abort();
  }

  void Tick(OperatorCommand command = OperatorCommand::kNone) {
    executor_.Tick({tick_++, 0, replies_, Status::kOk, Status::kOk, command}, output_);
    benchmark::DoNotOptimize(output_);
  }
  void Reach(ExecutorState state) {
    for (const OperatorCommand command : {OperatorCommand::kNone, OperatorCommand::kArm,
                                          OperatorCommand::kMoveToStart, OperatorCommand::kRun}) {
      Tick(command);
      for (int i = 0;
           i < 1000000 && command != OperatorCommand::kNone && command != OperatorCommand::kRun &&
           executor_.state() != ExecutorState::kHolding;
           ++i) {
        Tick();
      }
      if (executor_.state() == state) return;
    }
    std::abort();
  }

 private:
  std::vector<std::unique_ptr<MitDrive>> drives_;
  std::vector<ReceivedFrame> replies_;
  Executor executor_;
  TickOutput output_;
  std::int64_t tick_ = 0;
};

void HoldingTick(benchmark::State& state) {
  Bench bench(static_cast<int>(state.range(0)));
  bench.Reach(ExecutorState::kHolding);
  for (auto _ : state) bench.Tick();
}
BENCHMARK(HoldingTick)->Arg(1)->Arg(2)->Arg(8);

void RunningTick(benchmark::State& state) {
  Bench bench(static_cast<int>(state.range(0)));
  bench.Reach(ExecutorState::kRunning);
  for (auto _ : state) bench.Tick();
}
BENCHMARK(RunningTick)->Arg(1)->Arg(2)->Arg(8)->Iterations(500000);

}  // namespace
}  // namespace tumbler

BENCHMARK_MAIN();
