// The program as a user meets it: its arguments, messages, files and exit codes.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"
#include "tests/support/program.h"
#include "tests/support/steady_time.h"

namespace tumbler {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Outcome;
using testing::Replaced;

class TumblerRun : public ::testing::Test {
 protected:
  TumblerRun() {
    testing::MotionShape shape;
    shape.duration_s = 0.3;
    shape.amplitude_rad = 0.5;
    Write("motion.toml", ToToml(testing::RandomPrimitiveFile(shape, 70)));
  }
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  void Write(const std::string& name, const std::string& text) const {
    testing::WriteFile(Path(name), text);
  }
  [[nodiscard]] static Outcome Run(const std::string& arguments) {
    return testing::RunInShell("tumbler run " + arguments);
  }
  /// Writes the example's drives file with the joints of this test, and `from` replaced by `to`.
  void WriteDrives(const std::string& from = "", const std::string& to = "") const {
    std::string text =
        testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml"));
    text = Replaced(text, "\"leg1\"", "\"joint1\"");
    text = Replaced(text, "\"leg2\"", "\"joint2\"");
    Write("drives.toml", Replaced(text, from, to));
  }
  /// Runs on an interface that no machine has.
  [[nodiscard]] Outcome RunOnMissingInterface(const std::string& more = "") const {
    return Run("can9 " + Path("motion.toml") + " --drives " + Path("drives.toml") + more);
  }

  testing::TemporaryFolder folder_;
};

TEST_F(TumblerRun, ExplainsItself) {
  const Outcome outcome = Run("--help");
  EXPECT_EQ(outcome.exit_code, 0);
  for (const char* part : {"--drives", "--arm", "--realtime", "--speed", "--log", "--lcm-url",
                           "--json", "--csv", "--hold-s", "Exit codes", "130", "kp 200, kd"}) {
    EXPECT_THAT(outcome.text, HasSubstr(part));
  }
  EXPECT_TRUE(std::all_of(outcome.text.begin(), outcome.text.end(), [](char c) {
    return c == '\n' || (c >= ' ' && c <= '~');
  })) << "what no terminal shows is in it";
}

TEST_F(TumblerRun, RejectsWrongCommandLinesWithExitCode1) {
  const std::string motion = Path("motion.toml");
  for (const std::string& arguments :
       {std::string(), std::string("sim"), "sim " + motion + " --speed 1.5",
        "sim " + motion + " --speed 0.05", "sim " + motion + " --hold-s -1",
        "sim " + motion + " --speed nan", "sim " + motion + " --hold-s nan",
        "sim " + motion + " --nonsense", "sim " + motion + " extra",
        "sim " + motion + " --check-identity", "sim " + motion + " --prove-watchdog",
        "can9 " + motion + " --drives x.toml --check-identity"}) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 1) << arguments;
    EXPECT_FALSE(outcome.text.empty()) << arguments;
  }
}

TEST_F(TumblerRun, RefusesOptionsThatItWouldIgnore) {
  WriteDrives();
  const std::string sim = "sim " + Path("motion.toml");
  const std::string can = "can9 " + Path("motion.toml") + " --drives " + Path("drives.toml");
  for (const auto& [arguments, option] : std::vector<std::pair<std::string, std::string>>{
           {sim + " --cycles 2", "--cycles"},
           {sim + " --arm", "--arm"},
           {sim + " --without-realtime", "--without-realtime"},
           {sim + " --without-watchdog", "--without-watchdog"},
           {sim + " --moved-within 1", "--moved-within"},
           {sim + " --forget-pose", "--forget-pose"},
           {sim + " --rate-hz 500", "--rate-hz"},
           {can + " --priority 10", "--priority"},
           {can + " --cpu 0", "--cpu"},
           {sim + " --scheduling deadline", "--scheduling"},
           {"--latency-test 0.1 --cycles 2", "--cycles"},
           {"--latency-test 0.1 --log x", "--log"},
           {"--doctor can9 --json x", "--json"}}) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 1) << arguments;
    EXPECT_THAT(outcome.text, ::testing::StartsWith(option + ": ")) << arguments;
  }
}

TEST_F(TumblerRun, RefusesASequenceWithoutEndInVirtualTimeAndABranchThatIsNotThere) {
  const std::string gait = testing::SourcePath("primitives/nominal/gait.toml");
  const Outcome endless = Run("sim " + gait);
  EXPECT_EQ(endless.exit_code, 1);
  EXPECT_THAT(endless.text, HasSubstr("--cycles"));
  const Outcome branch = Run("sim " + gait + " --branch rol");
  EXPECT_EQ(branch.exit_code, 1);
  EXPECT_THAT(branch.text, HasSubstr("its branches: roll"));
}

TEST_F(TumblerRun, PlaysTheShippedGaitsAndTheRollOverTheSimulatedBus) {
  for (const char* gait : {"gait.toml", "cartwheel.toml", "nominal/gait.toml"}) {
    const Outcome outcome =
        Run("sim " + testing::SourcePath("primitives/") + gait + " --cycles 3 --branch roll");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr("8 motions, 3 complete cycles; the robot where it should"));
  }
}

TEST_F(TumblerRun, AnswersWhatABusFaultsFileDoesToItAsTheFaultsFileSays) {
  const std::string gait =
      "sim " + testing::SourcePath("primitives/nominal/gait.toml") + " --cycles 1";
  const std::string script = " --bus-faults " + testing::SourcePath("tests/data/bus_faults.toml");
  const Outcome shorted = Run(gait + script);
  EXPECT_EQ(shorted.exit_code, 3);
  EXPECT_THAT(shorted.text, HasSubstr("bus-off: bus off at tick 2001"));
  EXPECT_THAT(shorted.text, HasSubstr("reaction: disable"));
  Write("silent.toml",
        "format = \"tumbler-bus-faults\"\nversion = 1\n[[fault]]\nkind = \"loss\"\n"
        "node = \"host\"\nids = [18]\nstart_s = 0.4\nduration_s = 0.02\n");
  Write("faults.toml",
        "format = \"tumbler-faults\"\nversion = 1\n[limits]\nstale_ticks_max = 8\n"
        "[reactions]\nstale_reply = { running = \"disable\" }\n");
  const Outcome silent =
      Run(gait + " --bus-faults " + Path("silent.toml") + " --faults " + Path("faults.toml"));
  EXPECT_EQ(silent.exit_code, 3);
  EXPECT_THAT(silent.text, HasSubstr("stale reply of joint leg2: 9 ticks, limit 8"));
  EXPECT_THAT(silent.text, HasSubstr("reaction: disable"));
  Write("faults.toml", "format = \"tumbler-faults\"\nversion = 1\n[reactions]\nlate = 1\n");
  const Outcome wrong = Run(gait + " --faults " + Path("faults.toml"));
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.text, HasSubstr("faults.toml:4"));
  const Outcome real = Run("can9 " + Path("motion.toml") + " --drives x.toml" + script);
  EXPECT_EQ(real.exit_code, 1);
  EXPECT_THAT(real.text, HasSubstr("--bus-faults"));
}

TEST_F(TumblerRun, ATorqueThatNoDriveReportsIsNotMeasuredRatherThanZero) {
  const std::string example =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives_cansimple.toml"));
  Write("drives.toml", testing::ReplacedAll(example, "torques_s = 0.01\n", ""));
  const Outcome outcome =
      Run("sim " + testing::SourcePath("primitives/nominal/handstand.toml") + " --drives " +
          Path("drives.toml") + " --json " + Path("run.json") + " --csv " + Path("run.csv"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("leg1: torque not measured, following error at most"));
  const Json json = Json::Parse(testing::ReadFile(Path("run.json"))).value();
  EXPECT_TRUE(json["joints"][0]["peak_torque_nm"].is_null());
  const std::string csv = testing::ReadFile(Path("run.csv"));
  EXPECT_THAT(csv, Not(HasSubstr("nan")));

  Write("drives.toml", example);
  const Outcome measured = Run("sim " + testing::SourcePath("primitives/nominal/handstand.toml") +
                               " --drives " + Path("drives.toml") + " --json " + Path("run.json"));
  EXPECT_THAT(measured.text, HasSubstr("leg1: peak torque "));
  const Json figures = Json::Parse(testing::ReadFile(Path("run.json"))).value();
  EXPECT_GT(figures["joints"][0]["peak_torque_nm"].number(), 0.1);
}

TEST_F(TumblerRun, AFaultInTheHoldAtTheEndIsReportedAndTheRunEndsInTime) {
  Write("late.toml",
        "format = \"tumbler-bus-faults\"\nversion = 1\n[[fault]]\nkind = \"disconnect\"\n"
        "node = \"leg1\"\nstart_s = 4.5\nduration_s = 0.03\n");
  const Outcome outcome =
      Run("sim " + testing::SourcePath("primitives/nominal/handstand.toml") + " --drives " +
          testing::SourcePath("primitives/robots/tumbler_drives.toml") + " --bus-faults " +
          Path("late.toml"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("stale reply of joint leg1"));
}

TEST_F(TumblerRun, EndsInOrderWhenItIsTerminatedOrSuspendedOrItsTerminalIsGone) {
  Write("drives.toml",
        Replaced(testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")),
                 "rate_hz = 1000.0", "rate_hz = 200.0"));
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGTSTP}) {
    testing::InSteadyTime([&] {
      const std::string trace = Path("trace.csv");
      std::filesystem::remove(trace);
      testing::Program run({testing::ProgramPath("tumbler run"), "sim",
                            testing::SourcePath("primitives/nominal/handstand.toml"), "--drives",
                            Path("drives.toml"), "--realtime", "--hold-s", "60", "--end",
                            "torque-off", "--csv", trace});
      ASSERT_TRUE(testing::Eventually([&] {
        return std::filesystem::exists(trace) && std::filesystem::file_size(trace) > 20'000;
      }));
      run.Signal(signal);
      EXPECT_EQ(run.Wait(), 130) << signal << run.text();
      EXPECT_THAT(run.text(), HasSubstr("stopped by the operator"));
    });
  }
}

TEST_F(TumblerRun, SaysWhatCtrlCDoesInTheHoldAtTheEndAndNeverLosesOne) {
  Write("drives.toml",
        Replaced(testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")),
                 "rate_hz = 1000.0", "rate_hz = 200.0"));
  testing::InSteadyTime([&] {
    testing::Program run({testing::ProgramPath("tumbler run"), "sim",
                          testing::SourcePath("primitives/nominal/handstand.toml"), "--drives",
                          Path("drives.toml"), "--realtime", "--hold-s", "0"});
    ASSERT_TRUE(run.WaitFor("the robot is held where it would drop without torque"));
    run.Signal(SIGINT);
    ASSERT_TRUE(run.WaitFor("the robot is still held, and the next Ctrl-C takes the torque off"))
        << run.text();
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    run.Signal(SIGINT);
    // Whether the robot could be judged by then is a matter of time.
    EXPECT_THAT(run.Wait(), AnyOf(0, 4)) << run.text();
    EXPECT_THAT(run.text(), HasSubstr("completed"));
  });
}

TEST_F(TumblerRun, OfASimulationInRealTimeSaysAtOnceWhatEndsItAndWhetherItsFilesGrow) {
  const std::string grow = "; the files of the run grow until then";
  std::vector<std::string> arguments = {testing::ProgramPath("tumbler run"), "sim",
                                        testing::SourcePath("primitives/nominal/handstand.toml"),
                                        "--realtime"};
  const std::string note =
      "it is held at the end until Ctrl-C or `tumbler ctl disarm` (--end "
      "torque-off does without)";
  {
    testing::Program run(arguments);
    ASSERT_TRUE(run.WaitFor(note + "\n")) << run.text();
  }
  arguments.insert(arguments.end(), {"--csv", Path("run.csv")});
  testing::Program run(arguments);
  ASSERT_TRUE(run.WaitFor(note + grow)) << run.text();
  EXPECT_THAT(run.text(), Not(HasSubstr("the motion is over")));
}

TEST_F(TumblerRun, HoldsTheRobotAlsoWhenNobodyReadsWhatItSays) {
  Write("drives.toml",
        Replaced(testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")),
                 "rate_hz = 1000.0", "rate_hz = 200.0"));
  testing::InSteadyTime([&] {
    // What the program says when the hold begins finds nobody who reads: its reader ends with the
    // last line that comes before the run. One who ends earlier may end the program.
    const std::string said = Path("said");
    const Outcome outcome = testing::RunInShell(
        "rm -f " + said + "; mkfifo " + said + "; grep -q 'held at the end' " + said +
        " & tumbler run sim " + testing::SourcePath("primitives/nominal/handstand.toml") +
        " --drives " + Path("drives.toml") + " --realtime --hold-s 0 --json " + Path("run.json") +
        " >/dev/null 2>" + said +
        " & run=$!; sleep 8; kill -TERM $run; sleep 1; "
        "kill -TERM $run; wait $run; echo status $?");
    EXPECT_THAT(outcome.text, HasSubstr("status 0"));
    EXPECT_THAT(testing::ReadFile(Path("run.json")), HasSubstr("completed"));
  });
}

TEST_F(TumblerRun, TakesNoFileForAnAddressOfLcm) {
  Write("precious.txt", "precious");
  for (const std::string& url :
       {"file://" + Path("precious.txt") + "?mode=w", std::string("memq://"), std::string("x")}) {
    const Outcome outcome = Run("sim " + Path("motion.toml") + " --lcm-url '" + url + "'");
    EXPECT_EQ(outcome.exit_code, 1) << url;
    EXPECT_THAT(outcome.text, ::testing::AllOf(HasSubstr("--lcm-url: "), HasSubstr("udpm://")));
    for (const char* const program : {"tumbler ctl status", "tumbler view"}) {
      const std::string command = fmt::format("{} --lcm-url '{}'", program, url);
      EXPECT_EQ(testing::RunInShell(command).exit_code, 1) << command;
    }
  }
  EXPECT_EQ(testing::ReadFile(Path("precious.txt")), "precious");
}

TEST_F(TumblerRun, NamesAPrimitiveThatIsMissingOrBroken) {
  Outcome outcome = Run("can9 " + Path("absent.toml"));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("absent.toml"));
  Write("broken.toml", "format = 3\n");
  outcome = Run("can9 " + Path("broken.toml"));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("broken.toml:1"));
}

TEST_F(TumblerRun, NeedsADriveFileOnARealBus) {
  const Outcome outcome = Run("can9 " + Path("motion.toml"));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("--drives"));
}

TEST_F(TumblerRun, NamesAnInterfaceThatIsNotThereAndADryRunDoesWithout) {
  WriteDrives();
  const Outcome armed = RunOnMissingInterface(" --arm --without-realtime");
  EXPECT_EQ(armed.exit_code, 1) << armed.text;
  EXPECT_THAT(armed.text, HasSubstr("can9"));
  EXPECT_THAT(armed.text, HasSubstr("bus schedule: 2 setpoints of 8 bytes, 2 replies of 8 bytes: "
                                    "540 bits a tick"));
  EXPECT_THAT(armed.text, Not(HasSubstr("can9 001#"))) << "no frame is printed";
  const Outcome dry = RunOnMissingInterface();
  EXPECT_EQ(dry.exit_code, 0) << dry.text;
  EXPECT_THAT(dry.text, HasSubstr("note: interface 'can9' cannot be found"));
  EXPECT_THAT(dry.text, HasSubstr("can9 001#")) << "its frames are printed all the same";
}

TEST_F(TumblerRun, DrivesNoMotorsWithoutRealTimeUnlessThatIsGivenUp) {
  WriteDrives();
  const Outcome refused = RunOnMissingInterface(" --arm");
  EXPECT_EQ(refused.exit_code, 2) << refused.text;
  EXPECT_THAT(refused.text, HasSubstr("driving motors takes --realtime (or --without-realtime"));
  const Outcome accepted = RunOnMissingInterface(" --arm --without-realtime");
  EXPECT_EQ(accepted.exit_code, 1) << "there is no such interface";
  EXPECT_THAT(accepted.text, Not(HasSubstr("driving motors takes")));
}

TEST_F(TumblerRun, TellsNoFiguresOfWhatNobodyMeasured) {
  WriteDrives();
  const std::string json = " --json " + Path("run.json");
  const auto figures = [&](const char* key) {
    return Json::Parse(testing::ReadFile(Path("run.json"))).value()["joints"][0][key].is_null();
  };
  const Outcome dry = RunOnMissingInterface(json);
  EXPECT_EQ(dry.exit_code, 0) << dry.text;
  EXPECT_THAT(dry.text, HasSubstr(" frames would be sent, and none was;"));
  for (const char* imagined : {"torque", "following error", "wake-up", "frame age"})
    EXPECT_THAT(dry.text, Not(HasSubstr(imagined)));
  EXPECT_TRUE(figures("peak_torque_nm"));
  EXPECT_TRUE(figures("following_error_max_rad"));

  Write("silent.toml",
        "format = \"tumbler-bus-faults\"\nversion = 1\n[[fault]]\nkind = \"loss\"\n"
        "node = \"host\"\n");
  const Outcome silent = Run("sim " + testing::SourcePath("primitives/nominal/handstand.toml") +
                             " --bus-faults " + Path("silent.toml") + json);
  EXPECT_EQ(silent.exit_code, 2) << silent.text;
  EXPECT_THAT(silent.text, HasSubstr("a drive does not reply (joint leg1: never)"));
  EXPECT_THAT(silent.text, HasSubstr("leg1: torque not measured, following error not measured"));
  EXPECT_TRUE(figures("following_error_max_rad"));
}

TEST_F(TumblerRun, RefusesADriveFileThatLacksAJoint) {
  WriteDrives("\"joint2\"", "\"other2\"");
  const Outcome outcome = RunOnMissingInterface();
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("no drive for joint 'joint2'"));
}

TEST_F(TumblerRun, RejectsARateThatTheBusCannotCarry) {
  WriteDrives("rate_hz = 1000.0", "rate_hz = 1900.0");
  const Outcome outcome = RunOnMissingInterface();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("drives.toml"));
  EXPECT_THAT(outcome.text, HasSubstr("rate_hz"));
}

TEST_F(TumblerRun, RefusesARateThatLeavesNoRoomForAnErrorAndShowsTheArithmetic) {
  WriteDrives("rate_hz = 1000.0", "rate_hz = 1500.0");
  const Outcome outcome = RunOnMissingInterface();
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("540 bits a tick at worst; at 1500 Hz 81.0 % of 1000000"));
  EXPECT_THAT(outcome.text, HasSubstr("allowed 76.5 %"));
  EXPECT_THAT(outcome.text, HasSubstr("lower rate_hz to at most 1416"));
}

TEST_F(TumblerRun, RefusesAWatchdogThatDoesNotBearThreeTicks) {
  WriteDrives("rate_hz = 1000.0", "rate_hz = 25.0");
  const Outcome outcome = Run("sim " + Path("motion.toml") + " --drives " + Path("drives.toml"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text,
              HasSubstr("joint joint1: watchdog_s is 0.025, but a tick takes 0.04 s"));
  EXPECT_THAT(outcome.text, HasSubstr("at least three ticks, 0.12 s"));
}

TEST_F(TumblerRun, DoesNotArmADriveWithoutAWatchdogUnlessTold) {
  WriteDrives("watchdog_s = 0.025 ", "watchdog_s = 0 ");
  const Outcome refused = RunOnMissingInterface(" --arm --without-realtime");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.text, HasSubstr("joint joint1: the drive has no watchdog"));
  const Outcome accepted = RunOnMissingInterface(" --arm --without-realtime --without-watchdog");
  EXPECT_EQ(accepted.exit_code, 1) << "there is no such interface";
  EXPECT_THAT(accepted.text, Not(HasSubstr("watchdog")));
  EXPECT_THAT(RunOnMissingInterface().text, Not(HasSubstr("watchdog")))
      << "a dry run drives nothing";
}

TEST_F(TumblerRun, RefusesAMotionBeyondTheRangesOfADrive) {
  WriteDrives("position_rad = [-12.5, 12.5]", "position_rad = [-0.1, 0.1]");
  const Outcome outcome = RunOnMissingInterface();
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("joint joint1: the motion's position limit"));
}

}  // namespace
}  // namespace tumbler
