// The program in which scripts/count-instructions counts ticks. It plays a two-joint primitive of
// the shape that the optimiser writes (paths of degree 5 with 12 points, feed-forward of degree 3
// with 48), with drives that follow perfectly, and prints the number of running ticks.
// usage: tick_driver shared|distinct PROTOCOL [sensor]
//   distinct  the second joint's splines have knots of their own
//   sensor    the primitive has feedback, and an inertial sensor reports in every tick

#include <algorithm>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include "firmware_interface/devices/make_simulated.h"
#include "runtime/assembly/dry_run_bus.h"
#include "runtime/executor/executor.h"
#include "runtime/executor/sensor_watch.h"
#include "tests/support/files.h"
#include "tests/support/motions.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

/// The part that is counted: the tick of a running executor, and nothing else.
[[gnu::noinline]] void CountedTick(Executor& executor, const TickInput& input, TickOutput& output) {
  executor.Tick(input, output);
}

/// What the sensor reports of a link that is a little off its plan, differently in every tick.
void AddReports(const Primitive<float>& primitive, const TickRecord& last, int tick,
                const XsensMtiConfig& ids, std::vector<ReceivedFrame>& frames) {
  const auto at = primitive.feedback.angle.Evaluate(last.primitive_time_s + 1e-3F);
  const double joint = static_cast<double>(last.joints[1].measured.position_rad);
  const double speed = static_cast<double>(last.joints[1].measured.velocity_rad_s);
  for (const CanFrame& frame :
       testing::SensorFrames(static_cast<double>(at.value) + 0.01 * (tick % 7) - joint,
                             static_cast<double>(at.first) - speed, ids)) {
    frames.push_back({frame, 0});
  }
}

/// The primitive of two joints, of the shape that the optimiser writes.
Primitive<float> Motion(bool distinct_knots, std::mt19937& random) {
  testing::MotionShape shape;
  shape.torque_points = 48;
  Primitive<float> primitive = testing::RandomPrimitive<float>(shape, random);
  if (distinct_knots) {  // The second joint's splines get knots of their own.
    testing::MotionShape other = shape;
    other.control_points = 14;
    other.torque_points = 40;
    primitive.joints[1] = testing::RandomPrimitive<float>(other, random).joints[1];
  }
  return primitive;
}

/// What an operator asks for in a state: the way to the start, and then the motion.
OperatorCommand Next(ExecutorState state, bool& moved) {
  if (state == ExecutorState::kDisarmed) return OperatorCommand::kArm;
  if (state != ExecutorState::kHolding) return OperatorCommand::kNone;
  const OperatorCommand next = moved ? OperatorCommand::kRun : OperatorCommand::kMoveToStart;
  moved = true;
  return next;
}

int Main(bool distinct_knots, bool with_sensor, const std::string& drives_file) {
  std::mt19937 random(1);
  Primitive<float> primitive = Motion(distinct_knots, random);
  SensorSettings settings;
  // CANSimple drives have the sensor's usual identifiers.
  const XsensMtiConfig ids{0x7a1, 0x7a2, 0x7a3};
  XsensMti mti(ids);
  if (with_sensor) {
    primitive.feedback = testing::RandomFeedback(primitive, 8, random);
    testing::ShareTorqueKnots(primitive, random);
    settings.jump_max_rad = 10;  // The random plan is wilder than a robot.
    settings.rate_max_rad_s = 60;
  }
  SensorWatch watch(mti, settings);
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
  if (executor.Configure(ExecutorConfig{}, primitive, bank.drives(),
                         with_sensor ? &watch : nullptr) != Status::kOk) {
    return 1;
  }

  TickInput input;
  TickOutput output;
  long running = 0;
  float largest_share = 0;
  bool moved = false;
  for (int n = 0; n < 20000; ++n) {
    bus.AdvanceTo(std::int64_t{n} * 1'000'000);
    std::vector<ReceivedFrame> frames;
    ReceivedFrame received;
    while (bus.Receive(received) == Status::kOk) frames.push_back(received);
    if (with_sensor) AddReports(primitive, output.record, n, ids, frames);
    input.tick = n;
    input.received = frames;
    const ExecutorState state = executor.state();
    if (state == ExecutorState::kHolding && running > 0) break;
    input.command = Next(state, moved);
    if (state == ExecutorState::kRunning) {
      ++running;
      CountedTick(executor, input, output);
      largest_share = std::max(largest_share, output.record.sensor.share);
    } else {
      executor.Tick(input, output);
    }
    for (const FrameBatch& batch : output.frames) {
      for (const CanFrame& frame : batch.frames()) {
        if (bus.Send(frame) != Status::kOk) return 1;
      }
    }
  }
  if (with_sensor && largest_share < 1) {
    std::fprintf(stderr, "the sensor is not believed: %s\n", ToString(output.record.sensor.status));
    return 1;
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
  const bool sensor = argc > 3 && std::string(argv[3]) == "sensor";
  return tumbler::Main(knots == "distinct", sensor,
                       tumbler::testing::SourcePath("primitives/robots/" + example));
}
