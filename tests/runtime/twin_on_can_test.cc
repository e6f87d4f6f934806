// Two processes on the CAN interface of a kernel: tumbler run, and tumbler twin, which simulates
// the robot. The tests check the robot's true state, and the frames on the bus, which candump logs
// and FrameChecker judges.
//
// A gait needs at least 100 ticks a second, but the guest may stand still for 50 ms. So both
// programs count four seconds of the clock as one of the robot (--pace). No time is asserted.

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drive_server.h"
#include "firmware_interface/devices/drives_toml.h"
#include "tests/support/can_interface.h"
#include "tests/support/files.h"
#include "tests/support/frame_checker.h"
#include "tests/support/program.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using testing::CheckFrames;
using testing::FrameReport;
using testing::FrameRules;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::ParseCandumpLog;
using testing::Program;
using testing::ReadFile;
using testing::Replaced;
using testing::VirtualCan;

const std::string kPrimitives = testing::SourcePath("primitives/");
constexpr double kPace = 0.25;
constexpr int kRunFault = 3;  // exit code of tumbler run
constexpr int kFell = 4;      // exit code of tumbler twin
constexpr int kKilled = 1000 + SIGKILL;

class TwinOnCan : public ::testing::Test {
 protected:
  TwinOnCan() {
    testing::RequireCan();
    std::string text = ReadFile(kPrimitives + "robots/tumbler_drives.toml");
    text = Replaced(text, "rate_hz = 1000.0", "rate_hz = 100.0");
    text = Replaced(text, "watchdog_s = 0.025 ", "watchdog_s = 0.2 ");
    text = Replaced(text, "watchdog_s = 0.025\n", "watchdog_s = 0.2\n");
    testing::WriteFile(Path("drives.toml"), text);
    rules_.drives = LoadDrives(Path("drives.toml"));
    const PrimitiveFile handstand = LoadPrimitive(kPrimitives + "handstand.toml");
    for (const JointMotion<double>& joint : handstand.primitive.motions())
      rules_.limits.push_back(joint.limits);
    rules_.silence_s = 0.2 / kPace;
  }
  void Reset() {
    candump_.reset();
    twin_.reset();
    std::filesystem::remove(Path("candump"));
  }

  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  void StartTwin(const std::string& interface) {
    twin_ = std::make_unique<Program>(std::vector<std::string>{
        testing::ProgramPath("tumbler twin"), interface, kPrimitives + "cartwheel.toml", "--drives",
        Path("drives.toml"), "--pace", std::to_string(kPace), "--json", Path("truth.json")});
    ASSERT_TRUE(twin_->WaitFor("2 drives on " + interface)) << twin_->text();
  }
  void StartCandump(const std::string& interface) {
    candump_ = testing::StartCandump(interface, Path("candump"));
  }
  [[nodiscard]] std::unique_ptr<Program> StartGait(const std::string& interface,
                                                   const std::vector<std::string>& more) const {
    return StartRun(interface, "cartwheel.toml", more);
  }
  [[nodiscard]] std::unique_ptr<Program> StartRun(const std::string& interface,
                                                  const std::string& motion,
                                                  const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{testing::ProgramPath("tumbler run"),
                                       interface,
                                       kPrimitives + motion,
                                       "--pace",
                                       std::to_string(kPace),
                                       "--drives",
                                       Path("drives.toml"),
                                       "--arm",
                                       "--realtime"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return std::make_unique<Program>(arguments);
  }
  [[nodiscard]] FrameReport Judge() const {
    const std::string text = ReadFile(Path("candump"));
    return CheckFrames(ParseCandumpLog(text.substr(0, text.rfind('\n') + 1)), rules_);
  }
  /// From the reply of the first drive to that of the second, in the median [s of the clock].
  [[nodiscard]] double UsualTimeBetweenReplies_s() const {
    const std::string text = ReadFile(Path("candump"));
    std::vector<double> times_s;
    double first_s = 0;
    for (const auto& logged : ParseCandumpLog(text.substr(0, text.rfind('\n') + 1))) {
      if (logged.frame.id == 17) first_s = logged.time_s;
      if (logged.frame.id == 18 && first_s > 0) times_s.push_back(logged.time_s - first_s);
    }
    if (times_s.empty()) return 0;
    const auto middle = times_s.begin() + static_cast<std::ptrdiff_t>(times_s.size() / 2);
    std::nth_element(times_s.begin(), middle, times_s.end());
    return *middle;
  }
  /// Ends the twin, whose output is then in `truth_`. @returns its exit status.
  int EndTwin() {
    twin_->Signal(SIGINT);
    const int status = twin_->Wait();
    truth_ = Json::Parse(ReadFile(Path("truth.json"))).value();
    return status;
  }
  /// Expects that the twin's output is as documented. This takes seconds in the guest.
  void ExpectValidTruth() const {
    Program valid({"/usr/bin/python3", "-m", "jsonschema", "--instance", Path("truth.json"),
                   testing::SourcePath("docs/schemas/tumbler-twin.schema.json")});
    EXPECT_EQ(valid.Wait(), 0) << valid.text();
  }
  /// Sleeps for a time of the robot.
  static void Sleep(double time_s) { usleep(static_cast<useconds_t>(1e6 * time_s / kPace)); }
  /// Waits until the robot is in the midst of the handstand, which it begins when it is let go and
  /// which takes 0.7 s.
  void AwaitMidHandstand() const {
    ASSERT_TRUE(twin_->WaitFor("let go")) << twin_->text();
    Sleep(0.4);  // It is caught before, and then rolled out.
  }
  /// Runs once more from the start, with a robot that stands there, and expects success.
  void ExpectToSucceedAgain(const std::string& interface) {
    const std::unique_ptr<Program> again =
        StartRun(interface, "handstand.toml", {"--hold-s", "4", "--end", "torque-off"});
    EXPECT_EQ(again->Wait(), 0) << again->text();
    ASSERT_TRUE(twin_->WaitFor("rests as after handstand")) << twin_->text();
    const FrameReport report = Judge();
    EXPECT_THAT(report.violations, IsEmpty());
    for (const FrameReport::Joint& joint : report.joints) {
      EXPECT_EQ(joint.starts, 2);
      EXPECT_LE(joint.start_jump_rad, 0.02) << "the first setpoint is where the joint is";
    }
  }

  testing::TemporaryFolder folder_;
  FrameRules rules_;
  std::unique_ptr<Program> twin_;
  std::unique_ptr<Program> candump_;
  Json truth_;
};

/// The poses in which the robot came to rest, in order, with their pitch.
std::vector<std::pair<std::string, double>> RestsOf(const Json& truth) {
  std::vector<std::pair<std::string, double>> rests;
  for (const Json& event : truth["events"].elements()) {
    const std::string pose = event["pose"].text();
    // Between two motions a robot that rocks on its feet may rest more than once.
    if (event["event"].text() != "rest" || (!rests.empty() && rests.back().first == pose) ||
        pose == "as before handstand")
      continue;
    rests.emplace_back(pose, event["root_pitch_rad"].number());
  }
  return rests;
}

TEST_F(TwinOnCan, DrivesOfASlowerPaceWaitForAsLongAsTheClockTakes) {
  const VirtualCan can;
  SimulatedBus bus;
  DriveServer server(
      can.name(), rules_.drives, bus, {}, [&bus](std::int64_t time_ns) { bus.AdvanceTo(time_ns); },
      kPace);
  const std::int64_t until_ns = 20'000'000;
  int turns = 0;
  for (; server.now_ns() < until_ns; ++turns) server.ServeUntil(until_ns);
  // In its first 4 ms it looks every half millisecond, as after a frame.
  EXPECT_LE(turns, 10) << "no frame came, and it was to wait";
}

TEST_F(TwinOnCan, HandstandAndDownstandAlternateAndTheRobotIsUprightAndLevelInTurn) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartCandump(can.name());
    StartTwin(can.name());
    const std::unique_ptr<Program> run = StartGait(can.name(), {"--cycles", "2"});
    ASSERT_EQ(run->Wait(), 0) << run->text();
    EXPECT_EQ(EndTwin(), 0) << twin_->text();
    ExpectValidTruth();
    EXPECT_EQ(truth_["falls"], 0);
    const auto rests = RestsOf(truth_);
    ASSERT_EQ(rests.size(), 4U) << truth_["events"];
    const std::vector<std::string> poses = {"as after handstand", "as after downstand",
                                            "as after handstand, swapped",
                                            "as after downstand, swapped"};
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(rests[i].first, poses[i]);
      // Each is a quarter turn further: upright, level and turned round, upside down, level again.
      EXPECT_NEAR(rests[i].second, (static_cast<double>(i) + 1) * M_PI / 2, 0.02);
    }
    const FrameReport report = Judge();
    EXPECT_THAT(report.violations, IsEmpty());
    for (const FrameReport::Joint& joint : report.joints) EXPECT_EQ(joint.starts, 1);
    // Both drives answer at once, so that their replies are a frame apart: more than 100 bit times,
    // in steady time.
    EXPECT_GT(UsualTimeBetweenReplies_s(), 100e-6 / kPace);
  });
}

TEST_F(TwinOnCan, AHandstandIsFollowedByTheRollWhenThatIsAskedFor) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartCandump(can.name());
    StartTwin(can.name());
    const std::unique_ptr<Program> run = StartGait(can.name(), {"--branch", "roll"});
    ASSERT_EQ(run->Wait(), 0) << run->text();
    EXPECT_EQ(EndTwin(), 0) << twin_->text();
    const auto rests = RestsOf(truth_);
    ASSERT_EQ(rests.size(), 2U) << truth_["events"];
    EXPECT_EQ(rests[0].first, "as after handstand");
    EXPECT_NEAR(rests[0].second, M_PI / 2, 0.02);
    EXPECT_EQ(rests[1].first, "as after roll");
    EXPECT_NEAR(rests[1].second, 2 * M_PI, 0.5);
    EXPECT_THAT(Judge().violations, IsEmpty());
  });
}

TEST_F(TwinOnCan, ARobotThatGoesAwayInMidHandstandEndsTheRunAndAnotherOneIsDrivenWithoutAJump) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartCandump(can.name());
    StartTwin(can.name());
    const std::unique_ptr<Program> run = StartGait(can.name(), {"--cycles", "1"});
    AwaitMidHandstand();
    twin_->Signal(SIGKILL);
    EXPECT_EQ(twin_->Wait(), kKilled);
    EXPECT_EQ(run->Wait(), kRunFault);
    EXPECT_THAT(run->text(), HasSubstr("stale reply"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: roll out"));
    StartTwin(can.name());
    ExpectToSucceedAgain(can.name());
    EXPECT_EQ(EndTwin(), 0);
  });
}

TEST_F(TwinOnCan, AnInterfaceThatGoesDownInMidHandstandFellsTheRobotAndIsStartedAnewWithoutAJump) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartCandump(can.name());
    StartTwin(can.name());
    const std::unique_ptr<Program> run = StartGait(can.name(), {"--cycles", "1"});
    AwaitMidHandstand();
    can.Down();
    Sleep(0.4);
    can.Up();
    EXPECT_EQ(run->Wait(), kRunFault);
    EXPECT_THAT(run->text(), HasSubstr("interface down: link down"));
    EXPECT_THAT(run->text(), HasSubstr("(running); reaction: disable"));
    ASSERT_TRUE(twin_->WaitFor("FELL")) << twin_->text();
    EXPECT_THAT(twin_->text(), HasSubstr("leg1: watchdog expired"));
    twin_->Signal(SIGUSR1);
    ASSERT_TRUE(twin_->WaitFor("put back where it began"));
    ExpectToSucceedAgain(can.name());
    EXPECT_EQ(EndTwin(), kFell);
    ExpectValidTruth();
    EXPECT_EQ(truth_["falls"], 1);
  });
}

TEST_F(TwinOnCan, WhenTheRunIsKilledInMidHandstandTheWatchdogsLetGoAndTheNextOneDoesNotJump) {
  testing::InSteadyTime([this] {
    Reset();
    const VirtualCan can;
    StartCandump(can.name());
    StartTwin(can.name());
    const std::unique_ptr<Program> run = StartGait(can.name(), {"--cycles", "1"});
    AwaitMidHandstand();
    run->Signal(SIGKILL);
    EXPECT_EQ(run->Wait(), kKilled);
    ASSERT_TRUE(twin_->WaitFor("leg2: watchdog expired")) << twin_->text();
    ASSERT_TRUE(twin_->WaitFor("FELL")) << twin_->text();
    twin_->Signal(SIGUSR1);
    ASSERT_TRUE(twin_->WaitFor("put back where it began"));
    ExpectToSucceedAgain(can.name());
    EXPECT_EQ(EndTwin(), kFell);
  });
}

}  // namespace
}  // namespace tumbler
