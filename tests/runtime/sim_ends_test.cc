// How runs on the simulated robot end: interrupted at any time, after faults, and where the robot
// would drop.

#include <array>
#include <functional>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "offline/twin/simulated_world.h"
#include "runtime/assembly/assembly.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/assembly/run_parts.h"
#include "runtime/assembly/run_settings.h"
#include "runtime/run/control_loop.h"
#include "runtime/run/play.h"
#include "tests/runtime/sim_twin.h"

namespace tumbler {
namespace {

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

}  // namespace
}  // namespace tumbler
