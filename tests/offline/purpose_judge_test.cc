// PurposeJudge compares what a simulated robot does with what its motions are for.

#include "offline/twin/purpose_judge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/sequence_files.h"
#include "tests/support/tumbler_robot.h"

namespace tumbler {
namespace {

using Of = PurposeTarget::Of;
using When = PurposeTarget::When;
using testing::SequenceFolder;

constexpr double kPi = std::numbers::pi;
constexpr double kMotion_s = 1;

const PlanarRobot& Tumbler() {
  static const PlanarRobot robot = LoadTumbler();
  return robot;
}

/// A gait whose first primitive is to be upright and at rest, 0.1 m to the right of its start.
class Judge : public ::testing::Test {
 protected:
  static std::vector<PrimitiveFile> Primitives() {
    std::vector<PrimitiveFile> files = testing::GaitPrimitives();
    files[0].primitive.settle_s = 0.5;
    files[0].entry.root_x_m = 0.5;
    files[0].purpose = {{{Of::kPitchRate, When::kEnd, 0, 0.1}, 0},
                        {{Of::kPitch, When::kSettled, kPi / 2, 0.05}, kPi / 2},
                        {{Of::kX, When::kLater, 0.6, 0.02}, 0.6},
                        {{Of::kSpeed, When::kLater, 0, kRestSpeed}, 0}};
    return files;
  }

  static TwinState WithJoints() {
    TwinState truth;
    truth.joint_positions_rad = truth.joint_velocities_rad_s = {0, 0};
    return truth;
  }

  /// Lets a tick pass.
  void Tick(ExecutorState state, const std::string& node, double time_s,
            Reaction reaction = Reaction::kIgnore, double primitive_time_s = 0) {
    TickRecord record;
    record.primitive_time_s = static_cast<float>(primitive_time_s);
    record.state = state;
    record.reaction = reaction;
    record.node = static_cast<decltype(record.node)>(file_.graph.FindNode(node));
    truth_.time_ns = std::llround(1e9 * time_s);
    judge_->Observe(record, truth_.time_ns, truth_);
  }
  /// Plays the node from this time on, and lets it settle and hold for so long in all.
  void Play(const std::string& node, double start_s, double after_s) {
    const int ticks = 100;
    Tick(ExecutorState::kRunning, node, start_s);
    truth_.root_x_m += 0.1;
    truth_.root_pitch_rad += kPi / 2;
    truth_.root_pitch_rate_rad_s = 0.05;
    Tick(ExecutorState::kRunning, node, start_s + kMotion_s - 0.01);
    for (int i = 0; i <= after_s * ticks; ++i) {
      const double t = static_cast<double>(i) / ticks;
      if (t > 0.2) truth_.root_pitch_rate_rad_s = 0;
      if (disturb_) disturb_(t);
      Tick(t < 0.5 ? ExecutorState::kSettling : ExecutorState::kHolding, node,
           start_s + kMotion_s + t);
    }
  }
  /// Plays the first node and lets it settle for 4 s, as the edge that is taken says.
  void SettleLong(const std::function<double(double)>& pitch_rate_rad_s) {
    Tick(ExecutorState::kRunning, "up", 0);
    truth_.root_x_m += 0.1;
    truth_.root_pitch_rad = kPi / 2;
    for (double t = 0; t < 4; t += 0.01) {
      truth_.root_pitch_rate_rad_s = pitch_rate_rad_s(t);
      Tick(ExecutorState::kSettling, "up", kMotion_s + t);
    }
  }
  [[nodiscard]] const std::vector<JudgedTarget>& purpose() const {
    return judge_->passages().at(0).purpose;
  }

  const SequenceFolder folder_{testing::GaitText(), Primitives()};
  const SequenceFile file_ = LoadSequence(folder_.file());
  std::optional<PurposeJudge> judge_{std::in_place, file_, Tumbler()};
  TwinState truth_ = WithJoints();
  std::function<void(double)> disturb_;  ///< Changes the truth so long after a motion.
};

/// The same, with what is asked for in the motion, and of a point: the end of leg 1, which hinges
/// 0.15 m from the middle and is 0.2 m long.
class JudgeOfPoints : public Judge {
 protected:
  static PurposeTarget Foot(Of of, When when, double target, double tolerance) {
    PurposeTarget foot{of, when, target, tolerance};
    foot.link = "leg1_link";
    foot.point_m = {0.2, 0};
    return foot;
  }
  static std::vector<PrimitiveFile> Timed() {
    std::vector<PrimitiveFile> files = Primitives();
    PurposeTarget under_way{Of::kPitch, When::kTime, 0.7, 0.05, 0.5 * kMotion_s};
    PurposeTarget settling{Of::kX, When::kTime, 0.6, 0.02, kMotion_s + 0.25};
    PurposeTarget swinging = Foot(Of::kPointZRate, When::kTime, 1, 0.1);
    swinging.time_s = 0.3;
    files[0].purpose = {{Foot(Of::kPointX, When::kSettled, 0.6, 0.02), 0.6},
                        {Foot(Of::kPointZ, When::kSettled, 0.65, 0.02), 0.65},
                        {under_way, 0.7},
                        {swinging, 1},
                        {settling, 0.6}};
    return files;
  }
  /// Plays the node, in which the pitch goes on evenly to an eighth of a turn and then at once to
  /// the end, where the leg that has the role of leg 1 is straight and the other one is folded.
  void Swing(const std::string& node, std::size_t leg, double start_s) {
    const double pitch_rad = truth_.root_pitch_rad;
    for (int i = 0; i < 100; ++i) {
      const double t = 0.01 * i;
      truth_.root_pitch_rad = pitch_rad + kPi / 4 * t / kMotion_s;
      truth_.root_pitch_rate_rad_s = kPi / 4 / kMotion_s;
      truth_.joint_velocities_rad_s[leg] = i == 30 ? 5 : 0;
      Tick(ExecutorState::kRunning, node, start_s + t, Reaction::kIgnore, t);
    }
    truth_.root_x_m += 0.1;
    truth_.root_z_m = 0.3;
    truth_.root_pitch_rad = pitch_rad + kPi / 2;
    truth_.root_pitch_rate_rad_s = 0;
    truth_.joint_velocities_rad_s = {0, 0};
    truth_.joint_positions_rad[1 - leg] = 1.5;
    for (int i = 0; i < 100; ++i) {
      Tick(i < 50 ? ExecutorState::kSettling : ExecutorState::kHolding, node,
           start_s + kMotion_s + 0.01 * i);
    }
  }
  const SequenceFolder timed_{testing::GaitText(), Timed()};
  const SequenceFile timed_file_ = LoadSequence(timed_.file());
};

TEST_F(JudgeOfPoints, TakesPointsOfLinksAndEachTimeInTheMotionAtThatTime) {
  judge_.emplace(timed_file_, Tumbler());
  truth_.root_x_m = 7;
  Swing("up", 0, 3);
  ASSERT_EQ(purpose().size(), 5U);
  EXPECT_NEAR(*purpose()[0].result, 0.5 + 0.1, 1e-9) << "the leg stands on end";
  EXPECT_NEAR(*purpose()[1].result, 0.3 + 0.35, 1e-9);
  EXPECT_NEAR(*purpose()[2].result, kPi / 8, 1e-9);
  EXPECT_NEAR(*purpose()[2].after_s, 0.5 - timed_file_.PrimitiveOf(0).primitive.duration_s, 1e-6);
  EXPECT_EQ(purpose()[2].name(), "pitch, at 0.5 s");
  // The root's rate at a lever of 0.35 m, and the leg's at one of 0.2 m, both turned by the pitch.
  const double pitch_rad = 0.3 * kPi / 4;
  EXPECT_NEAR(*purpose()[3].result, (0.35 * kPi / 4 + 0.2 * 5) * std::cos(pitch_rad), 1e-6);
  EXPECT_NEAR(*purpose()[4].result, 0.6, 1e-12);
  EXPECT_TRUE(judge_->passages()[0].amiss()) << "the pitch was another at 0.5 s";
  for (const JudgedTarget& judged : purpose()) EXPECT_NE(judged.met(), std::nullopt);
}

TEST_F(JudgeOfPoints, InASwappedMotionAPointIsThatOfTheLegInTheRole) {
  judge_.emplace(timed_file_, Tumbler());
  truth_.root_pitch_rad = kPi;
  Swing("up, swapped", 1, 3);
  ASSERT_EQ(purpose().size(), 5U);
  EXPECT_NEAR(*purpose()[0].result, 0.5 + 0.1, 1e-9);
  EXPECT_NEAR(*purpose()[1].result, 0.3 + 0.35, 1e-9);
}

TEST_F(JudgeOfPoints, OfAPointThatTheRobotHasNotItIsSaidThatNobodyJudgesIt) {
  PlanarRobot other = Tumbler();
  for (PlanarLink& link : other.links) link.name += "_";
  judge_.emplace(timed_file_, other);
  Swing("up", 0, 3);
  EXPECT_FALSE(purpose()[0].met().has_value());
  EXPECT_EQ(purpose()[0].Verdict().rfind("not judged, its link is no link of the robot", 0), 0U)
      << purpose()[0].Verdict();
  EXPECT_TRUE(purpose()[2].met().has_value());
}

TEST_F(Judge, WhatWasNotSeenOfAMotionIsNotTakenFromTheNextOne) {
  Play("up", 0, 1.0);
  EXPECT_FALSE(purpose()[2].result.has_value());
  Play("up", 2.1, 2.5);  // the operator runs it again from the hold
  EXPECT_FALSE(purpose()[2].result.has_value());
  EXPECT_FALSE(judge_->passages()[0].pitch_later_rad.has_value());
  EXPECT_TRUE(judge_->passages()[0].unjudged());
  EXPECT_TRUE(judge_->passages()[1].purpose[2].result.has_value());
}

TEST_F(Judge, TakesEachResultAtItsInstantAndPlaceAlongXFromTheEntry) {
  truth_.root_x_m = 7;
  disturb_ = [this](double t) {
    if (t > 0.55) truth_.root_pitch_rad = kPi / 2 + 0.01;
  };
  Play("up", 3, 2.5);
  ASSERT_EQ(judge_->passages().size(), 1U);
  ASSERT_EQ(purpose().size(), 4U);
  EXPECT_EQ(purpose()[0].result, 0.05);
  EXPECT_EQ(purpose()[1].result, kPi / 2) << "what happens later does not count";
  EXPECT_NEAR(*purpose()[2].result, 0.6, 1e-12) << "it went 0.1 m from where it was";
  EXPECT_EQ(purpose()[3].result, 0);
  EXPECT_EQ(judge_->passages()[0].purpose_met(), true);
  EXPECT_NEAR(*judge_->passages()[0].pitch_later_rad, kPi / 2 + 0.01, 1e-12);
  EXPECT_TRUE(judge_->passages()[0].is_to_rest());
}

TEST_F(Judge, ARobotThatRocksIsNotAtRestInWhateverPhaseItIsSeen) {
  disturb_ = [this](double t) { truth_.root_pitch_rate_rad_s = t < 1.9 ? 0.2 : 0; };
  Play("up", 0, 2.5);
  EXPECT_EQ(purpose()[3].result, 0.2) << "0.1 s before";
  EXPECT_EQ(judge_->passages()[0].purpose_met(), false);
}

TEST(PurposeTargets, ThatWereCalculatedAndAre0ButForRoundingAreSaidToBe0) {
  PurposeTarget target;
  target.of = PurposeTarget::Of::kPitch;
  target.tolerance = 0.05;
  target.target = 2.9e-17;
  EXPECT_EQ(target.AskedAndGot(0.01), "asked 0, got 0.01 rad (within 0.05)");
  target.target = 2.9e-7;
  EXPECT_EQ(target.AskedAndGot(0.01), "asked 2.9e-07, got 0.01 rad (within 0.05)");
}

TEST_F(Judge, WhatTheRunDidNotReachIsAbsent) {
  Play("up", 0, 1.0);
  EXPECT_TRUE(purpose()[1].result.has_value());
  EXPECT_FALSE(purpose()[2].result.has_value());
  EXPECT_FALSE(purpose()[3].result.has_value());
  EXPECT_FALSE(judge_->passages()[0].purpose_met().has_value());
}

TEST_F(Judge, AMotionThatAnotherFollowsEarlierIsJudgedWhenThatBegins) {
  Play("up", 0, 0.4);
  EXPECT_FALSE(purpose()[2].result.has_value());
  Tick(ExecutorState::kRunning, "down", kMotion_s + 0.41);
  EXPECT_NEAR(*purpose()[2].result, 0.6, 1e-12);
  EXPECT_TRUE(judge_->passages()[0].purpose_met().has_value());
}

TEST_F(Judge, WhatIsAskedOfASettledRobotIsJudgedWhenTheSequenceLetsTheMotionSettleNoLonger) {
  SettleLong([](double t) { return t < 3 ? 0.2 : 0; });
  EXPECT_EQ(purpose()[0].result, 0.2) << "at the end of the motion";
  EXPECT_FALSE(purpose()[1].result.has_value());
  EXPECT_FALSE(purpose()[3].result.has_value());
  EXPECT_FALSE(judge_->passages()[0].pitch_later_rad.has_value());
  Tick(ExecutorState::kRunning, "down", kMotion_s + 4);
  EXPECT_EQ(purpose()[1].result, kPi / 2);
  EXPECT_EQ(purpose()[1].name(), "pitch, settled");
  EXPECT_EQ(purpose()[3].result, 0);
  EXPECT_EQ(purpose()[3].name(), "speed of the root, 4 s later");
  EXPECT_EQ(judge_->passages()[0].as_planned(), true);
  EXPECT_NEAR(judge_->passages()[0].later_s, 4, 1e-9);
}

TEST_F(Judge, ARobotThatRocksWhenTheNextMotionBeginsIsNotAsAsked) {
  SettleLong([](double t) { return t < 3 ? 0 : 0.2; });
  Tick(ExecutorState::kRunning, "down", kMotion_s + 4);
  EXPECT_EQ(purpose()[3].result, 0.2) << "though it was at rest after 2 s";
  EXPECT_TRUE(judge_->passages()[0].amiss());
}

TEST_F(Judge, ASettlingThatIsBrokenOffIsJudgedWhereTheRobotIsThenIfItsTimeHasCome) {
  for (const ExecutorState then : {ExecutorState::kStopping, ExecutorState::kFault,
                                   ExecutorState::kMovingToStart, ExecutorState::kDisarmed}) {
    for (const double after_s : {1.0, 3.0}) {
      judge_.emplace(file_, Tumbler());
      truth_ = WithJoints();
      Tick(ExecutorState::kRunning, "up", 0);
      truth_.root_x_m = 0.1;
      truth_.root_pitch_rad = kPi / 2;
      truth_.root_pitch_rate_rad_s = 0;
      for (double t = 0; t < after_s; t += 0.01)
        Tick(ExecutorState::kSettling, "up", kMotion_s + t);
      truth_.root_pitch_rad = 0.7;
      Tick(then, "up", kMotion_s + after_s);
      EXPECT_EQ(purpose()[1].result, 0.7);
      EXPECT_EQ(purpose()[2].result.has_value(), after_s > 2) << after_s;
      EXPECT_TRUE(judge_->passages()[0].amiss());
      truth_.root_pitch_rad = kPi / 2;
      Tick(then, "up", kMotion_s + after_s + 0.01);
      EXPECT_EQ(purpose()[1].result, 0.7) << "what happens later does not count";
    }
  }
}

TEST_F(Judge, ThePlanOfEachMotionBeginsAtItsEntryAndNotWhereExitsAddUpTo) {
  // Exits that are a little off the next entry, within its tolerance.
  std::vector<PrimitiveFile> files = Primitives();
  files[0].exit.root_pitch_rad += 2e-3;
  const SequenceFolder folder(testing::GaitText(), files);
  const SequenceFile file = LoadSequence(folder.file());
  judge_.emplace(file, Tumbler());
  const std::vector<std::string> nodes = {"up", "down", "up, swapped", "down, swapped"};
  for (int i = 0; i < 80; ++i) Play(nodes[static_cast<std::size_t>(i % 4)], 1.5 * i, 0.4);
  const std::vector<Passage>& passages = judge_->passages();
  ASSERT_EQ(passages.size(), 80U);
  EXPECT_NEAR(truth_.root_pitch_rad, 80 * kPi / 2, 1e-9);
  for (std::size_t i = 0; i < passages.size(); ++i) {
    EXPECT_NEAR(passages[i].expected_pitch_rad, static_cast<double>(i + 1) * kPi / 2, 2.1e-3) << i;
    EXPECT_NE(passages[i].as_planned(), false) << i;
  }
}

TEST_F(Judge, ALongRunKeepsAsManyPassagesAsAShortOneAndCountsAllOfThem) {
  const std::vector<std::string> nodes = {"up", "down", "up, swapped", "down, swapped"};
  std::int64_t amiss = 0;
  for (int i = 0; i < 1000; ++i) {
    // Two motions miss their pitch. Another one after it sets that right.
    if (i == 8 || i == 500) truth_.root_pitch_rad += 0.3;
    if (i == 9 || i == 501) truth_.root_pitch_rad -= 0.3;
    Play(nodes[static_cast<std::size_t>(i % 4)], 5.0 * i, 2.5);
    ASSERT_LE(judge_->passages().size(), PurposeJudge::kKept);
    amiss = std::ranges::count_if(judge_->passages(), std::mem_fn(&Passage::amiss));
  }
  EXPECT_EQ(judge_->passages().size(), PurposeJudge::kKept);
  EXPECT_EQ(judge_->left_out().motions, 900);
  EXPECT_EQ(judge_->left_out().amiss, 0) << "what was amiss is kept";
  EXPECT_EQ(judge_->left_out().unjudged, 0);
  EXPECT_EQ(amiss, 2);
  EXPECT_TRUE(judge_->passages()[0].amiss());
  EXPECT_EQ(judge_->passages()[1].node, "down") << "and what came next";
  EXPECT_EQ(judge_->passages().back().node, "down, swapped");
  EXPECT_NEAR(judge_->passages().back().expected_pitch_rad, 500 * kPi, 1e-6);
}

TEST_F(Judge, OfARunInWhichNothingIsAsAskedTheFirstAndTheLastAreKept) {
  for (int i = 0; i < 300; ++i) {
    truth_.root_pitch_rad += i == 0 ? 0.3 : 0;
    Play("up", 5.0 * i, 2.5);
  }
  EXPECT_EQ(judge_->passages().size(), PurposeJudge::kKept);
  const auto amiss = std::ranges::count_if(judge_->passages(), std::mem_fn(&Passage::amiss));
  EXPECT_EQ(judge_->left_out().amiss + amiss, 300);
  EXPECT_NEAR(judge_->passages()[0].pitch_at_end_rad, kPi / 2 + 0.3, 1e-9);
}

TEST_F(Judge, ARobotThatHasTurnedAboutBeforeIsJudgedAsOneThatHasNot) {
  for (const double turns : {1.0, -2.0}) {
    judge_.emplace(file_, Tumbler());
    truth_ = WithJoints();
    truth_.root_pitch_rad = 2 * kPi * turns;
    Play("up", 0, 2.5);
    EXPECT_NEAR(*purpose()[1].result, kPi / 2, 1e-9);
    EXPECT_EQ(judge_->passages()[0].purpose_met(), true);
    EXPECT_EQ(judge_->passages()[0].as_planned(), true);
  }
}

TEST_F(Judge, KnowsTheMotionThatHasBegunAndNotEnded) {
  EXPECT_EQ(judge_->moving(), "");
  Play("up", 0, 0.4);
  EXPECT_EQ(judge_->moving(), "");
  Tick(ExecutorState::kRunning, "down", 2);
  EXPECT_EQ(judge_->moving(), "down");
  Tick(ExecutorState::kHolding, "down", 2.1);
  EXPECT_EQ(judge_->moving(), "down") << "it was broken off";
}

TEST_F(Judge, AMotionThatIsRolledOutAfterAFaultHasEndedAndOneThatIsCaughtHasNot) {
  for (const bool rolled_out : {false, true}) {
    judge_.emplace(file_, Tumbler());
    truth_ = WithJoints();
    Tick(ExecutorState::kRunning, "up", 0);
    const Reaction reaction = rolled_out ? Reaction::kRollOut : Reaction::kHold;
    Tick(ExecutorState::kFault, "up", 0.3, reaction);
    truth_.root_pitch_rad = kPi / 2;
    Tick(ExecutorState::kFault, "up", kMotion_s, reaction);
    for (double t = 0.01; t < 2.5; t += 0.01)
      Tick(ExecutorState::kFault, "up", kMotion_s + t, Reaction::kHold);
    EXPECT_EQ(judge_->moving(), rolled_out ? "" : "up");
    ASSERT_EQ(judge_->passages().size(), rolled_out ? 1U : 0U);
    if (!rolled_out) continue;
    EXPECT_EQ(purpose()[1].result, kPi / 2);
    EXPECT_TRUE(judge_->passages()[0].as_planned());
  }
}

TEST_F(Judge, ASwappedMotionIsJudgedInTheCoordinatesOfItsTask) {
  Play("up", 0, 0.4);
  Play("down", 2, 0.4);
  Play("up, swapped", 4, 2.5);
  ASSERT_EQ(judge_->passages().size(), 3U);
  const Passage& passage = judge_->passages()[2];
  EXPECT_NEAR(truth_.root_pitch_rad, 1.5 * kPi, 1e-9);
  EXPECT_NEAR(*passage.purpose[1].result, kPi / 2, 1e-9);
  EXPECT_NEAR(*passage.purpose[2].result, 0.6, 1e-9);
  EXPECT_EQ(passage.purpose_met(), true);
  EXPECT_EQ(passage.as_planned(), true);
}

}  // namespace
}  // namespace tumbler
