// Runs a two-joint primitive of the shape that the optimiser writes (paths of degree 5 with 12
// points, feed-forward of degree 3 with 48; with an argument, the second joint's splines on other
// knots) through its ticks with MIT drives that follow perfectly; the program that
// scripts/count-instructions runs under callgrind. Prints the number of running ticks.

#include <array>
#include <cstdio>
#include <random>

#include "firmware_interface/drives/mit.h"
#include "runtime/executor.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

/// The tick of a running executor, and nothing else: what is counted.
[[gnu::noinline]] void CountedTick(Executor& executor, const TickInput& input, TickOutput& output) {
  executor.Tick(input, output);
}

int Main(bool distinct_knots) {
  std::mt19937 random(1);
  testing::MotionShape shape;
  shape.torque_points = 48;
  Primitive<float> primitive = testing::RandomPrimitive<float>(shape, random);
  if (distinct_knots) {  // The second joint's splines on knots of their own.
    testing::MotionShape other = shape;
    other.control_points = 14;
    other.torque_points = 40;
    primitive.joints[1] = testing::RandomPrimitive<float>(other, random).joints[1];
  }
  std::array<MitConfig, 2> configs;
  configs[1].command_id = 2;
  configs[1].reply_id = 18;
  MitDrive first(configs[0]);
  MitDrive second(configs[1]);
  const std::array<Drive*, 2> drives{&first, &second};
  Executor executor;
  if (executor.Configure(ExecutorConfig{}, primitive, drives) != Status::kOk) return 1;

  std::array<ReceivedFrame, 2> replies;
  TickInput input;
  TickOutput output;
  long running = 0;
  bool moved = false;
  for (int i = 0; i < 2; ++i) {
    MitReply reply;
    reply.sender = static_cast<std::uint8_t>(i + 1);
    reply.position_rad = primitive.joints[static_cast<std::size_t>(i)].position.control_points()[0];
    replies[static_cast<std::size_t>(i)].frame =
        EncodeMitReply(configs[static_cast<std::size_t>(i)], reply);
  }
  for (int n = 0; n < 20000; ++n) {
    input.tick = n;
    input.received = replies;
    input.command = OperatorCommand::kNone;
    if (n == 5) input.command = OperatorCommand::kArm;
    const ExecutorState state = executor.state();
    if (state == ExecutorState::kHolding && running > 0) break;
    if (state == ExecutorState::kHolding) {
      input.command = moved ? OperatorCommand::kRun : OperatorCommand::kMoveToStart;
      moved = true;
    }
    if (state == ExecutorState::kRunning) {
      ++running;
      CountedTick(executor, input, output);
    } else {
      executor.Tick(input, output);
    }
    for (std::size_t i = 0; i < 2; ++i) {
      MitReply reply;
      reply.sender = static_cast<std::uint8_t>(i + 1);
      reply.position_rad = output.record.joints[i].limited.position_rad;
      reply.velocity_rad_s = output.record.joints[i].limited.velocity_rad_s;
      reply.temperature_c = 30;
      replies[i].frame = EncodeMitReply(configs[i], reply);
    }
  }
  if (output.record.faults != 0 || running == 0) {
    std::fprintf(stderr, "the motion did not finish: fault '%s'\n",
                 ToString(output.record.first_fault.fault));
    return 1;
  }
  std::printf("%ld\n", running);
  return 0;
}

}  // namespace
}  // namespace tumbler

int main(int argc, char**) { return tumbler::Main(argc > 1); }
