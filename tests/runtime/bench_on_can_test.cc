// tumbler bench on the CAN interface of a kernel. Simulated drives in another process are not as
// the drives file says; with the file that is written, the handstand succeeds on a robot with the
// same drives.
//
// The guest's clock is coarse, hence 100 ticks a second and drives that wait 0.2 s before they let
// go. The robot and its host count four seconds of the clock as one (--pace).

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "firmware_interface/devices/drives_toml.h"
#include "tests/support/can_interface.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Program;
using testing::Replaced;
using testing::ReplacedAll;
using testing::VirtualCan;

const std::string kBenchMotion = testing::SourcePath("primitives/nominal/handstand.toml");
constexpr int kRemains = 4;       // exit status of tumbler bench
constexpr int kBenchFault = 3;    // likewise
constexpr int kBenchRefused = 2;  // likewise, and of tumbler run
constexpr int kBenchEnded = 130;  // likewise

class BenchOnCan : public ::testing::TestWithParam<testing::ExampleDrives> {
 protected:
  BenchOnCan() {
    testing::RequireCan();
    std::string draft = testing::ReadFile(testing::SourcePath(GetParam().file));
    draft = testing::AtRate(draft, 100);
    draft = ReplacedAll(draft, "watchdog_s = 0.025", "watchdog_s = 0.2");
    // Firmer than for the shipped gait: the nominal handstand was found for stiff drives.
    draft = ReplacedAll(draft, "kp_nm_per_rad = 40.0", "kp_nm_per_rad = 60.0");
    const bool cia402 = GetParam().protocol == "cia402";
    if (cia402)
      draft = Replaced(draft, "watchdog_reaction = \"fault\"", "watchdog_reaction = \"none\"");
    std::string actual = Replaced(draft, "joint = \"leg2\"", "joint = \"leg1\"");
    actual = Replaced(actual, "joint = \"leg1\"", "joint = \"leg2\"");
    actual = Replaced(actual, "zero_offset_rad = 0.0", "zero_offset_rad = 0.3");
    const std::string second = "[[drive]]\njoint = \"leg1\"";
    actual = Replaced(actual, "direction = 1", "direction = -1", second);
    if (cia402) actual = Replaced(actual, "watchdog_s = 0.2", "watchdog_s = 0.0");
    actual = Replaced(actual, "watchdog_s = 0.2", "watchdog_s = 0.0", second);
    testing::WriteFile(Path("draft.toml"), draft);
    testing::WriteFile(Path("actual.toml"), actual);
    testing::WriteFile(Path("noise.toml"),
                       "format = \"tumbler-bus-faults\"\nversion = 1\n"
                       "[[fault]]\nkind = \"loss\"\nnode = \"host\"\nprobability = " +
                           std::string(cia402 ? "0.015" : "0.03") + "\n");
    // What somebody beside the robot would say: the first drive turns leg2, the second leg1 against
    // its axis, and both are in the pose where their zeros are found.
    testing::WriteFile(Path("answers"), "leg2\nyes\nleg1\nno\nyes\nyes\n");
  }

  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  void StartDrives(const std::string& interface, const std::vector<std::string>& more = {},
                   const std::string& friction = "0.1") {
    std::vector<std::string> arguments{testing::ProgramPath("tumbler drives"),
                                       interface,
                                       Path("actual.toml"),
                                       "--friction",
                                       friction,
                                       "--position",
                                       "leg1=-1.5707963",
                                       "--position",
                                       "leg2=1.5707963"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    drives_ = std::make_unique<Program>(arguments);
    ASSERT_TRUE(drives_->WaitFor("2 drives on " + interface)) << drives_->text();
  }
  void EndDrives() {
    drives_->Signal(SIGINT);
    EXPECT_EQ(drives_->Wait(), 0) << drives_->text();
  }
  [[nodiscard]] std::unique_ptr<Program> StartBench(const std::string& interface,
                                                    const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{testing::ProgramPath("tumbler bench"),
                                       interface,
                                       "--drives",
                                       Path("draft.toml"),
                                       "--motion",
                                       kBenchMotion};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return std::make_unique<Program>(arguments);
  }
  /// Plays the handstand on a robot with the drives as they are. @returns tumbler run's status.
  int PlayHandstand(const std::string& interface, const std::string& drives, std::string& text) {
    Program twin({testing::ProgramPath("tumbler twin"), interface, kBenchMotion, "--drives",
                  Path("actual.toml"), "--pace", "0.25", "--json", Path("truth.json")});
    EXPECT_TRUE(twin.WaitFor("2 drives on " + interface)) << twin.text();
    Program run({testing::ProgramPath("tumbler run"), interface, kBenchMotion, "--pace", "0.25",
                 "--drives", Path(drives), "--arm", "--realtime", "--without-watchdog", "--hold-s",
                 "0.5", "--end", "torque-off"});
    const int status = run.Wait();
    text = run.text();
    twin.Signal(SIGINT);
    twin.Wait();
    return status;
  }

  /// Runs the handstand with the draft on drives that have to prove themselves. @returns
  /// tumbler run's status.
  int Prove(const std::string& interface, const std::vector<std::string>& how,
            std::string& text) const {
    std::vector<std::string> arguments{testing::ProgramPath("tumbler run"),
                                       interface,
                                       kBenchMotion,
                                       "--drives",
                                       Path("draft.toml"),
                                       "--arm",
                                       "--without-realtime",
                                       "--forget-pose",
                                       "--clear",
                                       "--hold-s",
                                       "0",
                                       "--end",
                                       "torque-off"};
    arguments.insert(arguments.end(), how.begin(), how.end());
    Program run(arguments);
    const int status = run.Wait();
    text = run.text();
    return status;
  }

  std::unique_ptr<Program> drives_;

 private:
  testing::TemporaryFolder folder_;
};

TEST_P(BenchOnCan, ARunThatIsToProveItsDrivesIsRefusedByTheFirstOneThatIsNotAsTheFileSays) {
  // Of a CiA 402 host the time-out is the same for all drives.
  const bool cia402 = GetParam().protocol == "cia402";
  testing::WriteFile(Path("identities"), "yes\nleg2\nyes\n");
  // Each part starts anew by itself, because each takes long.
  const auto in_steady_time =
      [this](const std::function<void(const std::string& interface)>& check) {
        testing::InSteadyTime([&] {
          const VirtualCan can;
          StartDrives(can.name(), {}, "2");  // so that a push of 0.2 s stays within the amplitude
          check(can.name());
          EndDrives();
        });
      };
  std::string text;
  in_steady_time([&](const std::string& interface) {
    EXPECT_EQ(Prove(interface, {"--check-identity", "--answers", Path("identities")}, text),
              kBenchRefused)
        << text;
    EXPECT_THAT(text, HasSubstr("(leg1) turns leg2, and the drives file says leg1"));
    EXPECT_THAT(drives_->text(), ::testing::Not(HasSubstr("leg1: enabled")))
        << "the drive that really turns leg1 was not to move yet";
  });
  in_steady_time([&](const std::string& interface) {
    EXPECT_EQ(Prove(interface, {"--prove-watchdog"}, text), kBenchRefused) << text;
    EXPECT_THAT(text,
                HasSubstr(cia402 ? "(leg1) still drives after" : "(leg2) still drives after"));
  });
  if (cia402) return;  // The draft tells these drives to do nothing.

  // Drives that are as the file says.
  std::filesystem::copy_file(Path("draft.toml"), Path("actual.toml"),
                             std::filesystem::copy_options::overwrite_existing);
  testing::WriteFile(Path("identities"), "yes\nleg1\nyes\nyes\nleg2\nyes\n");
  in_steady_time([&](const std::string& interface) {
    EXPECT_EQ(
        Prove(interface, {"--check-identity", "--prove-watchdog", "--answers", Path("identities")},
              text),
        0)
        << text;
    EXPECT_THAT(text, HasSubstr("(leg2) turns leg2, as the drives file says"));
    EXPECT_THAT(text, HasSubstr("(leg2): limp "));
    EXPECT_THAT(text, HasSubstr("completed: handstand"));
  });
}

TEST_P(BenchOnCan, ACommissioningFindsWhatIsWrongAndTheHandstandRunsWithTheFileThatItWrites) {
  testing::InSteadyTime([this] {
    const VirtualCan can;
    StartDrives(can.name(), {"--bus-faults", Path("noise.toml")});
    const std::unique_ptr<Program> bench =
        StartBench(can.name(), {"commission", "--arm", "--yes", "--answers", Path("answers"),
                                "--without-turning", "--seconds", "3", "--out",
                                Path("written.toml"), "--overwrite", "--json", Path("bench.json")});
    ASSERT_EQ(bench->Wait(), kRemains) << bench->text();
    for (const char* kind :
         {"identifiers-exchanged", "wrong-direction", "zero-off", "no-watchdog", "noisy-bus"}) {
      EXPECT_THAT(bench->text(), HasSubstr(std::string("FOUND ") + kind));
    }
    EndDrives();
    const DrivesConfig written = LoadDrives(Path("written.toml"));
    const DrivesConfig actual = LoadDrives(Path("actual.toml"));
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(written.drives[i].joint, actual.drives[i].joint);
      EXPECT_EQ(JointOf(written.drives[i].config).direction,
                JointOf(actual.drives[i].config).direction);
      EXPECT_NEAR(JointOf(written.drives[i].config).zero_offset_rad,
                  JointOf(actual.drives[i].config).zero_offset_rad, 0.03F);
    }
  });
  if (HasFailure()) return;
  testing::InSteadyTime([this] {
    const VirtualCan can;
    std::string text;
    EXPECT_NE(PlayHandstand(can.name(), "draft.toml", text), 0) << text;
  });
  testing::InSteadyTime([this] {
    const VirtualCan can;
    std::string text;
    EXPECT_EQ(PlayHandstand(can.name(), "written.toml", text), 0) << text;
    const Json truth = Json::Parse(testing::ReadFile(Path("truth.json"))).value();
    EXPECT_EQ(truth["falls"], 0) << truth;
  });
}

TEST_P(BenchOnCan, AnInterruptInMidMotionTakesTheTorqueOff) {
  testing::InSteadyTime([this] {
    const VirtualCan can;
    StartDrives(can.name());
    const std::unique_ptr<Program> bench =
        StartBench(can.name(), {"jog", "leg1", "--arm", "--yes", "--velocity", "0.02"});
    ASSERT_TRUE(drives_->WaitFor(": enabled")) << bench->text();
    bench->Signal(SIGINT);
    EXPECT_EQ(bench->Wait(), kBenchEnded) << bench->text();
    EXPECT_TRUE(drives_->WaitFor(": disabled")) << drives_->text();
    EndDrives();
  });
}

TEST_P(BenchOnCan, WithoutArmNothingMovesAndTwoProgramsDoNotShareAnInterface) {
  testing::InSteadyTime([this] {
    const VirtualCan can;
    StartDrives(can.name());
    std::unique_ptr<Program> bench = StartBench(can.name(), {"jog", "leg1", "--yes"});
    EXPECT_EQ(bench->Wait(), 2) << bench->text();
    EXPECT_THAT(bench->text(), HasSubstr("say so with --arm"));
    const std::unique_ptr<Program> first = StartBench(can.name(), {"latency", "--seconds", "3600"});
    ASSERT_TRUE(testing::Eventually([&] { return testing::ReceiversOn(can.name()) > 0; }));
    bench = StartBench(can.name(), {"scan"});
    EXPECT_EQ(bench->Wait(), 2) << bench->text();
    EXPECT_THAT(bench->text(), HasSubstr("(tumbler bench) drives the motors on"));
    Program run({testing::ProgramPath("tumbler run"), can.name(), kBenchMotion, "--drives",
                 Path("draft.toml"), "--arm", "--without-realtime", "--without-watchdog"});
    EXPECT_EQ(run.Wait(), 2) << run.text();
    EXPECT_THAT(run.text(), HasSubstr("(tumbler bench) drives the motors on"));
    first->Signal(SIGTERM);
    EXPECT_EQ(first->Wait(), kBenchEnded) << first->text();
    EndDrives();
    EXPECT_THAT(drives_->text(), ::testing::Not(HasSubstr("enabled")));
  });
}

TEST_P(BenchOnCan, AnInterfaceThatGoesAwayInMidMotionIsAFault) {
  testing::InSteadyTime([this] {
    const VirtualCan can;
    StartDrives(can.name());
    const std::unique_ptr<Program> bench =
        StartBench(can.name(), {"jog", "leg1", "--arm", "--yes", "--velocity", "0.02"});
    ASSERT_TRUE(drives_->WaitFor(": enabled")) << bench->text();
    can.Down();
    EXPECT_EQ(bench->Wait(), kBenchFault) << bench->text();
    can.Up();
    EndDrives();
  });
}

using BenchOnTwin = BenchOnCan;

TEST_P(BenchOnTwin, ARobotInAStandIsCommissionedWithItsPhysics) {
  testing::InSteadyTime([this] {
    const VirtualCan can;
    testing::WriteFile(Path("stand.toml"),
                       "format = \"tumbler-twin\"\nversion = 1\n[start]\nstand_m = 0.5\n");
    Program twin({testing::ProgramPath("tumbler twin"), can.name(), kBenchMotion, "--drives",
                  Path("actual.toml"), "--twin", Path("stand.toml")});
    ASSERT_TRUE(twin.WaitFor("2 drives on " + can.name())) << twin.text();
    const std::unique_ptr<Program> bench =
        StartBench(can.name(), {"commission", "--arm", "--yes", "--answers", Path("answers"),
                                "--without-turning", "--seconds", "1", "--out",
                                Path("written.toml"), "--overwrite"});
    ASSERT_EQ(bench->Wait(), kRemains) << bench->text();
    for (const char* kind : {"identifiers-exchanged", "wrong-direction", "zero-off", "no-watchdog"})
      EXPECT_THAT(bench->text(), HasSubstr(std::string("FOUND ") + kind));
    twin.Signal(SIGINT);
    EXPECT_EQ(twin.Wait(), 0) << twin.text();
    std::string text;
    EXPECT_EQ(PlayHandstand(can.name(), "written.toml", text), 0) << text;
  });
}

INSTANTIATE_TEST_SUITE_P(Mit, BenchOnTwin,
                         ::testing::Values(testing::ExampleOfEveryProtocol().front()),
                         [](const auto& example) { return example.param.protocol; });
INSTANTIATE_TEST_SUITE_P(EveryProtocol, BenchOnCan,
                         ::testing::ValuesIn(testing::ExampleOfEveryProtocol()),
                         [](const auto& example) { return example.param.protocol; });

}  // namespace
}  // namespace tumbler
