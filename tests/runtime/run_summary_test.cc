// What a run says of the robot when it is over.

#include "runtime/run/run_summary.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "common/files/json.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

JudgedTarget Pitch(std::optional<double> result) {
  return {{PurposeTarget::Of::kPitch, PurposeTarget::When::kLater, 1.57, 0.05}, result};
}
JudgedTarget Rest(std::optional<double> result) {
  return {{PurposeTarget::Of::kSpeed, PurposeTarget::When::kLater, 0, kRestSpeed}, result};
}

RunSummary SummaryOf(const Passage& passage) {
  RunSummary report;
  report.outcome = RunOutcome::kCompleted;
  report.passages.push_back(passage);
  return report;
}

TEST(RunSummaryOfAnInterface, NamesWhatWasLostInTheSocketAndInTheController) {
  RunSummary summary;
  summary.interface.emplace();
  summary.interface->statistics.dropped = 3;
  summary.interface->statistics.overflows = 7;
  EXPECT_THAT(ToText(summary),
              HasSubstr("3 received frames lost, 7 overflows of the controller, 0 commands of"));
  EXPECT_THAT(ToJson(summary), AllOf(HasSubstr("\"received_frames_lost\": 3"),
                                     HasSubstr("\"controller_overflows\": 7")));
}

TEST(Passage, SaysOnlyWhatWasSeen) {
  Passage report;
  report.expected_pitch_rad = 1.57;
  report.purpose = {Pitch(std::nullopt), Rest(std::nullopt)};
  EXPECT_FALSE(report.purpose_met().has_value());
  EXPECT_FALSE(report.as_planned().has_value());
  EXPECT_FALSE(report.amiss());
  report.purpose = {Pitch(1.53), Rest(std::nullopt)};
  EXPECT_FALSE(report.purpose_met().has_value()) << "whether it rests was not seen";
  report.purpose = {Pitch(1.53), Rest(0.01)};
  EXPECT_EQ(report.purpose_met(), true);
  report.purpose = {Pitch(1.53), Rest(0.3)};
  EXPECT_EQ(report.purpose_met(), false) << "it still moves";
  report.purpose = {Pitch(0.1), Rest(std::nullopt)};
  EXPECT_EQ(report.purpose_met(), false);
  EXPECT_TRUE(report.amiss());
}

TEST(Passage, WhatTheRunsEndLeftUnjudgedIsNotSaidToBeWhereItShouldBe) {
  RunSummary summary = SummaryOf({});
  summary.passages[0].purpose = {Pitch(1.57), Rest(0.01)};
  summary.passages.push_back(summary.passages[0]);
  summary.passages[1].purpose = {Pitch(1.57), Rest(std::nullopt)};
  EXPECT_TRUE(summary.passages[1].unjudged());
  const std::string text = ToText(summary);
  EXPECT_THAT(text, HasSubstr("the robot where it should be after each but 1, NOT JUDGED\n"));
  EXPECT_THAT(text, HasSubstr("speed of the root, 2 s later: not judged, the run ended before\n"));
  EXPECT_EQ(AsAsked(summary), std::nullopt);
  EXPECT_EQ(StatusOf(summary), ExitStatus::kAmiss);
  EXPECT_TRUE(Json::Parse(ToJson(summary)).value()["as_asked"].is_null());
  summary.passages[1].purpose[1].result = 0.01;
  EXPECT_EQ(AsAsked(summary), true);
  EXPECT_EQ(StatusOf(summary), ExitStatus::kDone);
  summary.passages[0].purpose[1].result = 0.4;
  EXPECT_EQ(AsAsked(summary), false);
}

TEST(Passage, OfAFixedRootOnlyThePurposeIsJudgedAndNothingWhereThereIsNone) {
  RunSummary summary = SummaryOf({});
  Passage& passage = summary.passages[0];
  passage.free_root = false;
  passage.pitch_later_rad = 0;
  EXPECT_EQ(passage.as_planned(), std::nullopt);
  EXPECT_EQ(passage.as_asked(), std::nullopt);
  EXPECT_THAT(ToText(summary), HasSubstr("root fixed: NOT JUDGED\n    its task asks for nothing"));
  EXPECT_EQ(AsAsked(summary), std::nullopt);
  EXPECT_EQ(StatusOf(summary), ExitStatus::kDone) << "nothing was asked";
  passage.purpose = {{{PurposeTarget::Of::kPointZ, PurposeTarget::When::kEnd, 0.3, 0.02}, 0.29}};
  EXPECT_THAT(ToText(summary), HasSubstr("root fixed: as asked\n    point_z"));
  EXPECT_EQ(AsAsked(summary), true);
  passage.purpose[0].result = 0.2;
  EXPECT_THAT(ToText(summary), HasSubstr("root fixed: NOT as asked\n"));
  EXPECT_EQ(StatusOf(summary), ExitStatus::kAmiss);
}

TEST(Passage, TheFirstThatAreAmissAreNamedWithWhatFollowedThem) {
  RunSummary summary = SummaryOf({});
  summary.passages[0].node = "up";
  summary.passages[0].purpose = {Pitch(0.1), Rest(std::nullopt)};
  summary.passages.push_back(summary.passages[0]);
  summary.passages[1].node = "up to the other side";
  summary.passages[1].purpose = {Pitch(1.57), Rest(0.01)};
  EXPECT_THAT(ToText(summary), HasSubstr("NOT where it should be after 1 ('up' before 'up to the "
                                         "other side')\n"));
  summary.passages.assign(5, summary.passages[0]);
  EXPECT_THAT(ToText(summary), HasSubstr("after 5 ('up' before 'up', 'up' before 'up', 'up' before "
                                         "'up', ...)\n"));
}

TEST(Passage, OfARobotThatFellAfterEachWasJudgedItIsSaidThatItFell) {
  RunSummary summary = SummaryOf({});
  summary.passages[0].purpose = {Pitch(1.57), Rest(0.01)};
  summary.passages.push_back(summary.passages[0]);
  summary.statistics.get_ups = 1;
  EXPECT_THAT(ToText(summary),
              HasSubstr("the robot where it should be when each was judged, but it "
                        "FELL\n"));
}

TEST(Passage, SaysAfterWhatTimeItWasJudged) {
  Passage report;
  report.expected_pitch_rad = 1.57;
  report.pitch_later_rad = 1.56;
  report.later_s = 4;
  report.purpose = {Pitch(1.56), Rest(0.01)};
  report.purpose[0].after_s = 4;
  const std::string text = ToText(SummaryOf(report));
  EXPECT_THAT(text, HasSubstr("1.5600 rad 4 s later (planned 1.5700): at rest as asked\n"));
  EXPECT_THAT(text, HasSubstr("    pitch, 4 s later: asked 1.57, got 1.56 rad (within 0.05)\n"));
  const auto json = Json::Parse(ToJson(SummaryOf(report))).value();
  EXPECT_EQ(json["passages"][0]["later_s"], 4);
  EXPECT_EQ(json["passages"][0]["purpose"][0]["after_s"], 4);
  EXPECT_TRUE(json["passages"][0]["purpose"][1]["after_s"].is_null());
}

TEST(Passage, WithoutATargetThatIsJudgedMeetsNoPurpose) {
  RunSummary summary = SummaryOf({});
  summary.simulated = true;
  ASSERT_TRUE(summary.passages.back().purpose.empty());
  const auto json = Json::Parse(ToJson(summary)).value();
  EXPECT_TRUE(json["purpose_met"].is_null());
  EXPECT_TRUE(json["passages"][0]["purpose_met"].is_null());
}

TEST(Passage, AMotionThatWasBrokenOffIsNotJudgedByTheOneBefore) {
  RunSummary summary = SummaryOf({});
  summary.passages[0].node = "handstand";
  summary.passages[0].purpose = {Pitch(1.57), Rest(0.01)};
  summary.passages[0].expected_pitch_rad = 1.57;
  summary.passages[0].pitch_later_rad = 1.57;
  summary.broken_off = "downstand";
  EXPECT_THAT(ToText(summary), AllOf(HasSubstr("  downstand: broken off\n"),
                                     HasSubstr("  before, handstand: root pitch")));
  const auto json = Json::Parse(ToJson(summary)).value();
  EXPECT_EQ(json["broken_off"], "downstand");
  EXPECT_TRUE(json["purpose_met"].is_null());
  EXPECT_TRUE(json["as_planned_2_s_later"].is_null());
  EXPECT_EQ(json["passages"].size(), 1U);
  summary.passages.clear();  // the first of all was broken off
  EXPECT_TRUE(Json::Parse(ToJson(summary)).value().Find("purpose_met") == nullptr);
  summary.simulated = true;
  EXPECT_TRUE(Json::Parse(ToJson(summary)).value()["purpose_met"].is_null());
}

TEST(Passage, ARobotIsAtRestAsAskedOnlyWhenItsPurposeIsMetWhateverItsPlanEndedIn) {
  Passage report;
  report.expected_pitch_rad = report.pitch_at_end_rad = 1.56;
  report.pitch_later_rad = 1.56;
  report.purpose = {Pitch(1.56), Rest(0.01)};
  EXPECT_THAT(ToText(SummaryOf(report)),
              AllOf(HasSubstr("root pitch: 1.5600 rad at the end, 1.5600 rad 2 s later (planned "
                              "1.5600): at rest as asked\n"),
                    HasSubstr("    pitch, 2 s later: asked 1.57, got 1.56 rad (within 0.05)\n")));
  EXPECT_EQ(Json::Parse(ToJson(SummaryOf(report))).value()["purpose_met"], true);
  // The plan fell, and the robot with it.
  report.expected_pitch_rad = report.pitch_at_end_rad = 3.1;
  report.pitch_later_rad = 3.1;
  report.purpose = {Pitch(3.1), Rest(0.01)};
  EXPECT_EQ(report.as_planned(), true);
  const std::string text = ToText(SummaryOf(report));
  EXPECT_THAT(text, HasSubstr(": NOT at rest as asked\n"));
  EXPECT_THAT(text, HasSubstr("asked 1.57, got 3.1 rad (within 0.05): MISSED\n"));
  EXPECT_EQ(StatusOf(SummaryOf(report)), ExitStatus::kAmiss);
  EXPECT_EQ(Json::Parse(ToJson(SummaryOf(report))).value()["purpose_met"], false);
}

TEST(Passage, OfAMotionWithoutATargetOfThePitchNothingSpeaksOfPitchOrOfStanding) {
  Passage report;
  report.pitch_later_rad = 0.01;
  report.purpose = {{{PurposeTarget::Of::kX, PurposeTarget::When::kLater, 0.2, 0.02}, 0.009},
                    Rest(0.01)};
  const std::string text = ToText(SummaryOf(report));
  EXPECT_THAT(text, AllOf(HasSubstr("(within 0.05): as planned, but NOT as asked"),
                          HasSubstr("x, 2 s later: asked 0.2, got 0.009 m (within 0.02): MISSED"),
                          Not(HasSubstr("pitch")), Not(HasSubstr("stand"))));
  EXPECT_THAT(ToJson(SummaryOf(report)), AllOf(Not(HasSubstr("pitch")), Not(HasSubstr("stand"))));
  EXPECT_EQ(StatusOf(SummaryOf(report)), ExitStatus::kAmiss);
  report.purpose[0].result = 0.195;
  EXPECT_THAT(ToText(SummaryOf(report)), AllOf(HasSubstr("as planned"), Not(HasSubstr("NOT"))));
  EXPECT_EQ(StatusOf(SummaryOf(report)), ExitStatus::kDone);
}

TEST(Passage, OfARobotThatSwingsOnOnlyThePurposeCountsAndNothingStands) {
  Passage report;
  report.hinged = report.swings_on = true;
  report.expected_pitch_rad = 3.14;
  report.pitch_at_end_rad = 3.13;
  report.pitch_later_rad = -2.4;
  report.purpose = {{{PurposeTarget::Of::kPitch, PurposeTarget::When::kSettled, 3.14, 0.1}, 3.12}};
  EXPECT_FALSE(report.as_planned().has_value());
  const std::string met = ToText(SummaryOf(report));
  EXPECT_THAT(met, AllOf(HasSubstr("root pitch: 3.1300 rad at the end, as asked; -2.4000 rad 2 s "
                                   "later, swinging on\n"),
                         Not(HasSubstr("stand")), Not(HasSubstr("planned"))));
  EXPECT_EQ(StatusOf(SummaryOf(report)), ExitStatus::kDone);
  EXPECT_THAT(ToJson(SummaryOf(report)), Not(HasSubstr("standing")));
  report.purpose[0].result = 2.9;
  EXPECT_THAT(ToText(SummaryOf(report)), HasSubstr("rad at the end, NOT as asked; -2.4"));
  EXPECT_EQ(StatusOf(SummaryOf(report)), ExitStatus::kAmiss);
}

TEST(SensorOfARun, IsInTextAndJsonWhereThereIsOne) {
  RunSummary summary;
  EXPECT_EQ(ToText(summary).find("sensor"), std::string::npos);
  EXPECT_EQ(ToJson(summary).find("sensor"), std::string::npos);
  LoopStatistics& statistics = summary.statistics;
  statistics.sensor = SensorStatus::kFrozen;
  statistics.sensor_ticks[static_cast<std::size_t>(SensorStatus::kOk)] = 700;
  statistics.sensor_ticks[static_cast<std::size_t>(SensorStatus::kFrozen)] = 20;
  statistics.feedback_ticks = 710;
  EXPECT_NE(ToText(summary).find("sensor: frozen at last, ok in 700 ticks; feedback in 710"),
            std::string::npos)
      << ToText(summary);
  const Json json = Json::Parse(ToJson(summary)).value();
  EXPECT_EQ(json["sensor"]["status"], "frozen");
  EXPECT_EQ(json["sensor"]["feedback_ticks"], 710);
  EXPECT_EQ(json["sensor"]["ticks"]["ok"], 700);
  EXPECT_EQ(json["sensor"]["ticks"]["frozen"], 20);
}

TEST(StatusOfARun, SaysWhenTheSimulatedRobotWentThroughItself) {
  RunSummary report;
  report.outcome = RunOutcome::kCompleted;
  report.simulated = true;
  report.overlaps.push_back({0.549, "GOES THROUGH ITSELF: leg1_link/1 and leg2_link/0 overlap"});
  EXPECT_EQ(StatusOf(report), ExitStatus::kAmiss);
  EXPECT_THAT(ToText(report),
              ::testing::HasSubstr("at 0.549 s the robot GOES THROUGH ITSELF: leg1_link/1"));
  EXPECT_THAT(ToJson(report), ::testing::HasSubstr("\"overlaps\""));
  EXPECT_EQ(ToOutcome(report),
            "completed; at 0.549 s the robot GOES THROUGH ITSELF: leg1_link/1 and leg2_link/0 "
            "overlap");
}

TEST(StatusOfARun, SaysWhenTheMotionWasCompletedButTheRobotIsElsewhere) {
  RunSummary report;
  report.outcome = RunOutcome::kCompleted;
  EXPECT_EQ(StatusOf(report), ExitStatus::kDone);
  Passage& passage = report.passages.emplace_back();
  passage.node = "handstand";
  passage.expected_pitch_rad = 1.57;
  passage.pitch_later_rad = 1.56;
  EXPECT_EQ(StatusOf(report), ExitStatus::kDone);
  passage.pitch_later_rad = 3.1;
  EXPECT_EQ(StatusOf(report), ExitStatus::kAmiss);
  EXPECT_EQ(ToOutcome(report), "completed; NOT as asked; handstand: NOT where it should be");
  report.outcome = RunOutcome::kFault;
  EXPECT_EQ(StatusOf(report), ExitStatus::kFault);
}

}  // namespace
}  // namespace tumbler
