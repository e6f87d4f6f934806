// The program in which scripts/count-instructions counts ticks. It plays a two-joint primitive of
// the shape that the optimiser writes (paths of degree 5 with 12 points, feed-forward of degree 3
// with 48), with drives that follow perfectly, and prints the number of running ticks.
// usage: tick_driver shared|distinct PROTOCOL
//   distinct  the second joint's splines have knots of their own

#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "firmware_interface/drives/make_simulated.h"
#include "runtime/core/executor.h"
#include "runtime/linux/dry_run_bus.h"
#include "tests/support/files.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

/// The part that is counted: the tick of a running executor, and nothing else.
[[gnu::noinline]] void CountedTick(Executor& executor, const TickInput& input, TickOutput& output) {
  executor.Tick(input, output);
}

int Main(bool distinct_knots, const std::string& drives_file) {
  std::mt19937 random(1);
  testing::MotionShape shape;
  shape.torque_points = 48;
  Primitive<float> primitive = testing::RandomPrimitive<float>(shape, random);
  if (distinct_knots) {  // The second joint's splines get knots of their own.
    testing::MotionShape other = shape;
    other.control_points = 14;
    other.torque_points = 40;
    primitive.joints[1] = testing::RandomPrimitive<float>(other, random).joints[1];
  }
  const DrivesConfig config = LoadDrives(drives_file);
  DriveBank bank;
  std::vector<DryRunBus::Node> nodes;
  for (std::size_t i = 0; i < 2; ++i) {
    if (bank.Add(config.drives[i].config) != Status::kOk) return 1;
    nodes.push_back({MakeSimulatedDrive(config.drives[i]),
                     static_cast<double>(primitive.joints[i].position.control_points()[0])});
  }
  DryRunBus bus("none", config.bit_rate, std::move(nodes), nullptr);
  Executor executor;
  if (executor.Configure(ExecutorConfig{}, primitive, bank.drives()) != Status::kOk) return 1;

  TickInput input;
  TickOutput output;
  long running = 0;
  bool moved = false;
  for (int n = 0; n < 20000; ++n) {
    bus.AdvanceTo(std::int64_t{n} * 1'000'000);
    std::vector<ReceivedFrame> frames;
    ReceivedFrame received;
    while (bus.Receive(received) == Status::kOk) frames.push_back(received);
    input.tick = n;
    input.received = frames;
    input.command = OperatorCommand::kNone;
    const ExecutorState state = executor.state();
    if (state == ExecutorState::kDisarmed) input.command = OperatorCommand::kArm;
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
    for (const FrameBatch& batch : output.frames) {
      for (const CanFrame& frame : batch.frames()) {
        if (bus.Send(frame) != Status::kOk) return 1;
      }
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

int main(int argc, char** argv) {
  const std::string knots = argc > 1 ? argv[1] : "shared";
  const std::string protocol = argc > 2 ? argv[2] : "mit";
  std::string example;
  tumbler::DriveProtocols::ForEach([&](auto listed) {
    if (protocol == decltype(listed)::kId) example = decltype(listed)::kExample;
  });
  return tumbler::Main(knots == "distinct",
                       tumbler::testing::SourcePath("primitives/robots/" + example));
}
