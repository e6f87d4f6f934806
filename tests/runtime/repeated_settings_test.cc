// What becomes of the settings of a recorded run when it is played again.

#include "runtime/run/repeated_settings.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "runtime/record/configuration_fields.h"
#include "tests/support/recorded_run.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// The options of a command line.
using Given = std::vector<std::string>;

class Repeating : public ::testing::Test {
 protected:
  Repeating() {
    now_ = ExecutorConfigOf(settings_, parts().drives);
    // A number that may be greater and smaller.
    now_.speed = 0.8F;
    now_.start_way_max_rad = 1;
    now_.moved_max_rad = 0.5F;
    now_.get_ups_max = 2;
    settings_.clear = true;
    recorded_.executor = now_;
    recorded_.procedure = ProcedureConfigOf(settings_, parts().drives, parts().sequence->graph);
  }
  [[nodiscard]] const RunParts& parts() const { return assembly_.parts(); }
  [[nodiscard]] RepeatedSettings Repeat(const Given& given = {}) const {
    return SettingsToRepeat(recorded_, now_, settings_, parts(),
                            [&given](const std::string& option) {
                              return std::ranges::find(given, option) != given.end();
                            });
  }

  Assembly assembly_ = Assemble(testing::SmallConfiguration());
  RunSettings settings_;
  ExecutorConfig now_;
  RecordConfiguration recorded_;
};

/// The part of a run's settings that is of this type.
template <typename Config>
Config& PartOf(ExecutorConfig& executor, RunProcedureConfig& procedure) {
  if constexpr (std::is_same_v<Config, ExecutorConfig>) return executor;
  if constexpr (std::is_same_v<Config, RunProcedureConfig>) return procedure;
  if constexpr (std::is_same_v<Config, JointConfig>) return executor.joints[0];
  if constexpr (std::is_same_v<Config, CollapseConfig>) return executor.collapse;
}

/// Adds to the number with this key. @returns what it is then.
template <typename Config>
double Change(Config& config, const std::string& key, double by) {
  double result = 0;
  VisitNumbers(config, [&](const ConfigField& field, auto& value) {
    using Value = std::remove_reference_t<decltype(value)>;
    if (field.key != key) return;
    if constexpr (std::is_same_v<Value, bool>) {
      value = !value;
    } else if constexpr (std::is_integral_v<Value>) {
      // A count of 0 less 1 is the largest, as it would be read from a record.
      value = static_cast<Value>(static_cast<std::int64_t>(value) + static_cast<std::int64_t>(by));
    } else {
      value = static_cast<Value>(static_cast<double>(value) + by);
    }
    result = static_cast<double>(value);
  });
  return result;
}

template <typename Config>
double ValueOf(Config& config, const std::string& key) {
  return Change(config, key, 0);
}

TEST_F(Repeating, ARecordOfTheSettingsOfNowSaysNothing) {
  const RepeatedSettings same = Repeat();
  EXPECT_THAT(same.milder, IsEmpty());
  EXPECT_THAT(same.notes, IsEmpty());
}

TEST(RepeatedFields, NoNumberOfARunIsWithoutARuleThatWasThoughtAbout) {
  using R = Repetition;
  const std::map<std::string, R> expected = {
      {"kp_nm_per_rad", R::kOfNowAndSaid},
      {"kd_nm_s_per_rad", R::kOfNowAndSaid},
      {"damping_nm_s_per_rad", R::kOfNowAndSaid},
      {"temperature_max_c", R::kOfNowAndSaid},
      {"known", R::kOfNow},
      {"position_rad", R::kOfNow},
      {"turn_rad", R::kOfNow},
      {"stiffness", R::kGreaterIsMilder},
      {"period_s", R::kOfNow},
      {"speed", R::kGreaterIsMilder},
      {"move_fraction", R::kGreaterIsMilder},
      {"torque_rise_s", R::kSmallerIsMilder},
      {"stale_ticks_max", R::kGreaterIsMilder},
      {"sequence_errors_max", R::kGreaterIsMilder},
      {"late_ticks_max", R::kGreaterIsMilder},
      {"arming_ticks_max", R::kGreaterIsMilder},
      {"pause_ticks_max", R::kOfNow},
      {"start_way_max_rad", R::kGreaterIsMilder},
      {"moved_max_rad", R::kPoseLimit},
      {"cycles", R::kOfMotion},
      {"branch", R::kOfMotion},
      {"begin", R::kWordOfThatDay},
      {"get_ups_max", R::kGreaterIsMilder},
      {"hold_ticks", R::kOfMotion},
      {"reply_ticks_max", R::kOfNow},
      {"start_ticks_max", R::kOfNow},
      {"rest_ticks", R::kOfNow},
      {"stop_hold_ticks", R::kOfNow},
      {"fault_ticks", R::kOfNow},
      {"lower_ticks", R::kEnd},
      {"end_hold_ticks", R::kEnd},
      {"safe_nodes", R::kOfNow},
      {"go_home", R::kEnd},
      {"clear_ticks", R::kOfNowAndSaid},
      {"disarmed_ticks", R::kOfNow},
      {"attended", R::kOfNow},
  };
  std::map<std::string, R> found;
  const auto note = [&found](const ConfigField& field, const auto& /*value*/) {
    EXPECT_TRUE(found.emplace(field.key, field.repetition).second) << field.key;
  };
  ExecutorConfig executor;
  RunProcedureConfig procedure;
  VisitNumbers(executor, note);
  VisitNumbers(procedure, note);
  VisitNumbers(executor.joints[0], note);
  VisitNumbers(executor.last_known[0], note);
  VisitNumbers(executor.collapse, note);
  EXPECT_EQ(found, expected);
}

/// Changes every number of the record's configuration up and down, and sees what becomes of it.
template <typename Config>
void ExpectRules(
    const RecordConfiguration& recorded, const ExecutorConfig& now,
    const std::function<RepeatedSettings(const RecordConfiguration&, const Given&)>& repeat) {
  std::vector<ConfigField> fields;
  Config any;
  VisitNumbers(any, [&fields](const ConfigField& field, auto&) { fields.push_back(field); });
  for (const ConfigField& field : fields) {
    for (const double by : {-0.0625, 0.0625, -1.0, 1.0}) {
      SCOPED_TRACE(fmt::format("{} {:+}", field.key, by));
      RecordConfiguration changed = recorded;
      Config& part = PartOf<Config>(changed.executor, changed.procedure);
      const double before = ValueOf(part, field.key);
      const double was = Change(part, field.key, by);
      if (was == before) continue;  // an integer
      ExecutorConfig executor = now;
      RunProcedureConfig procedure = recorded.procedure;
      const double is = ValueOf(PartOf<Config>(executor, procedure), field.key);
      RepeatedSettings result = repeat(changed, {});
      const double in_force = ValueOf(PartOf<Config>(result.executor, result.procedure), field.key);
      const bool greater_is_milder = field.repetition == Repetition::kGreaterIsMilder ||
                                     field.repetition == Repetition::kPoseLimit;
      bool milder = false, taken = false;
      switch (field.repetition) {
        case Repetition::kOfMotion:
          taken = true;
          break;
        case Repetition::kOfNow:
        case Repetition::kEnd:  // Ends are compared as a whole, below.
          continue;
        case Repetition::kOfNowAndSaid:
          ASSERT_EQ(result.notes.size(), 1U);
          EXPECT_THAT(result.notes[0], HasSubstr(field.key));
          EXPECT_THAT(result.notes[0], HasSubstr(fmt::format("{:.6g}", was)));
          EXPECT_THAT(result.notes[0], HasSubstr(fmt::format("{:.6g}", is)));
          break;
        case Repetition::kWordOfThatDay:
          milder = was >= 0;
          break;
        case Repetition::kGreaterIsMilder:
        case Repetition::kPoseLimit:
        case Repetition::kSmallerIsMilder:
          milder = greater_is_milder == (was > is);
          taken = !milder;
          break;
      }
      EXPECT_EQ(in_force, taken ? was : is);
      ASSERT_EQ(result.milder.size(), milder ? 1U : 0U);
      if (field.repetition == Repetition::kOfMotion) continue;
      if (milder) {
        EXPECT_EQ(result.milder[0].name.substr(result.milder[0].name.rfind(' ') + 1), field.key);
        EXPECT_EQ(result.milder[0].option, field.option);
        const std::string text = DescribeMilder("a.rec", result.milder);
        EXPECT_THAT(text, HasSubstr("a.rec: "));
        EXPECT_THAT(text, HasSubstr(field.key));
        if (field.repetition != Repetition::kWordOfThatDay) {
          EXPECT_THAT(text, HasSubstr(fmt::format("{:.6g} in the record, {:.6g} now", was, is)));
        }
        EXPECT_THAT(text, HasSubstr(*field.option == '\0' ? "no option allows it" : field.option));
      }
      if (*field.option == '\0') continue;
      // The option decides, whatever the record has.
      result = repeat(changed, {field.option});
      EXPECT_THAT(result.milder, IsEmpty());
      EXPECT_EQ(ValueOf(PartOf<Config>(result.executor, result.procedure), field.key), is);
    }
  }
}

TEST_F(Repeating, EveryNumberThatIsMilderIsNamedAndNoneIsInForceUnlessItIsStricter) {
  const auto repeat = [this](const RecordConfiguration& recorded, const Given& given) {
    recorded_ = recorded;
    return Repeat(given);
  };
  const RecordConfiguration same = recorded_;
  ExpectRules<ExecutorConfig>(same, now_, repeat);
  ExpectRules<RunProcedureConfig>(same, now_, repeat);
  ExpectRules<JointConfig>(same, now_, repeat);
  // Only where a reaction is collapse, what it is like has a meaning.
  RecordConfiguration collapses = same;
  for (RecordConfiguration* const record : {&collapses}) {
    record->executor.collapse.configured = true;
    record->executor.reactions.Set(Fault::kStaleReply, ExecutorState::kHolding,
                                   Reaction::kCollapse);
  }
  ExpectRules<CollapseConfig>(collapses, now_, repeat);
}

TEST_F(Repeating, ALimitOfTheWaySinceTheLastPoseIsNoLimitInARunThatKnewNoPose) {
  recorded_.executor.moved_max_rad = ExecutorConfig().moved_max_rad;
  EXPECT_THAT(Repeat().milder, IsEmpty());
  EXPECT_EQ(Repeat().executor.moved_max_rad, 0.5F);
  recorded_.executor.last_known[0] = {true, 0.3F, 0.7F};
  EXPECT_FALSE(Repeat().executor.last_known[0].known) << "where it was another day";
}

/// How strong a reaction may come to be, from 0 on.
std::pair<int, int> StrengthOf(Reaction reaction) {
  const std::vector<Reaction> order = {Reaction::kIgnore, Reaction::kHold,     Reaction::kRollOut,
                                       Reaction::kFold,   Reaction::kCollapse, Reaction::kDamp,
                                       Reaction::kDisable};
  const auto place = [&order](Reaction r) {
    return static_cast<int>(std::ranges::find(order, r) - order.begin());
  };
  if (reaction == Reaction::kAbort) return {place(Reaction::kHold), place(Reaction::kDamp)};
  return {place(reaction), place(reaction)};
}

TEST_F(Repeating, NoReactionBecomesMilderAndEachThatWasIsNamed) {
  recorded_.executor.collapse.configured = true;
  recorded_.executor.collapse.position_rad = {0.1F, -0.1F};
  int named = 0, stronger = 0;
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    for (std::size_t s = 0; s < kExecutorStateCount; ++s) {
      for (std::size_t r = 0; r < kReactionCount; ++r) {
        const auto fault = static_cast<Fault>(f);
        const auto state = static_cast<ExecutorState>(s);
        const auto reaction = static_cast<Reaction>(r);
        recorded_.executor.reactions = now_.reactions;
        const Reaction is = now_.reactions(fault, state);
        if (!recorded_.executor.reactions.Set(fault, state, reaction) || reaction == is) continue;
        const RepeatedSettings result = Repeat();
        const bool strict = StrengthOf(reaction).first >= StrengthOf(is).second;
        EXPECT_EQ(result.executor.reactions(fault, state), strict ? reaction : is);
        (strict ? stronger : named)++;
        ASSERT_EQ(result.milder.size(), strict ? 0U : 1U);
        EXPECT_EQ(result.executor.collapse.configured, strict && reaction == Reaction::kCollapse);
        if (strict) continue;
        EXPECT_THAT(result.milder[0].name, HasSubstr(ToString(fault)));
        EXPECT_EQ(result.milder[0].recorded,
                  fmt::format("{} while {}", ToString(reaction), ToString(state)));
        EXPECT_EQ(result.milder[0].now, fmt::format("{} while {}", ToString(is), ToString(state)));
        EXPECT_EQ(result.milder[0].option, "--faults");
        const RepeatedSettings given = Repeat({"--faults"});
        EXPECT_THAT(given.milder, IsEmpty());
        EXPECT_EQ(given.executor.reactions(fault, state), is);
      }
    }
  }
  EXPECT_GT(named, 100);
  EXPECT_GT(stronger, 100);
}

TEST_F(Repeating, AnEndThatLetsTheRobotDownMoreIsNamedAndOneThatDoesLessHolds) {
  const SequenceGraph<float>& graph = parts().sequence->graph;
  const std::vector<RunEnd> ends = {RunEnd::kTorqueOff, RunEnd::kLower, RunEnd::kHold};
  for (std::size_t was = 0; was < ends.size(); ++was) {
    for (std::size_t is = 0; is < ends.size(); ++is) {
      settings_.end = ends[was];
      recorded_.procedure = ProcedureConfigOf(settings_, parts().drives, graph);
      settings_.end = ends[is];
      settings_.operated = true;  // The run that was recorded was not.
      const RepeatedSettings result = Repeat();
      settings_.end = ends[std::max(was, is)];
      const RunProcedureConfig expected = ProcedureConfigOf(settings_, parts().drives, graph);
      EXPECT_EQ(result.procedure.lower_ticks, expected.lower_ticks);
      EXPECT_EQ(result.procedure.end_hold_ticks, expected.end_hold_ticks);
      EXPECT_EQ(result.procedure.go_home, expected.go_home);
      ASSERT_EQ(result.milder.size(), was < is ? 1U : 0U);
      settings_.end = ends[is];
      EXPECT_THAT(Repeat({"--end"}).milder, IsEmpty());
      EXPECT_EQ(Repeat({"--end"}).procedure.end_hold_ticks,
                ProcedureConfigOf(settings_, parts().drives, graph).end_hold_ticks);
      settings_.operated = false;
    }
  }
}

TEST_F(Repeating, WhatRunsDidNotKnowWhenARecordWasMadeIsAsItIsNow) {
  recorded_.executor.start_way_max_rad = 1e9F;
  recorded_.executor.get_ups_max = 7;
  recorded_.procedure.end_hold_ticks = 0;
  for (const StateInfo& state : kStateTable)
    recorded_.executor.reactions.Set(Fault::kForeignCommand, state.state, Reaction::kIgnore);
  EXPECT_EQ(Repeat().milder.size(), 4U);
  recorded_.lacks = {"start_way_max_rad", "get_ups_max", "end_hold_ticks",
                     ToString(Fault::kForeignCommand)};
  const RepeatedSettings result = Repeat();
  EXPECT_THAT(result.milder, IsEmpty());
  EXPECT_EQ(result.executor.start_way_max_rad, 1);
  EXPECT_EQ(result.executor.get_ups_max, 2);
  EXPECT_NE(result.procedure.end_hold_ticks, 0);
  EXPECT_EQ(result.executor.reactions(Fault::kForeignCommand, ExecutorState::kRunning),
            Reaction::kDamp);
}

}  // namespace
}  // namespace tumbler
