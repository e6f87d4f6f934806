// Uses something of every installed library: a task and its dynamics, a primitive as text, its
// splines, a drive's frame on a simulated bus, the executor's configuration, and the clock of the
// Linux shell.

#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "common/files/primitive_rounding.h"
#include "common/files/primitive_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "firmware_interface/devices/make_simulated.h"
#include "firmware_interface/devices/protocols.h"
#include "offline/certify/certificate.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/rollout.h"
#include "offline/twin/twin.h"
#include "runtime/assembly/clock.h"
#include "runtime/executor/executor.h"

namespace {

using namespace tumbler;

static_assert(kMaxJoints == CONSUMER_MAX_JOINTS, "the package and its headers disagree");

/// Whether the library, too, has room for as many joints as its headers say.
bool LibraryHasRoomForAsManyJoints() {
  DriveBank bank;
  for (int i = 0; i < kMaxJoints; ++i) {
    if (bank.Add(MitProtocol::Example(i)) != Status::kOk) return false;
  }
  return bank.Add(MitProtocol::Example(kMaxJoints)) == Status::kCapacityExceeded;
}

/// The straight path from start to end of every joint. It is not a good motion, but a valid one.
Solution StraightLine(const Problem& problem, Rollout& rollout) {
  Solution solution;
  for (const ActuatedJoint& joint : problem.joints) {
    const int free_points = joint.free_points();
    for (int i = 0; i < free_points; ++i) {
      const double s = (i + 1.0) / (free_points + 1.0);
      solution.x.push_back(joint.start_rad + s * (joint.end_rad - joint.start_rad));
    }
  }
  solution.rollout = rollout.Run(solution.x);
  return solution;
}

bool Use(const char* task_file, const char* drives_file) {
  const Task task = LoadTask(task_file);
  Rollout rollout(task.problem, task.problem.solver.step_s);
  const Solution solution = StraightLine(task.problem, rollout);
  const PrimitiveFile file =
      ParsePrimitive(ToToml(MakePrimitiveFile(task, SolveOutcome{}, solution)), "straight line");
  const Primitive<float> primitive = ToRuntime(file.primitive);
  const auto sample = primitive.joints[0].position.Evaluate(0.5F * primitive.duration_s);

  const DrivesConfig drives = LoadDrives(drives_file);
  SimulatedBus bus(drives.bit_rate);
  SimulatedPort& host = bus.Attach();
  DriveBank hosts;
  std::vector<std::unique_ptr<SimulatedDrive>> motors;
  for (const DriveEntry& entry : drives.drives) {
    if (hosts.Add(entry.config) != Status::kOk) return false;
    motors.push_back(MakeSimulatedDrive(entry));
    motors.back()->AttachTo(bus);
  }
  Twin twin(task.problem.scene, file.entry, TwinConfig{}, bus, {motors[0].get(), motors[1].get()});
  Executor executor;
  if (executor.Configure(ExecutorConfig{}, primitive, hosts.drives()) != Status::kOk) return false;

  VirtualClock clock([&twin](std::int64_t time_ns) { twin.AdvanceTo(time_ns); });
  TickOutput output;
  ReceivedFrame received;
  for (std::int64_t tick = 0; tick < 3; ++tick) {
    clock.SleepUntil(tick * 1'000'000);
    std::vector<ReceivedFrame> frames;
    while (host.Receive(received) == Status::kOk) frames.push_back(received);
    TickInput input;
    input.tick = tick;
    input.received = frames;
    executor.Tick(input, output);
    for (const FrameBatch& batch : output.frames) {
      for (const CanFrame& frame : batch.frames()) {
        if (host.Send(frame) != Status::kOk) return false;
      }
    }
  }
  const double seen = static_cast<double>(output.record.joints[0].measured.position_rad);
  const double truth = twin.state().joint_positions_rad[0];
  std::printf(
      "consumer: %s costs %.4g on the straight line; leg 1 passes %.4f rad half way; "
      "over the bus it is at %.4f rad, in truth at %.4f rad\n",
      task.problem.name.c_str(), solution.rollout.cost, static_cast<double>(sample.value), seen,
      truth);
  return std::isfinite(solution.rollout.cost) && std::abs(seen - truth) < 1e-3;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: consumer TASK DRIVES\n");
    return 2;
  }
  try {
    if (!LibraryHasRoomForAsManyJoints()) {
      std::fprintf(stderr, "the library has not the room that its headers say\n");
      return 1;
    }
    return Use(argv[1], argv[2]) ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
