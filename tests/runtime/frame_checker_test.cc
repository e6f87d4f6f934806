// The judge of the runs on real interfaces has to notice mistakes: each test spoils a good log.

#include "tests/support/frame_checker.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "runtime/assembly/dry_run_bus.h"

namespace tumbler::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kPeriod_s = 0.02;
constexpr int kStartUp = 5;  // ticks: torque off, neutral, three times motor mode
constexpr int kTicks = 40;

FrameRules Rules() {
  FrameRules rules;
  rules.drives.rate_hz = 1 / kPeriod_s;
  for (std::uint16_t i = 0; i < 2; ++i) {
    DriveEntry entry;
    std::get<MitConfig>(entry.config).command_id = static_cast<std::uint16_t>(1 + i);
    std::get<MitConfig>(entry.config).reply_id = static_cast<std::uint16_t>(17 + i);
    rules.drives.drives.push_back(entry);
    JointLimits<double> limits;
    limits.position_min_rad = -1;
    limits.position_max_rad = 1;
    limits.velocity_max_rad_s = 3;
    limits.torque_max_nm = 5;
    rules.limits.push_back(limits);
  }
  // The same through a gear that turns the other way.
  std::get<MitConfig>(rules.drives.drives[1].config).joint = {-1, 2, 0.25F};
  return rules;
}

/// The position at which a joint is, and is asked to be, in a tick.
double Position(int tick) {
  // The joint is at rest until it is driven.
  return tick < kStartUp ? 0 : 0.3 * std::sin(0.1 * (tick - kStartUp));
}

/// The two frames of a drive in one tick of a good run.
CanFrame Command(const FrameRules& rules, std::size_t joint, int tick) {
  const MitConfig& mit = std::get<MitConfig>(rules.drives.drives[joint].config);
  if (tick == 0) return MitMagicFrame(mit, MitMagic::kExit);
  ImpedanceCommand command;
  command.position_rad = mit.joint.ToDrivePosition(static_cast<float>(Position(tick)));
  if (tick == 1) return EncodeMitCommand(mit, command);
  if (tick < kStartUp) return MitMagicFrame(mit, MitMagic::kEnter);
  command.kp_nm_per_rad = 50;
  command.kd_nm_s_per_rad = 1;
  return EncodeMitCommand(mit, command);
}

std::vector<LoggedFrame> GoodLog(const FrameRules& rules) {
  std::vector<LoggedFrame> log;
  for (int tick = 0; tick < kTicks; ++tick) {
    const double time_s = 1000 + tick * kPeriod_s;
    for (std::size_t joint = 0; joint < 2; ++joint) {
      log.push_back({time_s, Command(rules, joint, tick)});
    }
    for (std::size_t joint = 0; joint < 2; ++joint) {
      const MitConfig& mit = std::get<MitConfig>(rules.drives.drives[joint].config);
      MitReply reply;
      reply.sender = static_cast<std::uint8_t>(mit.command_id);
      reply.position_rad = mit.joint.ToDrivePosition(static_cast<float>(Position(tick)));
      log.push_back({time_s + 0.001, EncodeMitReply(mit, reply)});
    }
  }
  return log;
}

/// The log's entry for a joint's command in a tick.
std::size_t At(int tick, std::size_t joint) { return static_cast<std::size_t>(4 * tick) + joint; }

class SpoiltLog : public ::testing::Test {
 protected:
  /// Replaces a joint's command in a tick.
  void Spoil(int tick, std::size_t joint, const std::function<void(ImpedanceCommand&)>& change) {
    const MitConfig& mit = std::get<MitConfig>(rules_.drives.drives[joint].config);
    ImpedanceCommand command;
    ASSERT_EQ(DecodeMitCommand(mit, log_[At(tick, joint)].frame, command), Status::kOk);
    change(command);
    log_[At(tick, joint)].frame = EncodeMitCommand(mit, command);
  }
  void Remove(std::size_t from, std::size_t count) {
    const auto first = log_.begin() + static_cast<std::ptrdiff_t>(from);
    log_.erase(first, first + static_cast<std::ptrdiff_t>(count));
  }
  void Delay(int from_tick, double by_s) {
    for (std::size_t i = At(from_tick, 0); i < log_.size(); ++i) log_[i].time_s += by_s;
  }
  [[nodiscard]] std::string First() const {
    const FrameReport report = CheckFrames(log_, rules_);
    return report.violations.empty() ? "" : report.violations.front();
  }

  FrameRules rules_ = Rules();
  std::vector<LoggedFrame> log_ = GoodLog(rules_);
};

TEST_F(SpoiltLog, AGoodOneHasNoViolationAndIsMeasured) {
  const FrameReport report = CheckFrames(log_, rules_);
  EXPECT_THAT(report.violations, IsEmpty());
  for (const FrameReport::Joint& joint : report.joints) {
    EXPECT_EQ(joint.commands, kTicks);
    EXPECT_EQ(joint.driving, kTicks - kStartUp);
    EXPECT_EQ(joint.starts, 1);
    EXPECT_EQ(joint.replies, kTicks);
    EXPECT_NEAR(joint.step_max_rad, 0.03, 0.001);
    EXPECT_NEAR(joint.last_position_rad, Position(kTicks - 1), 0.001);
  }
  EXPECT_NEAR(report.rate_hz, 50, 0.01);
  EXPECT_NEAR(report.longest_silence_s, kPeriod_s, 1e-6);
  EXPECT_NEAR(report.last_driving_s, 1000 + (kTicks - 1) * kPeriod_s, 1e-6);
}

TEST_F(SpoiltLog, AStrangersFrame) {
  CanFrame frame;
  frame.id = 3;
  log_.insert(log_.begin() + 40, {log_[40].time_s, frame});
  EXPECT_THAT(First(), HasSubstr("line 41: identifier 3 is none"));
}

TEST_F(SpoiltLog, ACommandInTheExtendedFormat) {
  log_[At(10, 0)].frame.extended = true;
  EXPECT_THAT(First(), HasSubstr("identifier 1 is none"));
}

TEST_F(SpoiltLog, ACommandOfSevenBytes) {
  log_[At(10, 1)].frame.size = 7;
  EXPECT_THAT(First(), HasSubstr("joint 1: not a command"));
}

TEST_F(SpoiltLog, ATickThatLeavesADriveOut) {
  Remove(At(10, 1), 1);
  EXPECT_THAT(First(), HasSubstr("joint 0 is commanded where joint 1 is due"));
}

TEST_F(SpoiltLog, ACommandTwice) {
  log_.insert(log_.begin() + static_cast<std::ptrdiff_t>(At(10, 0)), log_[At(10, 0)]);
  EXPECT_THAT(First(), HasSubstr("joint 0 is commanded where joint 1 is due"));
}

TEST_F(SpoiltLog, APositionBeyondItsLimit) {
  rules_.limits[1].position_max_rad = 0.29;
  EXPECT_THAT(First(), HasSubstr("joint 1: position"));
  rules_.limits[1].position_max_rad = 1;
  rules_.limits[0].position_min_rad = -0.05;
  EXPECT_THAT(First(), HasSubstr("joint 0: position"));
}

TEST_F(SpoiltLog, AVelocityBeyondItsLimit) {
  Spoil(20, 1,
        [](ImpedanceCommand& command) { command.velocity_rad_s = -6.2F; });  // 3.1 at the joint
  EXPECT_THAT(First(), HasSubstr("joint 1: velocity 3.0952"));
}

TEST_F(SpoiltLog, AFeedForwardBeyondItsLimit) {
  Spoil(20, 0, [](ImpedanceCommand& command) { command.torque_nm = -5.1F; });
  EXPECT_THAT(First(), HasSubstr("joint 0: torque -5.1"));
}

TEST_F(SpoiltLog, AStepInPosition) {
  Spoil(20, 0, [](ImpedanceCommand& command) { command.position_rad += 0.2F; });
  EXPECT_THAT(First(), HasSubstr("joint 0: a step of 0.2"));
}

TEST_F(SpoiltLog, AStepInTorque) {
  rules_.torque_rise_s = 0.2;  // 0.5 N m a tick
  Spoil(20, 0, [](ImpedanceCommand& command) { command.torque_nm = 1.2F; });
  EXPECT_THAT(First(), HasSubstr("joint 0: a torque step of 1.19"));
}

TEST_F(SpoiltLog, AFirstSetpointFarFromWhereTheDriveIs) {
  for (std::size_t i = 0; i < log_.size(); ++i) {
    if (log_[i].frame.id != 17) continue;
    MitReply reply;
    const MitConfig& mit = std::get<MitConfig>(rules_.drives.drives[0].config);
    ASSERT_EQ(DecodeMitReply(mit, log_[i].frame, reply), Status::kOk);
    reply.position_rad += 0.1F;
    log_[i].frame = EncodeMitReply(mit, reply);
  }
  EXPECT_THAT(First(), HasSubstr("joint 0: the first setpoint is 0.0996"));
}

TEST_F(SpoiltLog, ADriveThatIsDrivenWithoutHavingBeenStarted) {
  Remove(At(2, 0), 12);  // motor mode
  EXPECT_THAT(First(), HasSubstr("joint 0 is driven without having been started up"));
}

TEST_F(SpoiltLog, MotorModeWithWhateverSetpointTheDriveRemembers) {
  Remove(At(1, 0), 4);
  EXPECT_THAT(First(), HasSubstr("joint 0: motor mode without a neutral setpoint"));
}

TEST_F(SpoiltLog, ASetpointAfterTorqueOff) {
  const MitConfig& mit = std::get<MitConfig>(rules_.drives.drives[1].config);
  log_[At(20, 1)].frame = MitMagicFrame(mit, MitMagic::kExit);
  EXPECT_THAT(First(), HasSubstr("joint 1 is driven without having been started up"));
}

TEST_F(SpoiltLog, FeedForwardAloneCountsAsDriving) {
  log_[At(20, 0)].frame =
      MitMagicFrame(std::get<MitConfig>(rules_.drives.drives[0].config), MitMagic::kExit);
  Spoil(21, 0, [](ImpedanceCommand& command) {
    command = {};
    command.torque_nm = 0.5F;
  });
  EXPECT_THAT(First(), HasSubstr("joint 0 is driven without"));
}

TEST_F(SpoiltLog, AStaleSetpointAfterSilence) {
  Delay(20, 0.2);
  EXPECT_THAT(First(), HasSubstr("joint 0 is driven without having been started up"));
  EXPECT_NEAR(CheckFrames(log_, rules_).longest_silence_s, 0.22, 0.001);
}

TEST_F(SpoiltLog, AnEncodersZeroBeingSet) {
  log_[At(20, 0)].frame =
      MitMagicFrame(std::get<MitConfig>(rules_.drives.drives[0].config), MitMagic::kZero);
  EXPECT_THAT(First(), HasSubstr("joint 0: its zero is set"));
}

TEST_F(SpoiltLog, SilenceTorqueOffAndDampingAreAllowed) {
  // A fault in tick 20: damping, a broken tick, silence, torque off.
  for (int tick = 20; tick < 30; ++tick) {
    for (std::size_t joint = 0; joint < 2; ++joint) {
      Spoil(tick, joint, [](ImpedanceCommand& command) {
        command.kp_nm_per_rad = 0;
        command.velocity_rad_s = 0;
      });
    }
  }
  for (int tick = 30; tick < kTicks; ++tick) {
    for (std::size_t joint = 0; joint < 2; ++joint) {
      log_[At(tick, joint)].frame =
          MitMagicFrame(std::get<MitConfig>(rules_.drives.drives[joint].config), MitMagic::kExit);
    }
  }
  Delay(30, 0.5);
  Remove(At(29, 1), 1);
  EXPECT_THAT(CheckFrames(log_, rules_).violations, IsEmpty());
}

TEST(CandumpLog, IsReadAsOurOwnLinesAreWritten) {
  CanFrame standard{0x7ab, false, false, 3, {1, 0xfe, 3}};
  CanFrame extended{0x1234567, true, false, 0, {}};
  CanFrame remote{5, false, true, 0, {}};
  std::string text;
  for (const CanFrame& frame : {standard, extended, remote}) {
    text += CandumpLine(12'345'678'000, "vcan0", frame) + "\n";
  }
  const std::vector<LoggedFrame> log = ParseCandumpLog(text);
  ASSERT_EQ(log.size(), 3U);
  EXPECT_NEAR(log[0].time_s, 12.345678, 1e-9);
  EXPECT_EQ(log[0].frame, standard);
  EXPECT_EQ(log[1].frame, extended);
  EXPECT_EQ(log[2].frame, remote);
}

TEST(CandumpLog, NamesALineThatItCannotRead) {
  const std::string good = "(1.5) can0 001#00\n";
  for (const char* bad :
       {"nonsense", "(1.5) can0", "(x) can0 001#00", "(1.5) can0 01#00", "(1.5) can0 00G#00",
        "(1.5) can0 001#0", "(1.5) can0 001#0G", "(1.5) can0 001#000000000000000000"}) {
    try {
      static_cast<void>(ParseCandumpLog(good + bad + "\n"));
      FAIL() << bad;
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr("line 2")) << bad;
    }
  }
}

}  // namespace
}  // namespace tumbler::testing
