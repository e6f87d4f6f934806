// What is said of robots that differ from the model, and how much work is divided and kept.

#include "offline/studies/study.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"
#include "offline/studies/certify.h"
#include "offline/studies/checkpoint.h"
#include "offline/studies/lane_trials.h"
#include "offline/studies/robustness_page.h"
#include "tests/support/files.h"
#include "tests/support/robustness_study.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;
using ::testing::HasSubstr;

TEST(Share, TheIntervalIsThatOfWilson) {
  const Share share = ShareOf(97, 100);  // [W27]; R's binom.confint gives the same
  EXPECT_NEAR(share.low, 0.9155, 5e-4);
  EXPECT_NEAR(share.high, 0.9897, 5e-4);
  EXPECT_EQ(ShareOf(10, 10).high, 1);
  EXPECT_NEAR(ShareOf(10, 10).low, 0.7225, 5e-4);
  EXPECT_EQ(ShareOf(0, 10).low, 0);
}

TEST(Checkpoint, RobotsThatArePushedAreOtherRobots) {
  RobustnessStudy study = StudyOf("handstand.toml");
  const std::string calm = IdentityOf(study);
  study.push_n = 5;
  const std::string pushed = IdentityOf(study);
  study.sensor_faults = true;
  EXPECT_NE(calm, pushed);
  EXPECT_NE(pushed, IdentityOf(study));
  study.drops = true;
  EXPECT_NE(IdentityOf(study), pushed);
}

std::string Refusal(const std::function<void()>& work) {
  try {
    work();
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

RobustnessResult Planned(const RobustnessStudy& study, const WorkPlan& plan) {
  const WorkDone work = RunStudy(study, plan, Processes());
  EXPECT_TRUE(work.result);
  return work.result.value_or(RobustnessResult{});
}

TEST(Checkpoint, AWorkInPartsGivesTheBytesOfTheWhole) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  const std::string whole = ToJson(RunStudy(study, 20, 1)).Dump(2);
  WorkPlan part;
  part.robots = 20;
  part.shards = 3;
  for (part.shard = 1; part.shard <= 3; ++part.shard) {
    part.checkpoint = folder / ("part" + std::to_string(part.shard));
    const WorkDone work = RunStudy(study, part, Processes());
    EXPECT_FALSE(work.result) << "the other parts are not known here";
    EXPECT_EQ(work.known, part.shard <= 2 ? 7 : 6);
  }
  WorkPlan merged;
  merged.robots = 20;
  merged.merged = {folder / "part3", folder / "part1", folder / "part2"};
  EXPECT_EQ(ToJson(Planned(study, merged)).Dump(2), whole);
  // One part is missing: its robots are played again.
  merged.merged.pop_back();
  EXPECT_EQ(ToJson(Planned(study, merged)).Dump(2), whole);
}

TEST(Checkpoint, WhatIsThereIsNotPlayedAgainAndABrokenLastLineIs) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  WorkPlan plan;
  plan.robots = 12;
  plan.checkpoint = folder / "robots";
  const std::string whole = ToJson(Planned(study, plan)).Dump(2);
  const std::string lines = testing::ReadFile(plan.checkpoint);
  EXPECT_EQ(ToJson(Planned(study, plan)).Dump(2), whole);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines) << "nothing had to be added";
  testing::WriteFile(plan.checkpoint, lines.substr(0, lines.size() - 30));
  EXPECT_EQ(ToJson(Planned(study, plan)).Dump(2), whole);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines);
  // What a file says of a robot is taken from there.
  testing::WriteFile(
      plan.checkpoint,
      lines.substr(0, lines.find('\n') + 1) +
          "{\"robot\":0,\"verdict\":\"overlap\",\"motions\":1,\"in\":\"x\","
          "\"reason\":\"y\",\"left_s\":0.5,\"rests\":false,\"drops\":0,\"lies_rad\":0.0,"
          "\"begun\":\"\"}\n");
  EXPECT_EQ(Planned(study, plan).trials[0].verdict, Verdict::kOverlap);
}

TEST(Checkpoint, TwoStudiesDoNotWriteIntoOneFileAtOnce) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  WorkPlan plan;
  plan.robots = 8;
  plan.checkpoint = folder / "robots";
  Planned(study, plan);
  const std::string lines = testing::ReadFile(plan.checkpoint);
  plan.robots = 16;
  {
    const WriterLock other(plan.checkpoint);
    EXPECT_NE(Refusal([&] { Planned(study, plan); }).find("is being written by another program"),
              std::string::npos);
    EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines);
  }
  EXPECT_EQ(Planned(study, plan).trials.size(), 16U);
}

TEST(Checkpoint, AFileOfOtherRobotsOrNoneIsRefusedAndLeftAsItIs) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  WorkPlan plan;
  plan.robots = 8;
  plan.checkpoint = folder / "robots";
  Planned(study, plan);
  const std::string lines = testing::ReadFile(plan.checkpoint);
  RobustnessStudy other = study;
  other.seed = 18;
  EXPECT_NE(Refusal([&] { Planned(other, plan); }).find("about other robots"), std::string::npos);
  other = study;
  other.spreads.zero_rad = 0.01;
  EXPECT_NE(Refusal([&] { Planned(other, plan); }).find("about other robots"), std::string::npos);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines);
  testing::WriteFile(plan.checkpoint, "some notes");
  EXPECT_NE(Refusal([&] { Planned(study, plan); }).find("no checkpoint"), std::string::npos);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), "some notes");
  testing::WriteFile(plan.checkpoint, lines.substr(0, lines.find('\n') + 1) + "{\"robot\":1}\n");
  EXPECT_NE(Refusal([&] { Planned(study, plan); }).find(":2: is not the outcome"),
            std::string::npos)
      << Refusal([&] { Planned(study, plan); });
  // Numbers that are too large for their kind, two lines that became one, and other members.
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"\"motions\":1,", "\"motions\":4294967297,"},
           {"\"robot\":", "\"robot\":59,\"robot\":"},
           {"\"rests\":", "\"note\":1,\"rests\":"}}) {
    const std::size_t at = lines.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    std::string edited = lines;
    edited.replace(at, from.size(), to);
    testing::WriteFile(plan.checkpoint, edited);
    EXPECT_NE(Refusal([&] { Planned(study, plan); }).find(": is not the outcome"),
              std::string::npos)
        << to;
  }
}

TEST(RobustnessStudy, ThreadsChangeNotAByte) {
  const RobustnessStudy study = StudyOf("nominal/handstand.toml");
  const RobustnessResult one = RunStudy(study, 6, 1);
  const RobustnessResult three = RunStudy(study, 6, 3);
  EXPECT_EQ(ToJson(one).Dump(2), ToJson(three).Dump(2));
  EXPECT_EQ(ToText(one), ToText(three));
  EXPECT_EQ(static_cast<int>(one.trials.size()), 6);
  // A robot is the same in a larger study.
  Trials trials(study);
  EXPECT_EQ(trials.Play(4).verdict, one.trials[4].verdict);
}

TEST(RobustnessStudy, WhatFailuresHaveInCommonComesFirst) {
  RobustnessResult result;
  for (std::uint64_t i = 0; i < 400; ++i) {
    TrialOutcome trial;
    trial.variation = DrawRobot(TumblerScene(), {}, 1, 3, i);
    if (trial.variation.friction < 0.75) trial.verdict = Verdict::kFell;
    result.trials.push_back(trial);
  }
  const auto influences = result.Influences();
  ASSERT_FALSE(influences.empty());
  EXPECT_EQ(influences.front().name, "friction");
  EXPECT_LT(influences.front().mean_sigma, -1.2);
  EXPECT_GT(influences.front().significance, 3);
  EXPECT_LT(influences[1].significance, 3.5);
}

TEST(RobustnessStudy, WhatHasNoInfluenceIsNotSaidToTellOfFewFailures) {
  Spreads many;
  for (double Spreads::*spread :
       {&Spreads::inertia, &Spreads::length, &Spreads::gain, &Spreads::torque_limit,
        &Spreads::start_rad, &Spreads::start_rate_rad_s})
    many.*spread = 1e-9;
  int studies = 0, wrong = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    for (const std::uint64_t failures : {1U, 2U, 5U}) {
      RobustnessResult result;
      for (std::uint64_t i = 0; i < 200; ++i) {
        TrialOutcome trial;
        trial.variation = DrawRobot(TumblerScene(), many, 1, seed, i);
        if (i < failures) trial.verdict = Verdict::kFell;  // whatever it is like
        result.trials.push_back(trial);
      }
      const auto influences = result.Influences();
      ++studies;
      if (std::any_of(influences.begin(), influences.end(),
                      [](const Influence& influence) { return influence.telling(); }))
        ++wrong;
    }
  }
  EXPECT_LE(wrong, studies / 50) << "of " << studies;
}

TEST(RobustnessStudy, WhatCannotBeJudgedInTheHoldIsRefused) {
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/hopper/hopper.toml");
  study.run.hold_s = 0;
  EXPECT_THROW(Trials trials(study), Refused);
  study.lanes = true;
  EXPECT_THROW(LaneTrials trials(study), Refused);
}

TEST(RobustnessStudy, RobotsThatWereNotJudgedAreInNoShareAndInNoCertificate) {
  RobustnessResult result;
  result.name = "motion";
  result.study.motion = testing::SourcePath("primitives/nominal/handstand.toml");
  result.trials.resize(10);
  result.trials[0].verdict = Verdict::kAmiss;
  result.trials[1].verdict = result.trials[2].verdict = Verdict::kNotJudged;
  result.trials[1].reason = result.trials[2].reason = "nobody looked";
  EXPECT_EQ(result.stands().count, 7);
  EXPECT_EQ(result.stands().of, 8);
  const std::string text = ToText(result);
  EXPECT_THAT(text, HasSubstr("7 of 8 robots that were judged are as asked after every motion"));
  EXPECT_THAT(text, HasSubstr("2 robots were not judged: nobody looked"));
  const Json json = ToJson(result);
  EXPECT_EQ(json["robots"].number(), 10);
  EXPECT_EQ(json["judged"].number(), 8);
  EXPECT_EQ(json["not_as_asked"].size(), 1U);
  EXPECT_EQ(json["not_judged"].size(), 2U);
  EXPECT_EQ(json["verdicts"]["not judged"].number(), 2);
  const std::string page = RobustnessPage(result);
  EXPECT_THAT(page, HasSubstr("7 of 8 robots that were judged are as asked"));
  EXPECT_THAT(page, HasSubstr("2 robots were not judged: nobody looked"));
  result.files = HashOfFiles(result.study);
  EXPECT_THROW(Certify(result), Refused);
  for (TrialOutcome& trial : result.trials) trial.verdict = Verdict::kNotJudged;
  EXPECT_THAT(ToText(result), HasSubstr("motion: none of 10 robots was judged"));
  EXPECT_THAT(RobustnessPage(result), HasSubstr("<p class=share>not judged</p>"));
}

TEST(RobustnessStudy, OfRobotsThatWereDroppedNobodySaysThatTheyKeptToTheModelsWay) {
  RobustnessResult result;
  result.study.drops = true;
  TrialOutcome trial;
  trial.verdict = Verdict::kFell;
  trial.in = "handstand";
  result.trials = {trial};
  EXPECT_NE(ToText(result).find("    handstand: 1\n"), std::string::npos) << ToText(result);
  EXPECT_EQ(ToText(result).find("kept to it"), std::string::npos);
  EXPECT_EQ(ToJson(result)["where"].size(), 0U);
}

TEST(RobustnessStudy, TheMapHasEveryRobotInACellOfItsOwn) {
  RobustnessResult result;
  for (std::uint64_t i = 0; i < 400; ++i) {
    TrialOutcome trial;
    trial.variation = DrawRobot(TumblerScene(), {}, 1, 3, i);
    if (trial.variation.friction + trial.variation.damping < 1.7) trial.verdict = Verdict::kFell;
    result.trials.push_back(trial);
  }
  const auto map = result.Map();
  ASSERT_TRUE(map);
  EXPECT_EQ((std::set<std::string>{map->x, map->y}),
            (std::set<std::string>{"friction", "damping"}));
  int robots = 0, stand = 0;
  for (const auto& row : map->cells) {
    for (const auto& cell : row) {
      robots += cell.robots;
      stand += cell.stand;
    }
  }
  EXPECT_EQ(robots, 400);
  EXPECT_EQ(stand, result.stands().count);
  EXPECT_EQ(map->CellOf(-9), 0);
  EXPECT_EQ(map->CellOf(9), SuccessMap::kCells - 1);
  EXPECT_EQ(map->CellOf(0), SuccessMap::kCells / 2);
  EXPECT_NEAR(map->EdgeOf(1), -map->half_width, 1e-12);
  EXPECT_NEAR(map->EdgeOf(SuccessMap::kCells - 1), map->half_width, 1e-12);
  EXPECT_EQ(map->CellOf(map->EdgeOf(3) + 1e-9), 3);
  const auto& low = map->cells[1][1];
  const auto& high = map->cells[SuccessMap::kCells - 2][SuccessMap::kCells - 2];
  EXPECT_EQ(low.stand, 0);
  EXPECT_EQ(high.stand, high.robots);
}

TEST(RobustnessPage, ShowsShareMapAndEveryRobotAndTakesNamesAsText) {
  RobustnessResult result;
  result.name = "<b>&";
  for (std::uint64_t i = 0; i < 60; ++i) {
    TrialOutcome trial;
    trial.variation = DrawRobot(TumblerScene(), {}, 1, 3, i);
    if (trial.variation.friction < 0.85) {
      trial.verdict = Verdict::kFell;
      trial.in = "hand<stand";
      trial.left_s = 0.4;
    }
    result.trials.push_back(trial);
  }
  const std::string page = RobustnessPage(result);
  const auto count = [&page](const std::string& part) {
    int found = 0;
    for (auto at = page.find(part); at != std::string::npos; at = page.find(part, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("<circle"), 60);
  EXPECT_EQ(count("<line class=fell"), result.Count(Verdict::kFell)) << "a stroke for each fall";
  EXPECT_EQ(count("<rect"), SuccessMap::kCells * SuccessMap::kCells);
  EXPECT_EQ(count("<b>"), 0);
  EXPECT_GT(count("&lt;b&gt;&amp;"), 0);
  EXPECT_GT(count("hand&lt;stand"), 0);
  EXPECT_EQ(count("<script"), 0);
  EXPECT_GT(count("friction [standard deviations]"), 0);
}

}  // namespace
}  // namespace tumbler
