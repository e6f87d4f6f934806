// What hurts a robot least when its motion cannot go on: how it is found, and that it does.

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_hash.h"
#include "common/files/primitive_rounding.h"
#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "offline/scene/normal.h"
#include "offline/studies/abort_check.h"
#include "offline/studies/abort_study.h"
#include "tests/support/files.h"
#include "tests/support/frame_checker.h"
#include "tests/support/program.h"
#include "tests/support/protocol_side.h"

namespace tumbler {
namespace {

using testing::EveryProtocol;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TestedProtocol;

std::string Shipped(const std::string& name) {
  return testing::SourcePath("primitives/" + name + ".toml");
}

/// A search that is small enough for a test: five parts of the handstand, and four robots.
AbortStudy SmallStudy(const std::string& primitive, int threads) {
  AbortStudy study;
  study.primitive = primitive;
  study.robots = 4;
  study.step_s = 0.15;
  study.threads = threads;
  return study;
}

class AbortSearch : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    result_ = std::make_unique<const AbortResult>(FindAborts(SmallStudy(Shipped("handstand"), 2)));
  }
  static void TearDownTestSuite() { result_.reset(); }
  static std::unique_ptr<const AbortResult> result_;
};
std::unique_ptr<const AbortResult> AbortSearch::result_;

TEST_F(AbortSearch, ThreadsChangeNothing) {
  const AbortResult alone = FindAborts(SmallStudy(Shipped("handstand"), 1));
  EXPECT_EQ(ToJson(alone), ToJson(*result_));
  EXPECT_EQ(ToText(alone), ToText(*result_));
}

/// The sum of the costs of a choice, with what its changes cost.
double SumOf(const std::vector<AbortPart>& parts, const std::vector<std::size_t>& choice) {
  double sum = 0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    sum += parts[k].costs[choice[k]].cost_m_s();
    if (k > 0 && choice[k] != choice[k - 1]) sum += 0.3;
  }
  return sum;
}

TEST_F(AbortSearch, NoOtherChoiceOfWaysCostsLess) {
  const std::vector<AbortPart>& parts = result_->parts;
  ASSERT_EQ(parts.size(), 5U);
  std::vector<std::size_t> chosen;
  for (const AbortPart& part : parts) chosen.push_back(part.chosen);
  const std::size_t ways = result_->candidates.size();
  std::vector<std::size_t> choice(parts.size());
  double least = std::numeric_limits<double>::infinity();
  const auto choices = static_cast<std::size_t>(std::lround(std::pow(ways, parts.size())));
  for (std::size_t n = 0; n < choices; ++n) {
    for (std::size_t k = 0, rest = n; k < parts.size(); ++k, rest /= ways) choice[k] = rest % ways;
    least = std::min(least, SumOf(parts, choice));
  }
  EXPECT_NEAR(SumOf(parts, chosen), least, 1e-9);
}

TEST_F(AbortSearch, TheTableHasTheChosenWayAtEveryTimeAndNoSpanTwice) {
  const AbortTable<double>& table = result_->table;
  for (const AbortPart& part : result_->parts) {
    const AbortCandidate& chosen = result_->candidates[part.chosen];
    for (const double share : {0.0, 0.5, 0.999}) {
      const AbortSpan<double>& span = table.At(part.from_s + share * (part.to_s - part.from_s));
      EXPECT_EQ(span.way, chosen.way);
      EXPECT_EQ(span.late_max_s, chosen.late_max_s);
      EXPECT_EQ(span.limits_share, chosen.limits_share);
    }
  }
  for (std::size_t i = 1; i < table.spans().size(); ++i) {
    const AbortSpan<double>&a = table.spans()[i - 1], &b = table.spans()[i];
    EXPECT_TRUE(a.way != b.way || a.late_max_s != b.late_max_s ||
                a.limits_share != b.limits_share || a.position_rad != b.position_rad);
  }
  EXPECT_EQ(table.spans().back().until_s, result_->parts.back().to_s);
}

/// What is known of this motion without any simulation: it begins at rest on both feet, where it
/// can stay or go back, and flies in its middle, where it has to land as planned.
TEST_F(AbortSearch, AHandstandStaysAtItsStartAndIsRolledOutInItsFlight) {
  const AbortSpan<double>& first = result_->table.At(0);
  ASSERT_TRUE(first.way == AbortWay::kCatch || first.way == AbortWay::kFold);
  const PrimitiveFile file = LoadPrimitive(Shipped("handstand"));
  for (std::size_t j = 0; first.way == AbortWay::kFold && j < 2; ++j) {
    EXPECT_EQ(first.position_rad[j], file.primitive.joints[j].position.control_points().front());
  }
  EXPECT_EQ(result_->table.At(0.4).way, AbortWay::kRollOut);
  for (const AbortPart& part : result_->parts) {
    const AbortCost& roll_out = part.costs[3];  // if it is late by 20 ms at most
    EXPECT_EQ(result_->candidates[3].way, AbortWay::kRollOut);
    EXPECT_EQ(roll_out.robots, 4);
    EXPECT_EQ(roll_out.overlap, 0);
    EXPECT_GT(roll_out.torque_nm, 1);
  }
}

TEST_F(AbortSearch, TheTableIsWrittenIntoTheFileAndReplacesTheOneThatWasThere) {
  const testing::TemporaryFolder folder;
  AbortResult result = *result_;
  result.study.primitive = folder / "handstand.toml";
  testing::WriteFile(result.study.primitive, testing::ReadFile(Shipped("handstand")));
  WriteAborts(result);
  const std::string once = testing::ReadFile(result.study.primitive);
  const PrimitiveFile file = LoadPrimitive(result.study.primitive);
  ASSERT_EQ(file.primitive.aborts.span_count, result.table.span_count);
  ASSERT_TRUE(file.abort_figure);
  EXPECT_EQ(file.abort_figure->robots, 4);
  EXPECT_EQ(file.abort_figure->impact_max_m_s, result.figure.impact_max_m_s);
  EXPECT_LT(file.abort_figure->impact_m_s, file.abort_figure->damped_impact_m_s);
  EXPECT_THROW(WriteAborts(result), Refused) << "it is another file now";
  EXPECT_EQ(testing::ReadFile(result.study.primitive), once);
  result.primitive_hash = HashOfText(once);
  WriteAborts(result);
  EXPECT_EQ(testing::ReadFile(result.study.primitive), once);
  // Nothing else has changed.
  PrimitiveFile bare = file;
  PrimitiveFile shipped = LoadPrimitive(Shipped("handstand"));
  bare.primitive.aborts = shipped.primitive.aborts = {};
  bare.abort_figure = shipped.abort_figure = {};
  EXPECT_EQ(ToToml(bare), ToToml(shipped));
}

TEST(AbortCost, CountsImpactsAndBesidesRobotsThatDoNotRestOrOverlap) {
  AbortCost cost;
  cost.robots = 4;
  cost.rest = 4;
  cost.impact_m_s = 0.5;
  cost.worst_m_s = 1.5;
  EXPECT_DOUBLE_EQ(cost.cost_m_s(), 1);
  cost.rest = 2;
  EXPECT_DOUBLE_EQ(cost.cost_m_s(), 1.05);
  cost.overlap = 1;
  EXPECT_DOUBLE_EQ(cost.cost_m_s(), 3.55);
}

AbortTrials TrialsOf(const std::string& name) {
  AbortStudy study;
  study.primitive = Shipped(name);
  return LoadAbortTrials(study);
}

AbortTable<double> OneWayTable(const Primitive<double>& primitive, AbortWay way) {
  AbortTable<double> table;
  table.span_count = 1;
  AbortSpan<double>& span = table.span_storage[0];
  span.until_s = primitive.duration_s;
  span.way = way;
  if (way == AbortWay::kRollOut) span.late_max_s = 0.04;
  if (way != AbortWay::kFold) return table;
  span.limits_share = 0.3;
  for (std::size_t j = 0; j < primitive.motions().size(); ++j)
    span.position_rad[j] = primitive.joints[j].position.control_points().front();
  return table;
}

TEST(AbortTrials, EveryCauseLeadsToItsFaultAndTheWayOfTheTable) {
  const AbortTrials trials = TrialsOf("handstand");
  AbortStudy study;
  const std::vector<std::pair<AbortCause, Fault>> causes = {
      {AbortCause::kOperatorStop, Fault::kOperatorStop},
      {AbortCause::kLateTick, Fault::kLateTick},
      {AbortCause::kSilence, Fault::kStaleReply},
      {AbortCause::kRepeatedReplies, Fault::kWrongSequence}};
  for (const auto& [cause, fault] : causes) {
    AbortTrial trial;
    trial.variation = AbortRobot(study, trials.shared(), 0);
    trial.time_s = 0.5;
    trial.late_s = 0.01;
    trial.cause = cause;
    trial.table = OneWayTable(trials.primitive(), AbortWay::kRollOut);
    const AbortOutcome rolled = trials.Play(trial);
    EXPECT_EQ(ToString(rolled.fault), std::string(ToString(fault)));
    EXPECT_EQ(rolled.reaction, Reaction::kRollOut) << ToString(cause);
    EXPECT_LT(rolled.impact_m_s, 0.6) << ToString(cause);
    EXPECT_EQ(rolled.rests_as, "as after handstand") << ToString(cause);
    EXPECT_EQ(rolled.setpoints_outside_limits, 0);
    trial.table = {};
    const AbortOutcome without = trials.Play(trial);
    EXPECT_EQ(without.fault, cause == AbortCause::kOperatorStop ? Fault::kNone : fault);
    EXPECT_GT(without.impact_m_s, 1) << ToString(cause);
    EXPECT_EQ(without.rests_as, "") << ToString(cause);
  }
}

TEST(AbortTrials, AFoldBringsTheJointsIntoItsPose) {
  const AbortTrials trials = TrialsOf("handstand");
  AbortTrial trial;
  trial.variation = AbortRobot({}, trials.shared(), 0);
  trial.time_s = 0.05;
  trial.table = OneWayTable(trials.primitive(), AbortWay::kFold);
  std::vector<double> joints;
  const AbortOutcome outcome = trials.Play(
      trial, [&joints](VariedRun& run) { joints = run.robot().state().joint_positions_rad; });
  EXPECT_EQ(outcome.reaction, Reaction::kFold);
  ASSERT_EQ(joints.size(), 2U);
  for (std::size_t j = 0; j < 2; ++j)
    EXPECT_NEAR(joints[j], trial.table.span_storage[0].position_rad[j], 0.1);
  EXPECT_EQ(outcome.rests_as, "as before handstand");
}

/// Aborts on the wire, with every protocol: what the shipped tables of the handstand and the
/// downstand make of robots that are not the model.
class AbortsOnTheWire : public ::testing::TestWithParam<TestedProtocol> {
 protected:
  static constexpr int kAborts = 20;

  /// The judge of the frames of one run.
  static testing::FrameRules RulesOf(const AbortTrials& trials) {
    testing::FrameRules rules;
    rules.drives = trials.shared().drives;
    rules.same_tick_share = 0.9;
    const Primitive<float> played = ToRuntime(trials.primitive());
    for (const JointMotion<float>& motion : played.motions()) {
      const auto wide = [](float x) { return static_cast<double>(x); };
      const JointLimits<float>& limits = motion.limits;
      rules.limits.push_back({wide(limits.position_min_rad), wide(limits.position_max_rad),
                              wide(limits.velocity_max_rad_s), wide(limits.acceleration_max_rad_s2),
                              wide(limits.torque_max_nm)});
    }
    return rules;
  }

  /// Plays an abort while all frames on the bus are judged.
  static AbortOutcome PlayJudged(const AbortTrials& trials, const AbortTrial& trial) {
    testing::FrameJudge judge(RulesOf(trials));
    SimulatedPort* tap = nullptr;
    const AbortOutcome outcome = trials.Play(trial, [&](VariedRun& run) {
      if (tap == nullptr) {
        SimulatedPortConfig port;
        port.listen_only = true;
        tap = &run.robot().bus().Attach(port);
      }
      ReceivedFrame received;
      while (tap->Receive(received) == Status::kOk)
        judge.Take({1e-9 * static_cast<double>(received.time_ns), received.frame});
    });
    EXPECT_THAT(judge.report().violations, IsEmpty());
    EXPECT_EQ(outcome.setpoints_outside_limits, 0);
    return outcome;
  }

  static AbortTrials TrialsWith(const TestedProtocol& protocol, const std::string& name) {
    AbortStudy study;
    study.primitive = Shipped(name);
    study.drives = testing::SourcePath(protocol.drives);
    return LoadAbortTrials(study);
  }
};

TEST_P(AbortsOnTheWire, HurtRobotsLessWithTheTableAndSendNothingBeyondALimit) {
  const TestedProtocol& protocol = GetParam();
  for (const char* const name : {"handstand", "downstand"}) {
    const AbortTrials trials = TrialsWith(protocol, name);
    ASSERT_TRUE(trials.primitive().aborts.present());
    AbortStudy study;
    study.seed = 20'26;
    std::vector<double> with, without;
    for (int i = 0; i < kAborts; ++i) {
      Normal random(77, static_cast<std::uint64_t>(i));
      AbortTrial trial;
      trial.variation = AbortRobot(study, trials.shared(), i);
      trial.time_s = random.DrawUniform() * trials.primitive().duration_s;
      trial.late_s = 0.005 + 0.015 * random.DrawUniform();
      trial.cause = static_cast<AbortCause>(i % kAbortCauseCount);
      trial.table = trials.primitive().aborts;
      with.push_back(PlayJudged(trials, trial).impact_m_s);
      trial.table = {};
      without.push_back(PlayJudged(trials, trial).impact_m_s);
    }
    std::ranges::sort(with);
    std::ranges::sort(without);
    // Half of the aborts end gently either way: what tells is how hard the others are.
    constexpr std::size_t kHard = kAborts * 9 / 10;
    fmt::print("{} of {}: 90 % {:.2f} and {:.2f}, worst {:.2f} and {:.2f} m/s\n", name,
               protocol.name, with[kHard], without[kHard], with.back(), without.back());
    EXPECT_LT(with[kHard], 0.6 * without[kHard]);
    EXPECT_LT(with.back(), without.back());
  }
}

TEST_P(AbortsOnTheWire, AMotionWhoseDrivesHaveLostTheirHeartbeatsIsRolledOut) {
  const TestedProtocol& protocol = GetParam();
  SharedRobot shared = TrialsWith(protocol, "handstand").shared();
  std::vector<std::uint32_t> heartbeats;
  for (DriveEntry& entry : shared.drives.drives) {
    protocol.side->Hasten(entry.config);
    const std::uint32_t id = protocol.side->HeartbeatId(entry.config);
    if (id != 0) heartbeats.push_back(id);
  }
  if (heartbeats.empty()) GTEST_SKIP() << "these drives have none";
  const AbortTrials trials(SimulatedMotion(LoadMotion(Shipped("handstand"))), shared);
  AbortTrial trial;
  trial.variation = AbortRobot({}, shared, 1);
  trial.time_s = 0.3;
  trial.cause = AbortCause::kSilence;
  trial.silent_s = 10;
  trial.silent_ids = heartbeats;
  trial.table = OneWayTable(trials.primitive(), AbortWay::kRollOut);
  const AbortOutcome outcome = PlayJudged(trials, trial);
  EXPECT_EQ(outcome.fault, Fault::kHeartbeatLost);
  EXPECT_EQ(outcome.reaction, Reaction::kRollOut);
  EXPECT_LT(outcome.impact_m_s, 0.6);
}

INSTANTIATE_TEST_SUITE_P(Protocols, AbortsOnTheWire, ::testing::ValuesIn(EveryProtocol()),
                         [](const auto& given) { return given.param.name; });

TEST(AbortProgram, PrintsTheTableAndWritesItOnlyWhenToldTo) {
  const testing::TemporaryFolder folder;
  const std::string file = folder / "handstand.toml";
  const std::string shipped = testing::ReadFile(Shipped("handstand"));
  testing::WriteFile(file, shipped);
  const std::vector<std::string> arguments = {"tumbler abort", file,  "--robots", "2",
                                              "--step",        "0.3", "--json",   "-"};
  const testing::Outcome looked = testing::RunProgram(arguments);
  EXPECT_EQ(looked.exit_code, 0) << looked.text;
  EXPECT_THAT(looked.text, HasSubstr("best"));
  EXPECT_THAT(looked.text, HasSubstr("\"impact_max_m_s\""));
  EXPECT_EQ(testing::ReadFile(file), shipped);
  std::vector<std::string> writing = arguments;
  writing.emplace_back("--write");
  const testing::Outcome wrote = testing::RunProgram(writing);
  EXPECT_EQ(wrote.exit_code, 0) << wrote.text;
  EXPECT_THAT(wrote.text, HasSubstr("wrote the table into " + file));
  const testing::Outcome checked = testing::RunProgram({"tumbler abort", file, "--check", "4"});
  EXPECT_EQ(checked.exit_code, 0) << checked.text;
  EXPECT_THAT(checked.text, HasSubstr("setpoints outside their limits: 0"));
}

TEST(AbortProgram, SaysWhatItCannotDo) {
  const auto refused = [](const std::vector<std::string>& arguments, int status,
                          const char* problem) {
    std::vector<std::string> all = {"tumbler abort"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const testing::Outcome outcome = testing::RunProgram(all);
    EXPECT_EQ(outcome.exit_code, status) << outcome.text;
    EXPECT_THAT(outcome.text, HasSubstr(problem));
  };
  const testing::TemporaryFolder folder;
  PrimitiveFile bare = LoadPrimitive(Shipped("handstand"));
  bare.primitive.aborts = {};
  bare.abort_figure.reset();
  testing::WriteFile(folder / "bare.toml", ToToml(bare));
  refused({Shipped("gait")}, 2, "is a sequence");
  refused({folder / "bare.toml", "--check", "3"}, 2, "has no table of aborts");
  refused({Shipped("handstand"), "--check", "3", "--write"}, 1, "--write");
  refused({folder / "none.toml"}, 1, "none.toml");
  refused({Shipped("handstand"), "--robots", "0"}, 1, "--robots");
}

TEST(AbortProgram, AnInterruptedOneWritesNothing) {
  const testing::TemporaryFolder folder;
  const std::string file = folder / "roll.toml";
  const std::string shipped = testing::ReadFile(Shipped("roll"));
  testing::WriteFile(file, shipped);
  testing::Program program({testing::ProgramPath("tumbler abort"), file, "--write", "--robots",
                            "500", "--threads", "1"});
  ASSERT_TRUE(program.WaitFor("aborts"));
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 130) << program.text();
  EXPECT_THAT(program.text(), HasSubstr("interrupted: nothing was written"));
  EXPECT_EQ(testing::ReadFile(file), shipped);
}

}  // namespace
}  // namespace tumbler
