// tumbler-run on the simulated robot of a twin file, and tumbler-twin where it needs no interface,
// as a user meets them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <random>
#include <string>
#include <tumbler/truth_t.hpp>
#include <vector>

#include "common/json.h"
#include "common/primitive_toml.h"
#include "offline/rehearsal/sim/simulated_world.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/linux/interrupts.h"
#include "runtime/run/play.h"
#include "tests/support/example_drives.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const std::string kPrimitives = testing::SourcePath("primitives/");
const std::string kHead = "format = \"tumbler-twin\"\nversion = 1\n";

class SimTwin : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] std::string Write(const std::string& name, const std::string& text) const {
    testing::WriteFile(Path(name), text);
    return Path(name);
  }
  struct Outcome : testing::Outcome {
    Json json;
  };
  /// Runs the gait in virtual time.
  [[nodiscard]] Outcome RunGait(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"tumbler-run", "sim", kPrimitives + "gait.toml", "--json",
                                       Path("run.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }
  [[nodiscard]] Outcome RunTwin(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"tumbler-twin"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }

 private:
  [[nodiscard]] Outcome Run(const std::vector<std::string>& arguments) const {
    std::filesystem::remove(Path("run.json"));
    Outcome outcome{testing::RunProgram(arguments), {}};
    if (std::filesystem::exists(Path("run.json"))) {
      outcome.json = Json::Parse(testing::ReadFile(Path("run.json"))).value();
    }
    return outcome;
  }
  testing::TemporaryFolder folder_;
};

constexpr const char* kPushedOver =
    "[[push]]\nlink = \"middle\"\nstart_s = 3.5\nduration_s = 0.2\nforce_n = [8.0, 0.0]\n";

/// The shipped handstand, signed after a change.
std::string ChangedHandstand(const std::string& from, const std::string& to) {
  const std::string text = testing::ReadFile(kPrimitives + "handstand.toml");
  return SignEdited(testing::Replaced(text, from, to), "handstand.toml", "a test");
}

TEST_F(SimTwin, ARobotThatDoesAsPlannedButNotAsAskedDoesNotStand) {
  const std::string other =
      Write("other.toml", ChangedHandstand("when = \"later\"\ntarget = 1.5707963267948966",
                                           "when = \"later\"\ntarget = 0.5"));
  const testing::Outcome run = testing::RunProgram({"tumbler-run", "sim", other});
  EXPECT_EQ(run.exit_code, 4) << run.text;
  EXPECT_THAT(run.text, HasSubstr("NOT standing as asked"));
  EXPECT_THAT(run.text, HasSubstr("    pitch, 2 s later: asked 0.5, got 1.57"));
  EXPECT_THAT(run.text, HasSubstr("rad (within 0.05): MISSED"));
  EXPECT_THAT(run.text, Not(HasSubstr("still standing")));
  const testing::Outcome shipped =
      testing::RunProgram({"tumbler-run", "sim", kPrimitives + "handstand.toml"});
  EXPECT_EQ(shipped.exit_code, 0);
  EXPECT_THAT(shipped.text, HasSubstr("still standing"));
}

TEST_F(SimTwin, TheGaitStandsWithEveryProtocol) {
  for (const testing::ExampleDrives& drives : testing::ExampleOfEveryProtocol()) {
    const Outcome outcome =
        RunGait({"--cycles", "5", "--branch", "roll", "--drives", testing::SourcePath(drives.file),
                 "--twin", kPrimitives + "robots/tumbler_twin.toml"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr("12 motions, 5 complete cycles; the robot where it should"))
        << drives.protocol;
    EXPECT_EQ(outcome.json["falls"].size(), 0U);
  }
}

TEST_F(SimTwin, APushThatIsWeakIsSurvivedAndOneThatFellsTheRobotIsToldInWordsJsonAndExitCode) {
  std::string text = kHead + kPushedOver;
  const Outcome fell = RunGait({"--cycles", "2", "--twin", Write("twin.toml", text)});
  EXPECT_EQ(fell.exit_code, 4);
  EXPECT_THAT(fell.text, HasSubstr("s the robot FELL: rests in a pose that no motion begins or"));
  ASSERT_GE(fell.json["falls"].size(), 1U);
  EXPECT_GT(fell.json["falls"][0]["time_s"].number(), 3.5);
  EXPECT_LT(fell.json["falls"][0]["time_s"].number(), 5.5);
  EXPECT_EQ(fell.json["exit_code"], 4);

  text.replace(text.find("8.0"), 3, "1.0");
  const Outcome stood = RunGait({"--cycles", "2", "--twin", Write("twin.toml", text)});
  EXPECT_EQ(stood.exit_code, 0) << stood.text;
  EXPECT_EQ(stood.json["falls"].size(), 0U);
}

TEST_F(SimTwin, APuddleUnderTheFeetFellsTheRobot) {
  const std::string puddle =
      "[[patch]]\nobstacle = \"ground\"\nfrom_x_m = -1\nto_x_m = 1\nmu = 0.02\n";
  const Outcome outcome = RunGait({"--cycles", "1", "--twin", Write("twin.toml", kHead + puddle)});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_GE(outcome.json["falls"].size(), 1U);
}

TEST_F(SimTwin, DrivesOfTheTwinFileAreTakenWhereNoneAreGiven) {
  const std::string twin = Write(
      "twin.toml", kHead + "drives = \"" + kPrimitives + "robots/tumbler_drives_cia402.toml\"\n");
  const Outcome outcome = RunGait({"--cycles", "1", "--twin", twin});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("SYNC"));
  const Outcome given = RunGait(
      {"--cycles", "1", "--twin", twin, "--drives", kPrimitives + "robots/tumbler_drives.toml"});
  EXPECT_THAT(given.text, Not(HasSubstr("SYNC")));
}

TEST_F(SimTwin, AMotorThatHeatsUpEndsTheRunWhenItsDriveSaysSo) {
  const std::string hot = "[motor.leg2]\nheating_k_per_nm2 = 500\nthermal_time_constant_s = 1\n";
  const Outcome outcome = RunGait({"--cycles", "1", "--twin", Write("twin.toml", kHead + hot)});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.text, HasSubstr("over-temperature of joint leg2"));
}

TEST_F(SimTwin, TheTruthIsWrittenAsAnLcmLogOfItsOwn) {
  const std::string path = Path("truth.lcm");
  const Outcome outcome = RunGait(
      {"--cycles", "1", "--truth", path, "--twin", Write("twin.toml", kHead + kPushedOver)});
  EXPECT_THAT(outcome.text, HasSubstr("wrote " + path));
  lcm::LogFile log(path, "r");
  ASSERT_TRUE(log.good());
  bool held = false, upright = false, pushed = false, fell = false, touched = false;
  std::int64_t last_ns = -1;
  int count = 0;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    EXPECT_EQ(event->channel, "TUMBLER_TRUTH");
    truth_t truth;
    ASSERT_GT(truth.decode(event->data, 0, event->datalen), 0);
    EXPECT_GT(truth.time_ns, last_ns);
    last_ns = truth.time_ns;
    EXPECT_EQ(event->timestamp, truth.time_ns / 1000);
    ASSERT_EQ(truth.joint_count, 2);
    EXPECT_EQ(truth.joints[1].name, "leg2");
    EXPECT_GE(truth.joints[1].temperature_c, 25);
    held = held || truth.held != 0;
    upright = upright || truth.resting_as == "as after handstand";
    if (truth.resting_as == "as after handstand") {
      EXPECT_NEAR(truth.root_pitch_rad, M_PI / 2, 0.05);
    }
    pushed = pushed || truth.push_x_n == 8;
    fell = fell || truth.fallen != 0;
    for (const contact_truth_t& contact : truth.contacts) {
      touched = touched || (contact.link == "leg2_link" && contact.obstacle == "ground" &&
                            contact.normal_force_n > 1);
    }
    ++count;
  }
  EXPECT_TRUE(held && upright && pushed && fell && touched)
      << held << upright << pushed << fell << touched;
  EXPECT_NEAR(count, static_cast<double>(last_ns) / 5e6, 2) << "200 a second";
}

TEST_F(SimTwin, WrongFilesAndOptionsAreRefusedWithWhatToDo) {
  Outcome outcome = RunGait(
      {"--cycles", "1", "--twin", Write("twin.toml", kHead + "[motor]\ntorque_max_nm = 0\n")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("twin.toml:4: motor.torque_max_nm: is 0; allowed: "));
  outcome = RunGait({"--cycles", "1", "--twin", Path("absent.toml")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("absent.toml"));
  outcome = RunGait({"--cycles", "1", "--truth", "/nonexistent/truth.lcm"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("/nonexistent/truth.lcm: cannot be written"));
  outcome = RunGait({"--cycles", "1", "--pace", "0.5"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("--pace is for an armed run on tumbler-twin"));
}

TEST_F(SimTwin, TumblerTwinSaysWhichFileItLacks) {
  Outcome outcome = RunTwin({"vcan9"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("which motion? Give MOTION, or a --config file"));
  outcome = RunTwin({"vcan9", kPrimitives + "gait.toml"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("which drives? Give --drives, or a --config file"));
  outcome = RunTwin({"vcan9", "--config", kPrimitives + "robots/tumbler_twin.toml"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("vcan9")) << "the file names both";
  outcome = RunTwin({"vcan9", "--config", kPrimitives + "robots/tumbler_drives.toml"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("tumbler_drives.toml:2: format: is 'tumbler-drives'"));
  outcome = RunTwin({"--help"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.text, HasSubstr("Exit codes:"));
}

/// Runs the shipped gait in virtual time with an interrupt at a tick. @returns what became of it.
RunSummary Interrupted(std::int64_t at_tick) {
  RunParts parts = LoadRunMotion(testing::SourcePath("primitives/gait.toml"));
  parts.drives = LoadDrivesOf(JointsOf(parts.file), "", {});
  Assembly assembly(std::move(parts));
  RunSettings settings;
  settings.cycles = 100;
  settings.hold_s = 0.1;
  EXPECT_EQ(assembly.Configure(ExecutorConfigOf(settings, assembly.parts().drives)), Status::kOk);
  const std::unique_ptr<World> world =
      MakeSimulation().make_world(assembly.parts().file, assembly.parts().drives, {});
  Play play(assembly, *world, {});
  play.Run(ProcedureConfigOf(settings, assembly.parts().drives), 1'000'000,
           [at_tick](const ControlLoop& loop) {
             if (loop.statistics().ticks == at_tick)
               InterruptMailbox().Put({0, OperatorRequest::kFinish, -1, true});
           });
  RunSummary summary;
  summary.outcome = play.procedure().outcome();
  world->Summarize(summary);
  return summary;
}

TEST_F(SimTwin, AnInterruptAtAnyTimeEndsTheRunWhereTheRobotStaysWithoutTorque) {
  std::mt19937 random(12);
  for (int i = 0; i < 30; ++i) {
    const std::int64_t tick = std::uniform_int_distribution<std::int64_t>(20, 9000)(random);
    const RunSummary summary = Interrupted(tick);
    EXPECT_EQ(summary.outcome, RunOutcome::kStopped) << "tick " << tick;
    EXPECT_TRUE(summary.falls.empty()) << "tick " << tick;
    EXPECT_THAT(summary.after_torque_off, ::testing::StartsWith("stays")) << "tick " << tick;
  }
}

}  // namespace
}  // namespace tumbler
