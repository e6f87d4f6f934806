// When replies of a simulated robot were sampled, against where its joints were.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "offline/twin/simulated_robot.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/record/timed_record.h"
#include "runtime/run/control_loop.h"
#include "tests/runtime/sim_twin.h"

namespace tumbler {
namespace {

/// What is heard on the bus of a simulated robot, and where its joints were at any time.
class Witness {
 public:
  explicit Witness(SimulatedRobot& robot) : robot_(robot) {
    SimulatedPortConfig port;
    port.listen_only = true;
    port.receive_capacity = 1024;
    listener_ = &robot.bus().Attach(port);
  }
  /// Moves the robot on, and looks every 10 us.
  void AdvanceTo(std::int64_t time_ns) {
    while (robot_.now_ns() < time_ns) {
      robot_.AdvanceTo(std::min(time_ns, robot_.now_ns() + kLook_ns));
      positions_.push_back({robot_.now_ns(), robot_.state().joint_positions_rad});
      ReceivedFrame heard;
      while (listener_->Receive(heard) == Status::kOk) {
        if (heard.frame.id < asked_ns_.size()) asked_ns_[heard.frame.id] = heard.time_ns;
      }
    }
  }
  /// The end of the last frame with this identifier.
  [[nodiscard]] std::int64_t asked_ns(std::size_t id) const { return asked_ns_[id]; }
  /// Where a joint was.
  [[nodiscard]] double PositionAt(std::int64_t time_ns, std::size_t joint) const {
    const auto after = std::ranges::lower_bound(positions_, time_ns, {}, &Look::time_ns);
    const auto before = after - 1;
    const double share = static_cast<double>(time_ns - before->time_ns) /
                         static_cast<double>(after->time_ns - before->time_ns);
    return (1 - share) * before->joints_rad[joint] + share * after->joints_rad[joint];
  }

 private:
  static constexpr std::int64_t kLook_ns = 10'000;
  struct Look {
    std::int64_t time_ns = 0;
    std::vector<double> joints_rad;
  };
  SimulatedRobot& robot_;
  SimulatedPort* listener_ = nullptr;
  std::vector<Look> positions_;
  std::array<std::int64_t, 16> asked_ns_{};
};

/// What is exported of the last tick.
class LastTimedRecord final : public TickSink {
 public:
  explicit LastTimedRecord(const SampleTimes& replies) : records_(replies) {}
  void Push(std::span<const std::uint8_t> message) noexcept override {
    ASSERT_TRUE(DecodeTick(ContentOf(message), entry_));
    timed = records_.Next(entry_);
  }
  void Drain() override {}
  void Start() override {}
  TimedRecord timed;

 private:
  TimedRecords records_;
  TickEntry entry_;
};

TEST_F(SimTwin, TellsToTheBitOfTheBusWhenRepliesWereSampled) {
  RunParts parts = LoadRunMotion(kPrimitives + "handstand.toml");
  parts.drives =
      LoadDrivesOf(JointsOf(parts.file), kPrimitives + "robots/tumbler_drives.toml", ReadTextFile);
  const DrivesConfig drives = parts.drives;
  const SimulatedMotion simulated(parts.file);
  SimulatedRobotConfig config;
  config.motors.resize(2);
  for (JointMotor& motor : config.motors) motor.encoder_counts_per_turn = 0;
  SimulatedRobot robot(simulated, drives, config);
  Assembly assembly(std::move(parts));
  ASSERT_EQ(assembly.Configure(ExecutorConfigOf({}, drives)), Status::kOk);
  SimulatedPort& host = robot.bus().Attach();
  Witness witness(robot);
  VirtualClock clock([&witness](std::int64_t time_ns) { witness.AdvanceTo(time_ns); });
  RunProcedure procedure(ProcedureConfigOf({}, drives, assembly.parts().sequence->graph));
  OperatorMailbox mailbox;
  LastTimedRecord last(SampleTimesOf(drives, 1'000'000));
  TickFeed feed({&last});
  ControlLoop loop({assembly.executor(), host, clock, procedure, mailbox, &feed}, 1'000'000, 0);
  std::int64_t compared = 0;
  double off_most_rad = 0;
  while (loop.Step()) {
    if (loop.record().state != ExecutorState::kRunning) continue;
    for (std::size_t j = 0; j < 2; ++j) {
      const float sampled_us = last.timed.reply_sampled_us[j];
      const auto& mit = std::get<MitConfig>(drives.drives[j].config);
      EXPECT_NEAR(1e3 * double{sampled_us},
                  static_cast<double>(witness.asked_ns(mit.command_id) - loop.time_ns()), 1);
      const auto sampled_ns = loop.time_ns() + std::llround(1e3 * double{sampled_us});
      // The wire rounds a position downwards.
      const double step_rad = 25.0 / 65535;
      const double off_rad = witness.PositionAt(sampled_ns, j) -
                             double{loop.record().joints[j].measured.position_rad} - step_rad / 2;
      off_most_rad = std::max(off_most_rad, std::abs(off_rad));
      ++compared;
    }
  }
  EXPECT_GT(compared, 1000);
  // Half a step of the wire, and what 12 rad/s are in the 10 us from one look to the next. In the
  // time of a frame a joint moves ten times as far.
  EXPECT_LT(off_most_rad, 12.5 / 65535 + 12 * 1e-5);
}

}  // namespace
}  // namespace tumbler
