#include "runtime/assembly/faults_toml.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "common/files/toml_reader.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

const std::vector<FaultsJoint> kJoints = {{"leg1", -2.9, 2.9}, {"leg2", -2.0, 2.5}};
const std::string kHead = "format = \"tumbler-faults\"\nversion = 1\n";

ExecutorConfig Parse(const std::string& rest) {
  ExecutorConfig config;
  ParseFaults(kHead + rest, "f.toml", kJoints, config);
  return config;
}

TEST(FaultsToml, TheShippedExampleIsRead) {
  ExecutorConfig config;
  LoadFaults(testing::SourcePath("primitives/robots/tumbler_faults.toml"), kJoints, config);
  EXPECT_TRUE(config.collapse.configured);
  EXPECT_FLOAT_EQ(config.collapse.position_rad[0], -1.5707963F);
  EXPECT_FLOAT_EQ(config.collapse.position_rad[1], 1.5707963F);
  EXPECT_EQ(config.reactions(Fault::kLateTick, ExecutorState::kRunning), Reaction::kCollapse);
  const ExecutorConfig defaults;
  EXPECT_EQ(config.stale_ticks_max, defaults.stale_ticks_max) << "the file states the defaults";
  EXPECT_EQ(config.sequence_errors_max, defaults.sequence_errors_max);
  EXPECT_EQ(config.late_ticks_max, defaults.late_ticks_max);
}

TEST(FaultsToml, AnEmptyOneChangesNothing) {
  const ExecutorConfig config = Parse("");
  const FaultTable defaults;
  for (const FaultInfo& fault : kFaultTable) {
    for (const StateInfo& state : kStateTable) {
      EXPECT_EQ(config.reactions(fault.fault, state.state), defaults(fault.fault, state.state));
    }
  }
  EXPECT_FALSE(config.collapse.configured);
  EXPECT_EQ(config.arming_ticks_max, 500);
}

TEST(FaultsToml, EveryFaultCanBeSetInEveryStateByItsName) {
  for (const FaultInfo& fault : kFaultTable) {
    if (fault.fault == Fault::kNone) continue;
    for (const StateInfo& state : kStateTable) {
      if (state.state == ExecutorState::kDisarmed) continue;
      const FaultTable defaults;
      const bool disabled = defaults(fault.fault, state.state) == Reaction::kDisable;
      const bool arming = state.state == ExecutorState::kArming;
      // These have no other reaction.
      if (fault.fault == Fault::kPaused || (arming && fault.fault == Fault::kOperatorStop))
        continue;
      const Reaction reaction = arming     ? Reaction::kIgnore
                                : disabled ? Reaction::kDamp
                                           : Reaction::kDisable;
      const ExecutorConfig config =
          Parse("[reactions]\n" + FaultsKey(fault.name) + " = { " + FaultsKey(state.name) +
                " = \"" + ToString(reaction) + "\" }\n");
      for (const StateInfo& other : kStateTable) {
        EXPECT_EQ(config.reactions(fault.fault, other.state),
                  other.state == state.state ? reaction : defaults(fault.fault, other.state))
            << fault.name << " while " << other.name;
      }
    }
  }
}

TEST(FaultsToml, AReactionAloneHoldsInEveryStateThatIsDriven) {
  const ExecutorConfig config = Parse("[reactions]\nover_temperature = \"hold\"\n");
  for (const StateInfo& state : kStateTable) {
    Reaction expected = Reaction::kHold;
    if (state.state == ExecutorState::kDisarmed) expected = Reaction::kIgnore;
    if (state.state == ExecutorState::kArming) expected = Reaction::kDisable;
    EXPECT_EQ(config.reactions(Fault::kOverTemperature, state.state), expected) << state.name;
  }
}

TEST(FaultsToml, AFaultWhileRunningCanBeAnsweredByTheMotionsTableOrNotByIt) {
  EXPECT_EQ(Parse("[reactions]\nsensor_lost = { running = \"abort\" }\n")
                .reactions(Fault::kSensorLost, ExecutorState::kRunning),
            Reaction::kAbort);
  EXPECT_EQ(Parse("[reactions]\nlate_tick = { running = \"damp\" }\n")
                .reactions(Fault::kLateTick, ExecutorState::kRunning),
            Reaction::kDamp);
}

TEST(FaultsToml, LimitsAreTaken) {
  const ExecutorConfig config = Parse(
      "[limits]\nstale_ticks_max = 7\nsequence_errors_max = 8\nlate_ticks_max = 0\n"
      "arming_ticks_max = 900\n");
  EXPECT_EQ(config.stale_ticks_max, 7);
  EXPECT_EQ(config.sequence_errors_max, 8);
  EXPECT_EQ(config.late_ticks_max, 0);
  EXPECT_EQ(config.arming_ticks_max, 900);
}

struct Bad {
  std::string text;
  std::vector<std::string> fragments;
};

TEST(FaultsToml, WhatIsWrongIsNamedWithFileLineKeyAndWhatIsAllowedAndNothingIsChanged) {
  const std::vector<Bad> all = {
      {"[limits]\nstale_ticks_max = 0\n",
       {"f.toml:4", "limits.stale_ticks_max", "0", "1 ... 1000"}},
      {"[limits]\nstale_ticks_max = 2.5\n", {"f.toml:4", "limits.stale_ticks_max"}},
      {"[limits]\nlate_ticks_max = 1001\n", {"f.toml:4", "limits.late_ticks_max", "0 ... 1000"}},
      {"[limits]\nsequence_errors_max = -1\n", {"f.toml:4", "limits.sequence_errors_max"}},
      {"[limits]\narming_ticks_max = 0\n", {"f.toml:4", "limits.arming_ticks_max"}},
      {"[limits]\nstale_tick_max = 5\n", {"f.toml:4", "limits.stale_tick_max", "stale_ticks_max"}},
      {"[reactions]\nlate_tick = \"freeze\"\n",
       {"f.toml:4", "reactions.late_tick", "freeze", "hold", "collapse", "damp"}},
      {"[reactions]\nlate_tick = 3\n", {"f.toml:4", "reactions.late_tick"}},
      {"[reactions]\nlate_ticks = \"hold\"\n", {"f.toml:4", "reactions.late_ticks", "late_tick"}},
      {"[reactions]\nlate_tick = { walking = \"hold\" }\n",
       {"f.toml:4", "reactions.late_tick.walking"}},
      {"[reactions]\nlate_tick = { disarmed = \"hold\" }\n",
       {"f.toml:4", "reactions.late_tick.disarmed"}},
      {"[reactions]\nlate_tick = { arming = \"hold\" }\n",
       {"f.toml:4", "reactions.late_tick.arming", "while arming", "ignore, disable"}},
      {"[reactions]\noperator_stop = \"ignore\"\n",
       {"f.toml:4", "reactions.operator_stop", "never ignored"}},
      {"[reactions]\nlate_tick = \"collapse\"\n", {"f.toml:3", "reactions", "[collapse]"}},
      {"[reactions]\nlate_tick = \"abort\"\n",
       {"f.toml:4", "reactions.late_tick", "running alone", "{ running = \"abort\" }"}},
      {"[reactions]\nlate_tick = { settling = \"abort\" }\n",
       {"f.toml:4", "reactions.late_tick.settling", "running alone"}},
      {"[reactions]\nlate_tick = { running = \"fold\" }\n",
       {"f.toml:4", "reactions.late_tick.running", "fold", "abort"}},
      {"[reactions]\nlate_tick = { running = \"roll out\" }\n",
       {"f.toml:4", "reactions.late_tick.running", "roll out", "abort"}},
      {"[collapse]\nposition_rad = { leg1 = 0 }\n", {"f.toml:4", "leg2"}},
      {"[collapse]\nposition_rad = { leg1 = 0, leg2 = 2.6 }\n",
       {"f.toml:4", "collapse.position_rad.leg2", "2.6", "-2 ... 2.5"}},
      {"[collapse]\nposition_rad = { leg1 = nan, leg2 = 0 }\n",
       {"f.toml:4", "collapse.position_rad.leg1"}},
      {"[collapse]\nposition_rad = { leg1 = 0, leg2 = 0, leg3 = 0 }\n",
       {"f.toml:4", "collapse.position_rad.leg3"}},
      {"[collapse]\nstiffness = 1.5\nposition_rad = { leg1 = 0, leg2 = 0 }\n",
       {"f.toml:4", "collapse.stiffness", "0.01 ... 1"}},
      {"[collapse]\nstiffness = 0.5\n", {"collapse", "position_rad"}},
      {"speed = 1\n", {"f.toml:3", "speed"}}};
  for (const Bad& bad : all) {
    ExecutorConfig config;
    config.stale_ticks_max = 3;
    try {
      ParseFaults(kHead + bad.text, "f.toml", kJoints, config);
      ADD_FAILURE() << "taken: " << bad.text;
    } catch (const FileError& error) {
      for (const std::string& fragment : bad.fragments) {
        EXPECT_THAT(error.what(), HasSubstr(fragment)) << bad.text;
      }
    }
    EXPECT_EQ(config.stale_ticks_max, 3);
    EXPECT_FALSE(config.collapse.configured);
    EXPECT_FALSE(config.reactions.Has(Reaction::kCollapse));
  }
}

TEST(FaultsToml, OtherFormatsAndVersionsAreRefused) {
  ExecutorConfig config;
  EXPECT_THROW(ParseFaults("version = 1\n", "f.toml", kJoints, config), FileError);
  EXPECT_THROW(ParseFaults("format = \"tumbler-drives\"\nversion = 1\n", "f.toml", kJoints, config),
               FileError);
  EXPECT_THROW(ParseFaults("format = \"tumbler-faults\"\nversion = 2\n", "f.toml", kJoints, config),
               FileError);
  EXPECT_THROW(LoadFaults("/nonexistent/f.toml", kJoints, config), FileError);
}

TEST(FaultsToml, TheTablesOfTheDocumentAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", FaultsKeyTables());
}

TEST(FaultsToml, EveryLimitOfAFaultIsAKey) {
  std::set<std::string> keys;
  for (const KeyTable& table : FaultsKeyTables()) {
    for (const KeyRow& row : table.rows) keys.insert(row.table + " " + row.key);
  }
  for (const FaultInfo& fault : kFaultTable) {
    const std::string key = fault.limit_key;
    EXPECT_TRUE(key.empty() || keys.contains("`[limits]` `" + key + "`")) << fault.name;
  }
}

}  // namespace
}  // namespace tumbler
