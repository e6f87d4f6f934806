// tumbler run on the simulated robot of a twin file, and tumbler twin where it needs no interface,
// as a user meets them.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tumbler/truth_t.hpp>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "offline/problem/link_chains.h"
#include "offline/twin/simulated_robot.h"
#include "offline/twin/simulated_world.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/clock.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/assembly/operator_mailbox.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/run/control_loop.h"
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
    std::vector<std::string> arguments{"tumbler run", "sim", kPrimitives + "gait.toml", "--json",
                                       Path("run.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }
  [[nodiscard]] Outcome RunTwin(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"tumbler twin"};
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
    "[[push]]\nlink = \"middle\"\nstart_s = 3.0\nduration_s = 0.2\nforce_n = [8.0, 0.0]\n";

/// The nominal handstand, signed after a change.
std::string ChangedHandstand(const std::string& from, const std::string& to) {
  const std::string text = testing::ReadFile(kPrimitives + "nominal/handstand.toml");
  return SignEdited(testing::Replaced(text, from, to), "handstand.toml", "a test");
}

TEST_F(SimTwin, ARobotThatDoesAsPlannedButNotAsAskedDoesNotStand) {
  // Its plan ends at 1.57076 rad, which is within the tolerance by a hair, and the robot just not.
  const std::string other =
      Write("other.toml", ChangedHandstand("when = \"later\"\ntarget = 1.5707963267948966",
                                           "when = \"later\"\ntarget = 1.6203"));
  const testing::Outcome run = testing::RunProgram({"tumbler run", "sim", other});
  EXPECT_EQ(run.exit_code, 4) << run.text;
  EXPECT_THAT(run.text, HasSubstr("NOT at rest as asked"));
  EXPECT_THAT(run.text, HasSubstr("    pitch, 2 s later: asked 1.6203, got 1.5697"));
  EXPECT_THAT(run.text, HasSubstr("rad (within 0.05): MISSED"));
  EXPECT_THAT(run.text, Not(HasSubstr(": at rest as asked")));
  const testing::Outcome shipped =
      testing::RunProgram({"tumbler run", "sim", kPrimitives + "nominal/handstand.toml"});
  EXPECT_EQ(shipped.exit_code, 0);
  EXPECT_THAT(shipped.text, HasSubstr(": at rest as asked"));
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

TEST_F(SimTwin, TheGaitStandsWithAnAkV3DriveInOneLegAndAnotherProtocolInTheOther) {
  const auto drive_of = [](const std::string& text, int number) {
    std::size_t begin = text.find("[[drive]]");
    if (number == 1) begin = text.find("[[drive]]", begin + 1);
    return text.substr(begin, text.find("[[drive]]", begin + 1) - begin);
  };
  constexpr double kRate_hz = 500;  // AK V3 drives report no more often.
  std::string ak;
  for (const testing::ExampleDrives& drives : testing::ExampleOfEveryProtocol()) {
    if (drives.protocol == "akv3") ak = testing::ReadFile(testing::SourcePath(drives.file));
  }
  for (const testing::ExampleDrives& drives : testing::ExampleOfEveryProtocol()) {
    if (drives.protocol == "akv3") continue;
    const std::string other =
        testing::AtRate(testing::ReadFile(testing::SourcePath(drives.file)), kRate_hz);
    const std::string head = other.substr(0, other.find("[[drive]]"));
    for (const std::string& mixed : {head + drive_of(other, 0) + drive_of(ak, 1),
                                     head + drive_of(ak, 0) + drive_of(other, 1)}) {
      const std::string file = Write("mixed.toml", mixed);
      const Outcome outcome = RunGait({"--cycles", "2", "--branch", "roll", "--drives", file});
      EXPECT_THAT(outcome.text, HasSubstr("completed: gait on sim"));
      EXPECT_EQ(outcome.json["falls"].size(), 0U);
      // At this rate a leg with CiA 402 lags by up to 57 mrad more than the other one.
      EXPECT_EQ(outcome.exit_code, 0) << drives.protocol << outcome.text;
      EXPECT_THAT(outcome.text, HasSubstr("2 complete cycles; the robot where it should"));
    }
  }
}

TEST_F(SimTwin, APushThatIsWeakIsSurvivedAndOneThatFellsTheRobotIsToldInWordsJsonAndExitCode) {
  std::string text = kHead + kPushedOver;
  const Outcome fell = RunGait({"--cycles", "2", "--twin", Write("twin.toml", text)});
  EXPECT_EQ(fell.exit_code, 4);
  EXPECT_THAT(fell.text, HasSubstr("s the robot FELL: rests in a pose that no motion begins or"));
  ASSERT_GE(fell.json["falls"].size(), 1U);
  EXPECT_GT(fell.json["falls"][0]["time_s"].number(), 3.0);
  EXPECT_LT(fell.json["falls"][0]["time_s"].number(), 5.0);
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
  outcome = RunGait({"--cycles", "1", "--truth", "/proc/nonexistent/truth.lcm"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("/proc/nonexistent/truth.lcm: cannot be written"));
  outcome = RunGait({"--cycles", "1", "--pace", "0.5"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("--pace is for an armed run on tumbler twin"));
}

TEST_F(SimTwin, TumblerTwinSaysWhichFileItLacks) {
  Outcome outcome = RunTwin({"vcan9"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("which motion? Give MOTION, or a --twin file"));
  outcome = RunTwin({"vcan9", kPrimitives + "nominal/gait.toml"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("which drives? Give --drives, or a --twin file"));
  outcome = RunTwin({"vcan9", "--twin", kPrimitives + "robots/tumbler_twin.toml"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("vcan9")) << "the file names both";
  outcome = RunTwin({"vcan9", "--twin", kPrimitives + "robots/tumbler_drives.toml"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("tumbler_drives.toml:2: format: is 'tumbler-drives'"));
  outcome = RunTwin({"--help"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.text, HasSubstr("Exit codes:"));
}

/// A run of a shipped motion in virtual time, through the shipped assembly.
struct Rehearsed {
  RunSummary summary;
  Fault fault = Fault::kNone;  // the first one
  std::int64_t ticks = 0;
};
Rehearsed Rehearse(const std::string& motion, RunSettings settings,
                   const std::function<void(const ControlLoop&)>& each,
                   const SimulatedWorldConfig& world_config = {}, const std::string& drives = "") {
  RunParts parts = LoadRunMotion(testing::SourcePath("primitives/" + motion));
  parts.drives = LoadDrivesOf(JointsOf(parts.file), drives, ReadTextFile);
  Assembly assembly(std::move(parts));
  settings.hold_s = 0.1;
  EXPECT_EQ(assembly.Configure(ExecutorConfigOf(settings, assembly.parts().drives)), Status::kOk);
  const std::unique_ptr<World> world =
      MakeSimulation().make_world(assembly.parts().file, assembly.parts().drives, world_config);
  TickFeed feed;
  Play play(assembly, *world, feed);
  play.Run(ProcedureConfigOf(settings, assembly.parts().drives, assembly.parts().sequence->graph),
           1'000'000, each);
  Rehearsed run;
  run.summary.outcome = play.procedure().outcome();
  run.fault = play.loop().record().first_fault.fault;
  run.ticks = play.loop().statistics().ticks;
  world->Summarize(run.summary);
  return run;
}

void ExpectHome(const Rehearsed& run) {
  EXPECT_TRUE(run.summary.falls.empty());
  EXPECT_THAT(run.summary.after_torque_off, ::testing::StartsWith("stays"));
}

/// Each of ten seeds interrupts ten runs, in ten parts of the gait: a hundred times in all.
/// A sequence with its drives (none: those of the simulation), and the seed of the interrupts.
struct Interrupts {
  std::string name;
  std::string motion;
  std::string drives;
  unsigned seed = 0;
};
std::vector<Interrupts> InterruptsOfBothGaits() {
  std::vector<Interrupts> all;
  for (unsigned seed = 0; seed < 10; ++seed)
    all.push_back({"nominal_gait_" + std::to_string(seed), "nominal/gait.toml", "", seed});
  for (unsigned seed = 0; seed < 2; ++seed) {
    const std::string gait = seed == 0 ? "gait" : "cartwheel";
    all.push_back({gait + "_" + std::to_string(seed), gait + ".toml", "", seed});
  }
  return all;
}
class SimTwinInterrupted : public SimTwin, public ::testing::WithParamInterface<Interrupts> {};

TEST_P(SimTwinInterrupted, AtAnyTimeNoRobotIsDropped) {
  constexpr int kInterrupts = 10;
  constexpr std::int64_t kTwoCycles = 17000;  // ticks, both roles of the legs
  std::mt19937 random(GetParam().seed);
  std::array<int, kExecutorStateCount> interrupted{};
  for (int i = 0; i < kInterrupts; ++i) {
    const std::int64_t from = 2 + (kTwoCycles - 2) * i / kInterrupts;
    const std::int64_t to = 2 + (kTwoCycles - 2) * (i + 1) / kInterrupts;
    const std::int64_t tick = std::uniform_int_distribution<std::int64_t>(from, to - 1)(random);
    SCOPED_TRACE("interrupted at tick " + std::to_string(tick));
    RunSettings settings;
    settings.cycles = 100;
    ExecutorState state{};
    const auto interrupt = [&](const ControlLoop& loop) {
      if (loop.statistics().ticks != tick) return;
      state = loop.record().state;
      InterruptMailbox().Put({0, OperatorRequest::kFinish, -1, true});
    };
    const Rehearsed run = Rehearse(GetParam().motion, settings, interrupt, {}, GetParam().drives);
    ++interrupted[static_cast<std::size_t>(state)];
    EXPECT_EQ(run.summary.outcome, RunOutcome::kStopped);
    ExpectHome(run);
  }
  EXPECT_GE(interrupted[static_cast<std::size_t>(ExecutorState::kRunning)], 1);
  EXPECT_GE(interrupted[static_cast<std::size_t>(ExecutorState::kSettling)], 3);
}
INSTANTIATE_TEST_SUITE_P(Seeds, SimTwinInterrupted, ::testing::ValuesIn(InterruptsOfBothGaits()),
                         [](const auto& given) { return given.param.name; });

TEST_F(SimTwin, AnInterruptInTheFirstStatesLeavesTheRobotWhereItStood) {
  for (const ExecutorState wanted :
       {ExecutorState::kArming, ExecutorState::kHolding, ExecutorState::kMovingToStart}) {
    SCOPED_TRACE(ToString(wanted));
    RunSettings settings;
    settings.cycles = 100;
    bool sent = false;
    const Rehearsed run = Rehearse("gait.toml", settings, [&](const ControlLoop& loop) {
      if (sent || loop.record().state != wanted) return;
      sent = true;
      InterruptMailbox().Put({0, OperatorRequest::kFinish, -1, true});
    });
    EXPECT_TRUE(sent);
    EXPECT_EQ(run.summary.outcome, RunOutcome::kStopped);
    ExpectHome(run);
  }
}

TEST_F(SimTwin, ARunOfSomeCyclesEndsAtHomeWithoutTorque) {
  for (const int cycles : {1, 2, 3}) {
    RunSettings settings;
    settings.cycles = cycles;
    const Rehearsed run = Rehearse("gait.toml", settings, {});
    EXPECT_EQ(run.summary.outcome, RunOutcome::kCompleted);
    ExpectHome(run);
  }
}

TEST_F(SimTwin, AfterAFaultInTheHandstandTheRobotGoesHomeBeforeTorqueOff) {
  // No reply is heard for 20 ms, while the robot stands on its hands: a stale reply, and a hold.
  SimulatedWorldConfig world;
  world.bus_faults = Write("faults.toml",
                           "format = \"tumbler-bus-faults\"\nversion = 1\nseed = 1\n"
                           "[[fault]]\nkind = \"loss\"\nnode = \"host\"\nprobability = 1.0\n"
                           "start_s = 3.0\nduration_s = 0.02\n");
  RunSettings settings;
  settings.cycles = 5;
  const Rehearsed run = Rehearse("gait.toml", settings, {}, world);
  EXPECT_EQ(run.summary.outcome, RunOutcome::kFault);
  EXPECT_EQ(run.fault, Fault::kStaleReply);
  ExpectHome(run);
  settings.end = RunEnd::kTorqueOff;
  EXPECT_THAT(Rehearse("gait.toml", settings, {}, world).summary.after_torque_off,
              ::testing::StartsWith("drops"))
      << "where nobody wants it to go home";
}

TEST_F(SimTwin, WhatTheHostDoesNotHearItDoesNotHearBesideASensorEither) {
  const std::string drives = kPrimitives + "robots/tumbler_drives_sensor.toml";
  for (const auto& [node, fault] :
       {std::pair{"host", Fault::kStaleReply}, std::pair{"sensor", Fault::kNone}}) {
    SimulatedWorldConfig world;
    world.bus_faults = Write("faults.toml",
                             "format = \"tumbler-bus-faults\"\nversion = 1\nseed = 1\n"
                             "[[fault]]\nkind = \"loss\"\nnode = \"" +
                                 std::string(node) + "\"\nprobability = 1.0\nstart_s = 3.0\n");
    const Rehearsed run = Rehearse("handstand_sensor.toml", {}, {}, world, drives);
    EXPECT_EQ(run.fault, fault) << node;
  }
}

TEST_F(SimTwin, AfterAFaultInTheFlightTheRobotLandsAsPlannedAndGoesHome) {
  SimulatedWorldConfig world;
  world.bus_faults = Write("faults.toml",
                           "format = \"tumbler-bus-faults\"\nversion = 1\nseed = 1\n"
                           "[[fault]]\nkind = \"loss\"\nnode = \"host\"\nprobability = 1.0\n"
                           "start_s = 0.4\nduration_s = 0.02\n");
  RunSettings settings;
  settings.cycles = 5;
  std::set<Reaction> reactions;
  const std::string drives = kPrimitives + "robots/tumbler_drives.toml";
  const auto note = [&](const ControlLoop& loop) { reactions.insert(loop.record().reaction); };
  const Rehearsed run = Rehearse("gait.toml", settings, note, world, drives);
  EXPECT_EQ(run.summary.outcome, RunOutcome::kFault);
  EXPECT_EQ(run.fault, Fault::kStaleReply);
  EXPECT_TRUE(reactions.contains(Reaction::kRollOut));
  EXPECT_EQ(run.summary.broken_off, "") << "it was played to its end";
  ExpectHome(run);
}

TEST_F(SimTwin, AFaultInAMotionLeavesItUnjudgedAndItsOwnErrorIsTheLargest) {
  const Outcome weak = RunGait(
      {"--cycles", "1", "--twin", Write("weak.toml", kHead + "[motor]\ntorque_max_nm = 4.0\n")});
  EXPECT_EQ(weak.exit_code, 3) << weak.text;
  EXPECT_EQ(weak.json["broken_off"], "handstand");
  EXPECT_TRUE(weak.json["purpose_met"].is_null());
  EXPECT_TRUE(weak.json["as_planned_2_s_later"].is_null());
  EXPECT_EQ(weak.json["passages"].size(), 0U);
  const auto said = testing::MatchesOf("following error of joint leg([12]): ([0-9.]+) rad",
                                       weak.json["reason"].text());
  ASSERT_EQ(said.size(), 1U) << weak.text;
  const Json& joint = weak.json["joints"][said[0][1] == "1" ? 0 : 1];
  EXPECT_GE(joint["following_error_max_rad"].number(), std::stod(said[0][2]) - 1e-4);
}

TEST_F(SimTwin, SaysWhatBecomesOfARobotThatDoesNotStandWithoutTorque) {
  const std::vector<std::pair<RunEnd, std::int64_t>> ends = {{RunEnd::kTorqueOff, 0},
                                                             {RunEnd::kSafe, 2000},
                                                             {RunEnd::kHold, 2000},
                                                             {RunEnd::kLower, 2500}};
  std::int64_t shortest = 0;
  for (const auto& [end, longer] : ends) {
    RunSettings settings;
    settings.end = end;
    const Rehearsed run = Rehearse("handstand.toml", settings, {});
    if (end == RunEnd::kTorqueOff) shortest = run.ticks;
    EXPECT_EQ(run.summary.outcome, RunOutcome::kCompleted);
    EXPECT_EQ(run.ticks - shortest, longer) << static_cast<int>(end);
    EXPECT_TRUE(run.summary.falls.empty()) << "it is let go on purpose";
    EXPECT_THAT(run.summary.after_torque_off, ::testing::MatchesRegex("drops, at 1\\.[4-8].*"))
        << "a robot that balances is not lowered by softer drives";
  }
}

// ---- With an inertial sensor --------------------------------------------------------------------

const std::string kSensorDrives =
    testing::ReadFile(kPrimitives + "robots/tumbler_drives.toml") +
    "\n[sensor]\nprotocol = \"xsens-mti\"\nlink = \"middle\"\ntime_rate_hz = 100\n";

/// The robust handstand with a weak feedback on leg 2, whose plan is what the twin does.
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

std::string HandstandWithFeedback() {
  PrimitiveFile file = LoadPrimitive(kPrimitives + "handstand.toml");
  const std::string motion = kPrimitives + "handstand.toml";
  RunParts parts = LoadRunMotion(motion);
  parts.drives =
      LoadDrivesOf(JointsOf(parts.file), kPrimitives + "robots/tumbler_drives.toml", ReadTextFile);
  const DrivesConfig drives = parts.drives;
  const SimulatedMotion simulated(parts.file);
  SimulatedRobot robot(simulated, drives, {});
  Assembly assembly(std::move(parts));
  EXPECT_EQ(assembly.Configure(ExecutorConfigOf({}, drives)), Status::kOk);
  SimulatedPort& host = robot.bus().Attach();
  VirtualClock clock([&robot](std::int64_t time_ns) { robot.AdvanceTo(time_ns); });
  RunProcedure procedure(ProcedureConfigOf({}, drives, assembly.parts().sequence->graph));
  OperatorMailbox mailbox;
  ControlLoop loop({assembly.executor(), host, clock, procedure, mailbox}, 1'000'000, 0);
  std::vector<double> angles;
  while (loop.Step()) {
    if (loop.record().state != ExecutorState::kRunning) continue;
    const TwinState& truth = robot.state();
    angles.push_back(truth.root_pitch_rad + truth.joint_positions_rad[1]);
  }
  Feedback<double>& feedback = file.primitive.feedback;
  feedback.link = FixedString<32>("leg2_link");
  feedback.knot_count = 3;
  feedback.knots_s = {0, 0.4, file.primitive.duration_s};
  const auto& torque = file.primitive.joints[0].torque;
  std::vector<double> points;
  const int degree = torque.degree();
  for (std::size_t i = 0; i < torque.control_points().size(); ++i) {
    double time_s = 0;  // where this control point has its greatest weight
    for (int k = 1; k <= degree; ++k)
      time_s += torque.knots()[i + static_cast<std::size_t>(k)] / degree;
    const auto tick = static_cast<std::size_t>(time_s * 1000);
    points.push_back(angles[std::min(tick, angles.size() - 1)]);
  }
  EXPECT_EQ(feedback.angle.Assign(degree, torque.knots(), points), Status::kOk);
  feedback.error_max_rad = 0.6;
  feedback.start_error_max_rad = 0.2;
  feedback.fade_in_s = 0.05;
  feedback.fade_out_s = 0.05;
  file.chains = LinkChainsOf(simulated.scene().robot);
  for (std::size_t j = 0; j < 2; ++j) {
    JointFeedback<double>& joint = feedback.joints[j];
    joint.chain = j == 1 ? 1 : 0;
    joint.angle_gain = {0, 0.1, 0.1};
    joint.rate_gain = {0, 0.005, 0.005};
    joint.correction_max_rad = 0.2;
    joint.correction_rate_max_rad_s = 5;
  }
  return ToToml(file);
}

/// Plays it with noise of 5 mrad and 20 mrad/s, 10 mrad of bias and 1 ms of delay.
struct SensorRun {
  int exit_code = 0;
  std::string text;
  std::vector<std::vector<std::string>> rows;  ///< Of the trace.
  std::vector<std::string> header;
  [[nodiscard]] double At(std::size_t row, const std::string& column) const {
    const auto found = std::find(header.begin(), header.end(), column);
    if (found == header.end()) throw std::logic_error(column);
    return std::stod(rows[row][static_cast<std::size_t>(found - header.begin())]);
  }
  [[nodiscard]] double Largest(const std::string& column) const {
    double largest = 0;
    for (std::size_t row = 0; row < rows.size(); ++row)
      largest = std::max(largest, std::abs(At(row, column)));
    return largest;
  }
};

constexpr const char* kNoise =
    "[sensor]\nnoise_rad = 0.005\nrate_noise_rad_s = 0.02\nbias_rad = 0.01\ndelay_s = 0.001\n";

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

SensorRun PlayWithSensor(const std::filesystem::path& folder, const std::string& twin) {
  testing::WriteFile(folder / "handstand.toml", HandstandWithFeedback());
  testing::WriteFile(folder / "drives.toml", kSensorDrives);
  testing::WriteFile(folder / "twin.toml", kHead + twin);
  std::filesystem::remove(folder / "run.rec");
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler run", "sim", folder / "handstand.toml", "--drives",
                           folder / "drives.toml", "--twin", folder / "twin.toml", "--csv",
                           folder / "run.csv", "--record", folder / "run.rec"});
  SensorRun run{outcome.exit_code, outcome.text, {}, {}};
  std::istringstream csv(testing::ReadFile(folder / "run.csv"));
  std::string line;
  std::getline(csv, line);
  run.header = Cells(line);
  while (std::getline(csv, line)) run.rows.push_back(Cells(line));
  return run;
}

TEST_F(SimTwin, AMotionWithFeedbackIsPlayedBySensorAndEncodersAndReplayedBitForBit) {
  const std::filesystem::path folder = std::filesystem::path(Path("x")).parent_path();
  const SensorRun run = PlayWithSensor(folder, kNoise);
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_EQ(run.Largest("feedback_share"), 1);
  EXPECT_LT(run.Largest("feedback_error_rad"), 0.2) << "the plan is what the twin does";
  EXPECT_GT(run.Largest("leg1_correction_rad"), 0.001);
  EXPECT_GT(run.Largest("leg2_correction_rad"), 0.001);
  EXPECT_EQ(run.At(run.rows.size() - 1, "sensor_status"), 1);
  const testing::Outcome replay = testing::RunProgram({"tumbler replay", folder / "run.rec"});
  EXPECT_EQ(replay.exit_code, 0) << replay.text;
  EXPECT_THAT(replay.text, HasSubstr("identical"));
}

TEST_F(SimTwin, EveryFailureOfTheSensorIsSeenAndTheMotionGoesOn) {
  const std::filesystem::path folder = std::filesystem::path(Path("x")).parent_path();
  const std::vector<std::pair<std::string, double>> failures = {
      {"silent", 3}, {"frozen", 5}, {"offset", 9}, {"swapped-axis", 9}, {"late", 4}};
  for (const auto& [fault, status] : failures) {
    const SensorRun run =
        PlayWithSensor(folder, std::string(kNoise) + "[[sensor_failure]]\nfault = \"" + fault +
                                   "\"\nstart_s = 0.3\nsince = \"start\"\noffset_rad = 0.3\n");
    EXPECT_EQ(run.exit_code, 0) << fault << run.text;
    EXPECT_EQ(run.At(run.rows.size() - 1, "sensor_status"), status) << fault;
    EXPECT_EQ(run.At(run.rows.size() - 1, "feedback_share"), 0) << fault;
  }
}

// Its gains are those that a wrong angle before the jump would fell the robot with.
TEST_F(SimTwin, TheShippedHandstandStandsWhenItsSensorsAxesAreExchangedOrItFreezesBeforeTheJump) {
  const std::string errors = testing::ReadFile(kPrimitives + "robots/tumbler_twin_sensor.toml");
  for (const char* fault : {"swapped-axis", "frozen"}) {
    for (const char* start_s : {"0.1", "0.15", "0.2", "0.25", "0.3", "0.4", "0.5"}) {
      const std::string twin = Write("twin.toml", errors + "[[sensor_failure]]\nfault = \"" +
                                                      fault + "\"\nstart_s = " + start_s + "\n");
      const testing::Outcome outcome = testing::RunProgram(
          {"tumbler run", "sim", kPrimitives + "handstand_sensor.toml", "--drives",
           kPrimitives + "robots/tumbler_drives_sensor.toml", "--twin", twin});
      EXPECT_EQ(outcome.exit_code, 0) << fault << " at " << start_s << outcome.text;
    }
  }
}

// Pushed over in its second handstand. Only the simulation knows of the push.
constexpr const char* kPushedOverLater =
    "[[push]]\nlink = \"middle\"\nstart_s = 9.5\nduration_s = 0.2\nforce_n = [25.0, 0.0]\n";

TEST_F(SimTwin, ARobotThatIsPushedOverGetsUpFinishesItsCyclesAndIsReplayedBitForBit) {
  const std::string sensor = testing::ReadFile(kPrimitives + "robots/tumbler_twin_sensor.toml");
  const std::string twin = Write("twin.toml", sensor + kPushedOverLater);
  const auto run = [&](const std::string& get_ups) {
    std::filesystem::remove(Path("run.json"));
    std::filesystem::remove(Path("run.rec"));
    const testing::Outcome outcome = testing::RunProgram(
        {"tumbler run", "sim", kPrimitives + "gait_sensor.toml", "--cycles", "2", "--drives",
         kPrimitives + "robots/tumbler_drives_sensor.toml", "--twin", twin, "--get-ups", get_ups,
         "--json", Path("run.json"), "--record", Path("run.rec")});
    EXPECT_EQ(outcome.exit_code, get_ups == "0" ? 3 : 4) << outcome.text;
    const testing::Outcome replay = testing::RunProgram({"tumbler replay", Path("run.rec")});
    EXPECT_THAT(replay.text, HasSubstr("identical"));
    return Outcome{outcome, Json::Parse(testing::ReadFile(Path("run.json"))).value()};
  };
  const Outcome falls = run("0");
  EXPECT_EQ(falls.json["outcome"].text(), "fault");
  EXPECT_THAT(falls.json["reason"].text(), HasSubstr("fallen: "));
  EXPECT_EQ(falls.json["cycles"].integer(), 1);
  EXPECT_EQ(falls.json["sensor"]["get_ups"].integer(), 0);

  const Outcome gets_up = run("1");
  EXPECT_EQ(gets_up.json["outcome"].text(), "completed") << gets_up.text;
  EXPECT_EQ(gets_up.json["cycles"].integer(), 2);
  EXPECT_EQ(gets_up.json["sensor"]["get_ups"].integer(), 1);
  EXPECT_EQ(gets_up.json["falls"].size(), 1U);
  EXPECT_EQ(gets_up.json["as_planned_2_s_later"], true) << "of the last motion";
  EXPECT_THAT(gets_up.text,
              HasSubstr("by its sensor the robot fell, and began to get up: 1 time\n"));
}

TEST_F(SimTwin, ARobotThatFallsIntoAPoseOfItsMotionsAndGetsUpIsNotSaidToHaveDoneWell) {
  // In its handstand it is pushed onto its back, where a motion begins. Only its sensor tells of
  // it.
  const std::string twin = Write(
      "twin.toml", testing::ReadFile(kPrimitives + "robots/tumbler_twin_sensor.toml") +
                       "[[push]]\nlink = \"middle\"\nstart_s = 3.0\nduration_s = 0.2\nforce_n "
                       "= [-40.0, 0.0]\n");
  const testing::Outcome run =
      testing::RunProgram({"tumbler run", "sim", kPrimitives + "gait_sensor.toml", "--cycles", "2",
                           "--drives", kPrimitives + "robots/tumbler_drives_sensor.toml", "--twin",
                           twin, "--get-ups", "1", "--json", Path("run.json")});
  const Json json = Json::Parse(testing::ReadFile(Path("run.json"))).value();
  EXPECT_EQ(json["outcome"].text(), "completed");
  EXPECT_EQ(json["falls"].size(), 0U);
  EXPECT_EQ(json["sensor"]["get_ups"].integer(), 1);
  EXPECT_EQ(run.exit_code, 4) << run.text;
  EXPECT_EQ(json["exit_code"].integer(), 4);
  EXPECT_THAT(run.text, HasSubstr("NOT where it should be after 1 ('handstand' before 'rise')"));
  EXPECT_THAT(run.text, Not(HasSubstr("where it should be after each")));
}

TEST_F(SimTwin, NobodyGetsUpWhoCannotTellHowItLies) {
  const auto refused = [&](const std::string& motion, const std::string& drives) {
    const testing::Outcome run =
        testing::RunProgram({"tumbler run", "sim", kPrimitives + motion, "--drives",
                             kPrimitives + "robots/" + drives, "--get-ups", "1"});
    EXPECT_EQ(run.exit_code, 1) << run.text;
    EXPECT_THAT(run.text, HasSubstr("--get-ups"));
    return run.text;
  };
  EXPECT_THAT(refused("get_up.toml", "tumbler_drives.toml"), HasSubstr("[sensor]"));
  EXPECT_THAT(refused("handstand_sensor.toml", "tumbler_drives_sensor.toml"), HasSubstr("[begin]"));
}

TEST_F(SimTwin, ASensorOnALinkThatNoPrimitiveKnowsIsRefused) {
  const std::string motion = Write("handstand.toml", HandstandWithFeedback());
  const std::string drives =
      Write("drives.toml", testing::Replaced(kSensorDrives, "link = \"middle\"", "link = \"hat\""));
  const testing::Outcome run =
      testing::RunProgram({"tumbler run", "sim", motion, "--drives", drives});
  EXPECT_NE(run.exit_code, 0);
  EXPECT_THAT(run.text, HasSubstr("'hat'"));
}

}  // namespace
}  // namespace tumbler
