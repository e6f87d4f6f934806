// A program that does not run for a while, in every state and with every protocol: Ctrl-Z and fg,
// SIGSTOP, a frozen cgroup, a busy machine. Its drives let go meanwhile, and the robot falls. What
// is sent afterwards is judged from the frames and from where the joints truly are.

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <variant>
#include <vector>

#include "runtime/assembly/run_settings.h"
#include "tests/support/fault_bench.h"
#include "tests/support/files.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::DriveOrder;
using testing::EveryProtocol;
using testing::FaultBench;
using ::testing::IsEmpty;
using testing::TestedProtocol;
using Kind = DriveOrder::Kind;

constexpr std::array kStates{ExecutorState::kDisarmed, ExecutorState::kArming,
                             ExecutorState::kHolding,  ExecutorState::kMovingToStart,
                             ExecutorState::kRunning,  ExecutorState::kSettling,
                             ExecutorState::kStopping, ExecutorState::kFault};

/// A joint whose drive has let go falls as fast as this, this far at most.
constexpr double kFall_rad_s = 3, kFall_rad = 1.2;

/// How far a first setpoint may be from the joint: what it moves between its report and the order.
constexpr double kThere_rad = 0.03;

FaultBench::Config ConfigOf(const TestedProtocol& protocol, unsigned seed) {
  FaultBench::Config config;
  config.drives = LoadDrives(testing::SourcePath(protocol.drives));
  for (DriveEntry& entry : config.drives.drives) protocol.side->Hasten(entry.config);
  std::mt19937 random(seed);
  testing::MotionShape shape;
  shape.duration_s = 0.3;
  shape.settle_s = 0.2;
  shape.amplitude_rad = 0.2;
  config.primitives = {testing::RandomPrimitive<float>(shape, random)};
  for (std::size_t i = 0; i < 2; ++i) {
    JointMotion<float>& motion = config.primitives[0].joints[i];
    motion.limits.position_min_rad -= 2;
    motion.limits.position_max_rad += 2;
    motion.limits.acceleration_max_rad_s2 *= 0.3F;  // Braking takes a while.
  }
  config.primitives[0].following_tolerance_rad = 10;  // It is not what notices that the robot fell.
  config.graph = GraphOf(config.primitives[0]);
  RunSettings settings;
  settings.start_within_rad = 10;  // It may have fallen far.
  config.executor = ExecutorConfigOf(settings, config.drives);
  config.offset_rad = 0.05;
  return config;
}

/// A robot whose program pauses.
class PausedRobot {
 public:
  PausedRobot(const TestedProtocol& protocol, unsigned seed) : bench(ConfigOf(protocol, seed)) {
    bench.before_tick = [this] { Look(); };
  }

  /// Lets time pass without a tick, while joints fall whose drives let go.
  void Pause(int periods) {
    std::array<double, 2> from_rad{};
    for (std::size_t i = 0; i < 2; ++i) from_rad[i] = bench.plant->rotors()[i].position_rad;
    const std::int64_t end_ns = bench.now_ns() + (periods - 1) * bench.period_ns();
    for (std::int64_t now_ns = bench.now_ns(); now_ns < end_ns;) {
      now_ns = std::min(now_ns + 5 * bench.period_ns(), end_ns);
      bench.plant->AdvanceTo(now_ns);
      Look();
      for (std::size_t i = 0; i < 2; ++i) {
        RotorPlant::Rotor& rotor = bench.plant->rotors()[i];
        const bool falls = IsLoose(i) && std::abs(rotor.position_rad - from_rad[i]) < kFall_rad;
        if (IsLoose(i)) rotor.velocity_rad_s = falls ? kFall_rad_s : 0;
      }
    }
    for (RotorPlant::Rotor& rotor : bench.plant->rotors()) {
      if (std::abs(rotor.velocity_rad_s) == kFall_rad_s) rotor.velocity_rad_s = 0;
    }
    bench.Miss(periods - 1);
  }

  /// Whether the order that was sent last to a joint would pull it away from where it is, though
  /// its drive has let go since the pause began.
  [[nodiscard]] bool Snaps(std::size_t joint) const {
    const DriveOrder& order = bench.judge.last_order(joint);
    const double off_rad = order.position_rad - JointNow(joint);
    return has_let_go_[joint] && order.kind == Kind::kSetpoint && std::abs(off_rad) > kThere_rad;
  }
  [[nodiscard]] bool has_let_go() const { return has_let_go_[0] || has_let_go_[1]; }
  void Forget() { has_let_go_ = {}; }
  [[nodiscard]] double JointNow(std::size_t joint) const {
    return bench.plant->rotors()[joint].position_rad;
  }

  FaultBench bench;

 private:
  [[nodiscard]] bool IsLoose(std::size_t joint) const {
    const SimulatedDrive& drive = *bench.drives[joint];
    return !drive.enabled() || drive.limp();
  }
  void Look() {
    for (std::size_t i = 0; i < 2; ++i) has_let_go_[i] = has_let_go_[i] || IsLoose(i);
  }

  std::array<bool, 2> has_let_go_{};
};

class Pauses : public ::testing::TestWithParam<TestedProtocol> {};

TEST_P(Pauses, AfterWhichNothingPullsAJointAwayFromWhereItIsOnceItsDriveHasLetGo) {
  std::mt19937 random(71);
  std::uniform_real_distribution<double> exponent(0, 4);  // 1 ms to 10 s
  int let_go = 0, paused = 0;
  constexpr int kRounds = 70;
  for (int round = 0; round < kRounds; ++round) {
    for (const ExecutorState state : kStates) {
      PausedRobot robot(GetParam(), static_cast<unsigned>(round + 1));
      FaultBench& bench = robot.bench;
      ASSERT_EQ(bench.configured, Status::kOk);
      ASSERT_TRUE(bench.Reach(state)) << ToString(state) << ", round " << round;
      const int more = std::uniform_int_distribution(0, 30)(random);
      for (int i = 0; i < more; ++i) bench.Tick();
      robot.Forget();
      const double pause_s = 1e-3 * std::pow(10, exponent(random));
      const int periods =
          std::max(1, static_cast<int>(std::lround(pause_s * bench.config().drives.rate_hz)));
      robot.Pause(periods);
      const bool was_armed = bench.executor.state() != ExecutorState::kDisarmed;
      for (int i = 0; i < 200; ++i) {
        bench.Tick();
        for (std::size_t j = 0; j < 2; ++j) {
          ASSERT_FALSE(was_armed && robot.Snaps(j))
              << ToString(state) << ", round " << round << ", " << periods << " periods, tick " << i
              << " after it: joint " << j << " is at " << robot.JointNow(j) << " rad";
        }
      }
      let_go += robot.has_let_go() ? 1 : 0;
      const std::uint32_t bit = 1U << static_cast<unsigned>(Fault::kPaused);
      if (!was_armed || (bench.output.record.faults & bit) == 0) continue;
      ++paused;
      EXPECT_EQ(bench.output.record.reaction, Reaction::kDisable);
      // Only arming anew moves, and it begins where the joint is.
      bench.Tick(OperatorCommand::kDisarm);
      bench.Tick(OperatorCommand::kClearFaults);
      for (int i = 0; i < 30; ++i) bench.Tick();
      bench.Tick(OperatorCommand::kArm);
      ASSERT_EQ(bench.output.record.refusal.refusal, Refusal::kNone)
          << ToString(bench.output.record.refusal.refusal);
      ASSERT_TRUE(bench.TickUntil(ExecutorState::kHolding, 600))
          << ToString(bench.executor.state());
      for (std::size_t j = 0; j < 2; ++j)
        EXPECT_NEAR(bench.judge.last_order(j).position_rad, robot.JointNow(j), kThere_rad);
      EXPECT_THAT(bench.judge.report().violations, IsEmpty());
    }
  }
  EXPECT_GT(let_go, kRounds) << "drives let go in many of these";
  EXPECT_GT(paused, kRounds);
}

INSTANTIATE_TEST_SUITE_P(All, Pauses, ::testing::ValuesIn(EveryProtocol()),
                         [](const auto& protocol) { return protocol.param.name; });

}  // namespace
}  // namespace tumbler
