// tumbler run on the CAN interfaces of a kernel, with simulated drives in another process. candump
// logs the bus, and FrameChecker judges the frames.
//
// The guest's clock is coarse (times below 10 ms mean nothing), hence 25 ticks a second and drives
// that wait 0.2 s before they let go.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "common/files/primitive_hash.h"
#include "firmware_interface/devices/drives_toml.h"
#include "tests/support/can_interface.h"
#include "tests/support/files.h"
#include "tests/support/frame_checker.h"
#include "tests/support/primitive_file.h"
#include "tests/support/program.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using testing::CheckFrames;
using testing::Eventually;
using testing::FrameReport;
using testing::FrameRules;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::LoggedFrame;
using testing::ParseCandumpLog;
using testing::Program;
using testing::ReadFile;
using testing::Replaced;
using testing::SerialCan;
using testing::Shell;
using testing::VirtualCan;
using testing::WriteFile;

constexpr double kRate_hz = 25;
constexpr double kWatchdog_s = 0.2;
constexpr int kFault = 3;  // exit codes of tumbler run
constexpr int kStopped = 130;

class RunOnCan : public ::testing::Test {
 protected:
  RunOnCan() {
    testing::RequireCan();
    WriteMotion(1.6);
    rules_.silence_s = kWatchdog_s;
  }
  /// Writes the motion that is played, and says what its frames have to keep to. Limits and the way
  /// to its start do not depend on how long it takes.
  void WriteMotion(double duration_s) {
    testing::MotionShape shape;
    shape.duration_s = 1.6;
    shape.amplitude_rad = 0.2;
    const PrimitiveFile shortest = testing::RandomPrimitiveFile(shape, 70);
    shape.duration_s = duration_s;
    PrimitiveFile file = testing::RandomPrimitiveFile(shape, 70);
    file.primitive.following_tolerance_rad = 0.5;  // allows three late ticks at full speed
    rules_.limits.clear();
    start_rad_.clear();
    for (std::size_t i = 0; i < 2; ++i) {
      file.primitive.joints[i].limits = shortest.primitive.joints[i].limits;
      rules_.limits.push_back(file.primitive.joints[i].limits);
      start_rad_.push_back(file.primitive.joints[i].position.control_points()[0]);
    }
    testing::SetMargins(file);
    WriteFile(Path("motion.toml"), ToToml(file));
  }
  /// Writes a motion that goes on for so long that a slow machine, too, comes in its midst to what
  /// the test does then.
  void WriteLongMotion() { WriteMotion(6.4); }
  /// Ends the programs that an earlier attempt left running.
  void Reset() {
    candump_.reset();
    drives_.reset();
    std::filesystem::remove(Path("candump"));
    WriteDrives(1'000'000);
  }

  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  void WriteDrives(int bit_rate) { WriteDrives("tumbler_drives.toml", bit_rate); }
  /// Writes an example's drives file, for the joints, rate and watchdogs of this test.
  void WriteDrives(const std::string& example, int bit_rate) {
    std::string text = ReadFile(testing::SourcePath("primitives/robots/" + example));
    const auto replace = [&text](const std::string& what, const std::string& with) {
      text = Replaced(text, what, with);
    };
    replace("\"leg1\"", "\"joint1\"");
    replace("\"leg2\"", "\"joint2\"");
    replace("bit_rate = 1_000_000", "bit_rate = " + std::to_string(bit_rate));
    replace("rate_hz = 1000.0", "rate_hz = 25.0");
    replace("watchdog_s = 0.025 ", "watchdog_s = 0.2 ");
    replace("watchdog_s = 0.025\n", "watchdog_s = 0.2\n");
    // What drives send by their own clocks, about once a tick.
    text = testing::ReplacedAll(text, "heartbeat_s = 0.01", "heartbeat_s = 0.04");
    text = testing::ReplacedAll(text, "estimates_s = 0.001", "estimates_s = 0.04");
    text = testing::ReplacedAll(text, "torques_s = 0.01", "torques_s = 0");
    WriteFile(Path("drives.toml"), text);
    rules_.drives = LoadDrives(Path("drives.toml"));
    ASSERT_EQ(rules_.drives.rate_hz, kRate_hz);
    ASSERT_EQ(rules_.drives.drives[1].watchdog_s, kWatchdog_s);
  }

  /// Starts simulated drives. They are away from the motion's start, and their rotors stop soon
  /// when they are let go.
  void StartDrives(const std::string& interface, const std::string& friction = "1") {
    drives_ = std::make_unique<Program>(std::vector<std::string>{
        testing::ProgramPath("tumbler drives"), interface, Path("drives.toml"), "--friction",
        friction, "--position", "joint1=" + std::to_string(start_rad_[0] + 0.05), "--position",
        "joint2=" + std::to_string(start_rad_[1] - 0.05)});
    ASSERT_TRUE(drives_->WaitFor("2 drives on " + interface)) << drives_->text();
  }
  /// Starts candump. Only its lines with complete frames are read.
  void StartCandump(const std::string& interface) {
    candump_ = testing::StartCandump(interface, Path("candump"));
  }
  [[nodiscard]] std::vector<LoggedFrame> Log() const {
    const std::string text = ReadFile(Path("candump"));
    return ParseCandumpLog(text.substr(0, text.rfind('\n') + 1));
  }
  [[nodiscard]] FrameReport Judge() const { return CheckFrames(Log(), rules_); }

  [[nodiscard]] std::unique_ptr<Program> Start(const std::string& interface,
                                               const std::vector<std::string>& more = {},
                                               const std::string& hold_s = "0.2") const {
    std::vector<std::string> arguments{testing::ProgramPath("tumbler run"),
                                       interface,
                                       Path("motion.toml"),
                                       "--drives",
                                       Path("drives.toml"),
                                       "--hold-s",
                                       hold_s,
                                       "--end",
                                       "torque-off"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return std::make_unique<Program>(arguments);
  }
  [[nodiscard]] std::unique_ptr<Program> StartArmed(const std::string& interface) const {
    return Start(interface, {"--arm", "--without-realtime", "--json", Path("run.json")});
  }
  /// Waits until a run is in the midst of its motion: when it has driven for more than one and a
  /// half seconds, half a second of which the robot may rest at the start.
  void AwaitMotion(int driving_frames = 38) const {
    ASSERT_TRUE(Eventually([&] { return Judge().joints[0].driving >= driving_frames; }))
        << ReadFile(Path("candump"));
  }
  /// Expects that a log breaks no rule, and that after a moment nothing was driven any more.
  static void ExpectKept(const FrameReport& report) {
    EXPECT_THAT(report.violations, IsEmpty());
    for (const FrameReport::Joint& joint : report.joints) EXPECT_GE(joint.driving, 20);
  }

  testing::TemporaryFolder folder_;
  FrameRules rules_;
  std::vector<double> start_rad_;
  std::unique_ptr<Program> drives_;
  std::unique_ptr<Program> candump_;
};

TEST_F(RunOnCan, ADryRunSendsNothingAndAnArmedRunSendsTheFramesThatItPrinted) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartDrives(can.name());
    StartCandump(can.name());
    Program dry({"/bin/sh", "-c",
                 testing::ProgramPath("tumbler run") + " " + can.name() + " " +
                     Path("motion.toml") + " --drives " + Path("drives.toml") +
                     " --hold-s 0.2 2>/dev/null"});
    EXPECT_EQ(dry.Wait(), 0);
    EXPECT_EQ(ReadFile(Path("candump")), "");

    const std::unique_ptr<Program> run = StartArmed(can.name());
    ASSERT_EQ(run->Wait(), 0) << run->text();
    EXPECT_THAT(run->text(), HasSubstr("completed: random on " + can.name()));
    const FrameReport report = Judge();
    ExpectKept(report);
    EXPECT_NEAR(report.rate_hz, kRate_hz, 0.1 * kRate_hz);
    EXPECT_GT(report.joints[0].driving, 40) << "1.6 s of motion and its way there";
    for (const FrameReport::Joint& joint : report.joints) {
      EXPECT_EQ(joint.starts, 1);
      EXPECT_NEAR(joint.replies, joint.commands, 2) << "every command is answered";
    }

    // The motion itself does not depend on where the joints were. Its frames are the printed ones,
    // except for those that a late tick leaves out.
    std::vector<CanFrame> expected;
    const std::vector<LoggedFrame> dry_log = ParseCandumpLog(dry.text());
    const FrameReport dry_report = CheckFrames(dry_log, rules_);
    EXPECT_EQ(dry_report.joints[0].replies, 0);
    EXPECT_NEAR(dry_report.rate_hz, kRate_hz, 0.01);
    for (const LoggedFrame& logged : dry_log) {
      ImpedanceCommand command;
      const MitConfig& mit = std::get<MitConfig>(rules_.drives.drives[0].config);
      if (DecodeMitCommand(mit, logged.frame, command) == Status::kOk &&
          command.kp_nm_per_rad > 0 && (expected.empty() || !(expected.back() == logged.frame))) {
        expected.push_back(logged.frame);
      }
    }
    ASSERT_GE(expected.size(), 35U);
    const std::vector<LoggedFrame> log = Log();
    auto from = log.begin();
    int found = 0;
    for (const CanFrame& frame : expected) {
      const auto at = std::find_if(
          from, log.end(), [&frame](const LoggedFrame& logged) { return logged.frame == frame; });
      if (at == log.end()) continue;
      from = at;
      ++found;
    }
    EXPECT_GE(found, 0.9 * static_cast<double>(expected.size()));
  });
}

TEST_F(RunOnCan, AnInterfaceThatGoesDownEndsTheRunAndNothingIsDrivenOnceItIsUp) {
  WriteLongMotion();
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    can.Down();
    usleep(400'000);
    can.Up();  // while tumbler run still says torque off
    EXPECT_EQ(run->Wait(), kFault);
    EXPECT_THAT(run->text(), HasSubstr("interface down: link down"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: disable"));
    const FrameReport report = Judge();
    ExpectKept(report);
    EXPECT_GT(report.longest_silence_s, 0.3);
    EXPECT_GT(report.last_command_s, report.last_driving_s + 0.3) << "torque off was sent again";
  });
}

TEST_F(RunOnCan, AnInterfaceThatIsRemovedEndsTheRun) {
  WriteLongMotion();
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    can.Delete();
    const FrameReport removed = Judge();
    EXPECT_EQ(run->Wait(), kFault);
    EXPECT_THAT(run->text(), HasSubstr("interface gone: link gone"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: disable"));
    ExpectKept(Judge());
    EXPECT_EQ(Judge().joints[0].commands, removed.joints[0].commands);
    // The drives serve a new interface of the same name, and they can be driven.
    can.Create();
    ASSERT_TRUE(drives_->WaitFor("is back"));
    StartCandump(can.name());
    const std::unique_ptr<Program> again = StartArmed(can.name());
    EXPECT_EQ(again->Wait(), 0) << again->text();
    ExpectKept(Judge());
  });
}

TEST_F(RunOnCan, ABusThatTakesNoFramesEndsTheRunAndNothingThatWaitedGoesOutLater) {
  WriteLongMotion();
  testing::InSteadyTime([this] {
    Reset();
    VirtualCan can;
    can.Throttle(1'000'000);
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    can.Throttle(200);  // fewer than two frames a second
    EXPECT_EQ(run->Wait(), kFault);
    // The stall is the fault. The restart of the interface, which discards waiting frames, may be
    // seen with it.
    EXPECT_THAT(run->text(), HasSubstr("transmit queue full: would block"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: disable"));
    const std::size_t before = Log().size();
    can.Throttle(1'000'000);
    usleep(500'000);
    const std::vector<LoggedFrame> log = Log();
    for (std::size_t i = before; i < log.size(); ++i) {
      ImpedanceCommand command;
      for (const DriveEntry& entry : rules_.drives.drives) {
        EXPECT_NE(DecodeMitCommand(std::get<MitConfig>(entry.config), log[i].frame, command),
                  Status::kOk)
            << "a setpoint, " << log.size() - i << " frames before the end";
      }
    }
    ExpectKept(Judge());
  });
}

TEST_F(RunOnCan, BusOffEndsTheRunAndNothingIsDrivenAfterRecovery) {
  WriteLongMotion();
  testing::InSteadyTime([this] {
    Reset();
    SerialCan can;
    const VirtualCan bench;
    WriteDrives(500'000);
    const testing::CanWire wire(can.name(), bench.name());
    StartDrives(bench.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    EXPECT_THAT(can.heard(), HasSubstr("\rt0018")) << "the adapter is given the frames";
    can.Say("sb000255\r");
    EXPECT_EQ(run->Wait(), kFault);
    EXPECT_THAT(run->text(), HasSubstr("bus-off: bus off"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: disable"));
    EXPECT_THAT(run->text(), HasSubstr("1 times bus-off"));
    const std::size_t before = Log().size();
    can.Down();
    can.Up();
    usleep(300'000);
    EXPECT_EQ(Log().size(), before) << "nothing waited";
    ExpectKept(Judge());
    const std::unique_ptr<Program> again = StartArmed(can.name());
    EXPECT_EQ(again->Wait(), 0) << again->text();
    ExpectKept(Judge());
  });
}

TEST_F(RunOnCan, AnInterfaceAtAnotherBitRateIsRefused) {
  testing::InSteadyTime([this] {
    Reset();
    SerialCan can;
    for (const char* mode : {"--speed=1", "--arm"}) {
      const std::unique_ptr<Program> run = Start(can.name(), {mode, "--without-realtime"});
      EXPECT_EQ(run->Wait(), 2);
      EXPECT_THAT(run->text(), HasSubstr("runs at 500000 bit/s, but"));
      EXPECT_THAT(run->text(), HasSubstr("says 1000000"));
    }
  });
}

TEST_F(RunOnCan, AnInterfaceThatOnlyListensIsRefusedAtArmingAndNothingIsSent) {
  testing::InSteadyTime([this] {
    Reset();
    WriteDrives(500'000);
    SerialCan can;
    can.Down();
    Shell("ip link set " + can.name() + " type can listen-only on");
    can.Up();
    const std::unique_ptr<Program> run = StartArmed(can.name());
    EXPECT_EQ(run->Wait(), 2) << run->text();
    EXPECT_THAT(run->text(), HasSubstr(can.name() + " only listens"));
    EXPECT_THAT(run->text(), HasSubstr("type can listen-only off"));
    EXPECT_EQ(can.heard().find("\rt"), std::string::npos) << can.heard();
  });
}

TEST_F(RunOnCan, FramesThatTheControllerLostAreSaidInTheSummary) {
  testing::InSteadyTime([this] {
    Reset();
    SerialCan can;
    const VirtualCan bench;
    WriteDrives(500'000);
    const testing::CanWire wire(can.name(), bench.name());
    StartDrives(bench.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    can.Say("e1o\re1o\r");
    EXPECT_EQ(run->Wait(), 0) << run->text();
    EXPECT_THAT(run->text(), HasSubstr("2 overflows of the controller"));
    EXPECT_THAT(ReadFile(Path("run.json")), HasSubstr("\"controller_overflows\": 2"));
  });
}

TEST_F(RunOnCan, WhenItIsKilledTheDrivesWatchdogsTakeOverAndARestartDoesNotJump) {
  WriteLongMotion();
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    run->Signal(SIGKILL);
    EXPECT_EQ(run->Wait(), 1000 + SIGKILL);
    for (const std::string joint : {"joint1", "joint2"}) {
      const std::string event = joint + ": watchdog expired ";
      ASSERT_TRUE(drives_->WaitFor(event));
      ASSERT_TRUE(drives_->WaitFor(" after the last setpoint"));
      const int after_ms =
          std::stoi(drives_->text().substr(drives_->text().find(event) + event.size()));
      EXPECT_GE(after_ms, 200);
      EXPECT_LE(after_ms, 210);
    }
    const FrameReport killed = Judge();
    ExpectKept(killed);
    usleep(300'000);
    EXPECT_EQ(Judge().joints[0].commands, killed.joints[0].commands) << "nothing comes late";

    const std::unique_ptr<Program> again = StartArmed(can.name());
    EXPECT_EQ(again->Wait(), 0) << again->text();
    const FrameReport report = Judge();
    ExpectKept(report);  // One of the rules is that the first setpoint is where the drive is.
    EXPECT_GT(report.longest_silence_s, 0.4);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(report.joints[i].starts, 2);
      EXPECT_LE(report.joints[i].start_jump_rad, 0.01);
    }
  });
}

TEST_F(RunOnCan, AProgramThatWasStoppedForAWhileDrivesNothingAfterwards) {
  for (const bool in_its_hold : {false, true}) {
    WriteMotion(in_its_hold ? 1.6 : 6.4);
    testing::InSteadyTime([this, in_its_hold] {
      Reset();
      const VirtualCan can;
      StartDrives(can.name());
      StartCandump(can.name());
      const std::unique_ptr<Program> run = Start(can.name(), {"--arm", "--without-realtime"}, "30");
      AwaitMotion();
      if (in_its_hold) usleep(2'500'000);
      run->Signal(SIGSTOP);
      usleep(500'000);
      run->Signal(SIGCONT);
      EXPECT_EQ(run->Wait(), kFault);
      EXPECT_THAT(run->text(), HasSubstr("paused"));
      EXPECT_THAT(run->text(), HasSubstr(in_its_hold ? "(holding); reaction: disable"
                                                     : "(running); reaction: disable"));
      const FrameReport report = Judge();
      ExpectKept(report);
      EXPECT_GT(report.longest_silence_s, 0.4);
      // The last frame that drives was sent before the pause, and all of the last second after it.
      EXPECT_GT(report.last_command_s, report.last_driving_s + report.longest_silence_s + 0.5);
    });
  }
}

TEST_F(RunOnCan, DrivesThatFallSilentEndTheRunInDamping) {
  WriteLongMotion();
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    drives_->Signal(SIGKILL);
    EXPECT_EQ(run->Wait(), kFault);
    EXPECT_THAT(run->text(), HasSubstr("stale reply"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: damp"));
    const FrameReport report = Judge();
    ExpectKept(report);
    EXPECT_GT(report.last_command_s, report.last_driving_s + 0.3);
  });
}

TEST_F(RunOnCan, ASecondProgramIsRefusedAndTheFirstOneDoesNotNotice) {
  testing::InSteadyTime([this] {
    WriteMotion(12.8);  // Four programs start meanwhile.
    Reset();
    VirtualCan can;
    Shell("ip link property add dev " + can.name() + " altname motors");
    can.Throttle(1'000'000);  // With a queue, the interface is taken down and up at the start.
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> first = StartArmed(can.name());
    AwaitMotion();
    const std::string unwritable = "--json=" + Path("no/such/folder");
    for (const std::string& mode :
         {std::string("--without-realtime"), std::string("--realtime"), unwritable}) {
      const std::unique_ptr<Program> second = Start(can.name(), {"--arm", mode});
      EXPECT_EQ(second->Wait(), 2) << second->text();
      EXPECT_THAT(second->text(), ::testing::AnyOf(HasSubstr("(tumbler run) drives the motors on"),
                                                   HasSubstr("driving motors takes --realtime"),
                                                   HasSubstr("is not in force")));
    }
    const std::unique_ptr<Program> second = StartArmed(can.name());
    EXPECT_EQ(second->Wait(), 2) << second->text();
    EXPECT_THAT(second->text(), HasSubstr("(tumbler run) drives the motors on " + can.name()));
    const std::unique_ptr<Program> by_another_name = StartArmed("motors");
    EXPECT_EQ(by_another_name->Wait(), 2) << by_another_name->text();
    EXPECT_THAT(by_another_name->text(), HasSubstr("(tumbler run) drives the motors on motors"));
    EXPECT_EQ(first->Wait(), 0) << first->text();
    EXPECT_THAT(first->text(), HasSubstr("completed"));
    ExpectKept(Judge());
    WriteMotion(1.6);
    EXPECT_EQ(StartArmed(can.name())->Wait(), 0) << "the lock ends with its holder";
  });
}

TEST_F(RunOnCan, WhoeverStartsSecondIsRefusedAndTheFramesOfTheFirstStayTheSame) {
  WriteMotion(3.2);
  // A run by itself, and runs and replays that another program wants to join, in every order.
  std::vector<std::string> alone;
  const std::string record = Path("alone.rec");
  struct Order {
    std::string first, second;
  };
  for (const Order& order :
       {Order{"run", "none"}, Order{"run", "run"}, Order{"run", "replay"}, Order{"run", "bench"},
        Order{"replay", "run"}, Order{"replay", "replay"}, Order{"replay", "bench"}}) {
    SCOPED_TRACE(order.first + ", then " + order.second);
    testing::InSteadyTime([&] {
      Reset();
      if (order.second == "none") std::filesystem::remove(record);
      const VirtualCan can;
      StartDrives(can.name());
      StartCandump(can.name());
      const auto start = [&](const std::string& program) -> std::unique_ptr<Program> {
        if (program == "replay") {
          return std::make_unique<Program>(std::vector<std::string>{
              testing::ProgramPath("tumbler replay"), record, "--bus", can.name(), "--arm",
              "--without-realtime", "--drives", Path("drives.toml"), "--end", "torque-off"});
        }
        if (program == "bench") {
          return std::make_unique<Program>(std::vector<std::string>{
              testing::ProgramPath("tumbler bench"), can.name(), "jog", "joint1", "--drives",
              Path("drives.toml"), "--motion", Path("motion.toml"), "--arm", "--yes"});
        }
        std::vector<std::string> more = {"--arm", "--without-realtime"};
        if (order.second == "none") more.insert(more.end(), {"--record", record});
        return Start(can.name(), more);
      };
      const std::unique_ptr<Program> first = start(order.first);
      AwaitMotion();
      if (order.second != "none") {
        const std::unique_ptr<Program> second = start(order.second);
        EXPECT_EQ(second->Wait(), 2) << second->text();
        EXPECT_THAT(second->text(),
                    HasSubstr("(tumbler " + order.first + ") drives the motors on " + can.name()));
      }
      EXPECT_EQ(first->Wait(), 0) << first->text();
      if (order.first == "run") {
        EXPECT_THAT(first->text(), HasSubstr(" 0 missed"));
      }
      ExpectKept(Judge());
      // Arming and the way to the start follow the drives' clock; the motion's setpoints do not.
      std::vector<std::string> log;
      for (const std::uint32_t id : {1U, 2U}) {
        std::vector<std::string> frames;
        for (const LoggedFrame& logged : Log()) {
          if (logged.frame.id != id) continue;
          EXPECT_EQ(logged.frame.size, 8);
          const std::string bytes(logged.frame.data.begin(), logged.frame.data.end());
          if (frames.empty() || frames.back() != bytes) frames.push_back(bytes);
        }
        constexpr std::ptrdiff_t kMotion = 30;  // of the 40 ticks of the motion
        ASSERT_GE(frames.size(), kMotion);
        log.insert(log.end(), frames.end() - kMotion, frames.end());
      }
      if (order.second == "none") alone = log;
      EXPECT_EQ(log, alone);
    });
    if (HasFailure()) return;
  }
}

TEST_F(RunOnCan, ADriveThatHasLostItsTurnsOrWasMovedIsNotArmed) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    const std::string pose = Path("pose.json");
    std::filesystem::remove(pose);
    StartDrives(can.name());
    const auto start = [&](const std::vector<std::string>& more) {
      std::vector<std::string> all = {"--arm", "--without-realtime", "--pose",
                                      pose,    "--start-within",     "100"};
      all.insert(all.end(), more.begin(), more.end());
      return Start(can.name(), all);
    };
    EXPECT_EQ(start({})->Wait(), 0);
    EXPECT_THAT(ReadFile(pose), HasSubstr("joint1"));
    EXPECT_EQ(start({})->Wait(), 0) << "it is where it was left";
    WriteFile(pose, "{\"format\": \"tumbler-pose\", \"shafts_rad\": {\"joint2\": " +
                        std::to_string(start_rad_[1] - 6.2831853) + "}}");
    const auto lost = start({});
    EXPECT_EQ(lost->Wait(), 2) << lost->text();
    EXPECT_THAT(lost->text(), HasSubstr("whole turns of its drive"));
    EXPECT_THAT(lost->text(), HasSubstr("joint2"));
    WriteFile(pose, "{\"format\": \"tumbler-pose\", \"shafts_rad\": {\"joint2\": " +
                        std::to_string(start_rad_[1] - 2) + "}}");
    const auto moved = start({});
    EXPECT_EQ(moved->Wait(), 2) << moved->text();
    EXPECT_THAT(moved->text(), HasSubstr("far from where it was last known"));
    EXPECT_EQ(start({})->Wait(), 2) << "a refusal does not make known where it is";
    EXPECT_EQ(start({"--forget-pose"})->Wait(), 0);
    EXPECT_EQ(start({})->Wait(), 0) << "and its pose is known again";
  });
}

TEST_F(RunOnCan, AFrameOfSomebodyElseThatCommandsADriveIsAFault) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    Shell("cansend " + can.name() + " 002#7FFF7FF0000007FF");  // no gains and no torque
    EXPECT_EQ(run->Wait(), kFault);
    EXPECT_THAT(run->text(), HasSubstr("foreign command of joint joint2: a frame of somebody else "
                                       "with identifier 0x002"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: damp"));
  });
}

TEST_F(RunOnCan, EveryCommandOfSomebodyElseIsAFaultAndNotOnlyThoseThatTheRunSendsItself) {
  testing::InSteadyTime([this] {
    // A parameter that is written, of which the drive would not say a word, and a restart.
    for (const std::string frame : {"044#011C000000000000", "056#00"}) {
      SCOPED_TRACE(frame);
      Reset();
      WriteDrives("tumbler_drives_cansimple.toml", 1'000'000);
      const VirtualCan can;
      StartDrives(can.name());
      StartCandump(can.name());
      const std::unique_ptr<Program> run = StartArmed(can.name());
      AwaitMotion();
      Shell("cansend " + can.name() + " 062#");  // to node 3, which is none of ours
      Shell("cansend " + can.name() + " 044#R");
      Shell("cansend " + can.name() + " " + frame);
      EXPECT_EQ(run->Wait(), kFault);
      EXPECT_THAT(run->text(),
                  HasSubstr("foreign command of joint joint2: a frame of somebody else with "
                            "identifier 0x" +
                            frame.substr(0, 3)));
      EXPECT_THAT(run->text(), HasSubstr("(running); reaction: damp"));
    }
  });
}

TEST_F(RunOnCan, TwoInterruptsBrakeHoldAndLetGo) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartDrives(can.name());
    StartCandump(can.name());
    const std::unique_ptr<Program> run = StartArmed(can.name());
    AwaitMotion();
    run->Signal(SIGINT);  // The first finishes the motion,
    usleep(100'000);
    run->Signal(SIGINT);  // the second brakes.
    EXPECT_EQ(run->Wait(), kStopped) << run->text();
    const FrameReport report = Judge();
    ExpectKept(report);
    const double end_s = report.last_command_s;
    EXPECT_GT(end_s, report.last_driving_s + 0.1);
    ASSERT_TRUE(drives_->WaitFor("joint2: disabled"));
  });
}

TEST_F(RunOnCan, ARequestTowardsRestEndsACheckOfTheDrivesWithTheTorqueOff) {
  const std::string url = "udpm://239.255.76.67:7667?ttl=0";
  Shell("ip link set lo up && ip link set lo multicast on && ip route replace 224.0.0.0/4 dev lo");
  for (const char* const request : {"stop", "disarm", "finish"}) {
    SCOPED_TRACE(request);
    testing::InSteadyTime([&] {
      Reset();
      // Each drive is left alone for so long that the request comes meanwhile, and its joint hardly
      // turns.
      WriteFile(Path("drives.toml"), testing::ReplacedAll(ReadFile(Path("drives.toml")),
                                                          "watchdog_s = 0.2", "watchdog_s = 9"));
      const VirtualCan can;
      StartDrives(can.name(), "60");
      const std::unique_ptr<Program> run =
          Start(can.name(), {"--arm", "--without-realtime", "--prove-watchdog", "--lcm-url", url});
      ASSERT_TRUE(drives_->WaitFor("joint1: enabled")) << run->text();
      const testing::Outcome asked =
          testing::RunProgram({"tumbler ctl", "--lcm-url", url, request});
      EXPECT_EQ(asked.exit_code, 0) << asked.text;
      EXPECT_THAT(asked.text, HasSubstr("taken while the drives were checked"));
      EXPECT_EQ(run->Wait(), kStopped) << run->text();
      EXPECT_THAT(run->text(), HasSubstr("by a request while the drives were checked: torque off"));
      EXPECT_TRUE(drives_->WaitFor("joint1: disabled"));
    });
  }
}

}  // namespace
}  // namespace tumbler
