#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "firmware_interface/devices/mit.h"
#include "runtime/executor/run_procedure.h"
#include "runtime/record/flight_record.h"
#include "runtime/record/flight_recorder.h"
#include "runtime/record/record_configuration.h"
#include "runtime/record/recorded_assembly.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"

namespace tumbler::testing {

/// The configuration of a run on two MIT drives, in which no number has its default.
inline RecordConfiguration SmallConfiguration() {
  MotionShape shape;
  shape.duration_s = 0.05;
  shape.amplitude_rad = 0.05;
  shape.settle_s = 0.01;
  RecordConfiguration configuration;
  configuration.program = "test 1.0";
  configuration.command_line = {"test", "--record", "x"};
  configuration.kernel = DescribeKernel();
  configuration.bus = "sim";
  configuration.virtual_time = true;
  configuration.period_ns = 1'000'000;
  configuration.joints = {"joint1", "joint2"};
  configuration.motion_file = "motions/motion.toml";
  configuration.files = {
      {"motions/motion.toml", ToToml(RandomPrimitiveFile(shape, 70))},
  };
  configuration.executor.speed = 0.9F;
  configuration.executor.move_fraction = 0.21F;
  configuration.executor.torque_rise_s = 0.011F;
  configuration.executor.stale_ticks_max = 6;
  configuration.executor.late_ticks_max = 3;
  configuration.executor.arming_ticks_max = 501;
  configuration.executor.cycles = 1;
  for (JointConfig& joint : configuration.executor.joints) {
    joint = {150.1F, 3.3F, 2.2F, 71.7F};
  }
  configuration.executor.reactions.Set(Fault::kStaleReply, ExecutorState::kHolding,
                                       Reaction::kDamp);
  configuration.procedure = {11, 501, 1001, 12, 13, 5, false};
  configuration.machine = {"6.1 (test)", "none", "virtual"};
  return configuration;
}

/// Runs the configured motion against drives that go where they are sent, and records it.
/// @param tick_done  called after every tick with its number.
inline void RecordRun(const RecordConfiguration& configuration, TickFeed& feed,
                      const std::function<void(std::int64_t)>& tick_done = {},
                      std::int64_t ticks_max = 100'000) {
  Assembly assembly = Assemble(configuration);
  RunProcedure procedure(configuration.procedure);
  std::array<MitReply, 2> drives;
  for (std::size_t i = 0; i < 2; ++i) {
    const JointMotion<float>& motion = assembly.parts().sequence->primitives[0].joints[i];
    drives[i].sender = static_cast<std::uint8_t>(i + 1);
    drives[i].position_rad = motion.position.control_points()[0] + 0.02F;
    drives[i].temperature_c = 30;
  }
  std::vector<ReceivedFrame> received;
  TickOutput output;
  for (std::int64_t tick = 0; tick < ticks_max && !procedure.done(); ++tick) {
    const std::int64_t now_ns = tick * configuration.period_ns;
    TickInput input;
    input.tick = tick;
    input.received = received;
    input.receive_status = Status::kWouldBlock;
    input.command = procedure.Next(output.record);
    assembly.executor().Tick(input, output);
    TickNotes notes;
    notes.deadline_ns = notes.due_ns = now_ns;
    notes.awake_ns = now_ns + 10;
    notes.send_ns = now_ns + 20;
    notes.done_ns = now_ns + 30;
    notes.sent_count = 2;
    feed.Push(notes, input, output);
    received.clear();
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& mit = std::get<MitConfig>(assembly.parts().drives.drives[i].config);
      for (const CanFrame& frame : output.frames[i].frames()) {
        ImpedanceCommand command;
        if (DecodeMitCommand(mit, frame, command) == Status::kOk && command.kp_nm_per_rad > 0) {
          drives[i].position_rad = command.position_rad;
        }
        received.push_back({EncodeMitReply(mit, drives[i]),
                            now_ns + 300'000 + 100'000 * static_cast<std::int64_t>(i)});
      }
    }
    if (tick_done) tick_done(tick);
  }
}

/// The bytes of the complete record of such a run.
inline std::string RecordedBytes(const RecordConfiguration& configuration,
                                 std::int64_t ticks_max = 100'000) {
  const TemporaryFolder folder;
  FlightRecorderConfig config;
  config.file = folder / "run.rec";
  config.configuration = EncodeConfiguration(configuration);
  FlightRecorder recorder(config);
  TickFeed feed({&recorder});
  RecordRun(
      configuration, feed, [&recorder](std::int64_t) { recorder.Drain(); }, ticks_max);
  recorder.Stop("completed");
  return ReadFile(config.file);
}

}  // namespace tumbler::testing
