#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <tuple>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/drives_toml.h"
#include "runtime/assembly/interrupts.h"
#include "runtime/bench/bench_session.h"
#include "runtime/bench/bench_tests.h"
#include "runtime/bench/bus_scan.h"
#include "runtime/bench/commission.h"
#include "runtime/bench/drive_reading.h"
#include "runtime/bench/step_page.h"
#include "tests/support/bench_rig.h"
#include "tests/support/example_drives.h"
#include "tests/support/program.h"
#include "tests/support/protocol_side.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST_P(BenchOf, AJogKeepsAmplitudeAndSpeedInEveryFrameAndLeavesTheTorqueOff) {
  BenchBounds bounds;
  bounds.amplitude_rad = 0.08;
  bounds.speed_rad_s = 0.3;
  {
    BenchSession session(world_, drives_, bounds);
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    const JogResult jog = Jog(session, 0, {0.5, false}, nullptr);  // more than is allowed
    EXPECT_NEAR(jog.ways_rad[0], 0.08, 0.01);
    EXPECT_NEAR(jog.ways_rad[1], 0, 0.001);
    EXPECT_FALSE(world_.AnyEnabled());
  }
  const std::vector<double> asked = Asked(0);
  ASSERT_GT(asked.size(), 500U);
  constexpr double kRounding_rad = 5e-4;
  for (std::size_t i = 0; i < asked.size(); ++i) {
    EXPECT_LE(std::abs(asked[i]), 0.08 + kRounding_rad);
    if (i > 0) {
      EXPECT_LE(std::abs(asked[i] - asked[i - 1]), 0.3e-3 + kRounding_rad);
    }
  }
  EXPECT_NEAR(world_.rotor(0).position_rad, 0, 0.01);
}

TEST_P(BenchOf, AfterAPauseOfTheProgramNothingIsAskedOfADriveThatMayHaveLetGo) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  session.Enable(0);
  for (int i = 0; i < 20; ++i) session.Follow(0, 0);
  world_.clock().SleepUntil(session.now_ns() + 500'000'000);
  world_.rotor(0).position_rad = 1.2;  // The robot has fallen.
  const std::size_t before = world_.sent.size();
  try {
    session.Follow(0, 0);
    ADD_FAILURE() << "the pause was not noticed";
  } catch (const BenchFault& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("has not replied for"));
  }
  EXPECT_EQ(world_.sent.size(), before);
}

TEST_P(BenchOf, AJointWithHardlyAnyFrictionIsAtRestWhenAJogLeavesIt) {
  for (const std::size_t joint : {0U, 1U}) world_.rotor(joint).damping_nm_s_per_rad = 0.005;
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  for (const std::size_t joint : {0U, 1U}) {
    static_cast<void>(Jog(session, joint, {0.1, false}, nullptr));
    session.Wait(1);
    // Half of what would be taken for a motion of its own while the next drive is tried.
    EXPECT_NEAR(world_.rotor(joint).position_rad, 0, 0.015);
  }
}

TEST_P(BenchOf, AnInterruptAtAnyTimeEndsWithTheTorqueOff) {
  const auto jog = [](BenchSession& session) {
    static_cast<void>(Jog(session, 0, {0.1, false}, nullptr));
  };
  const auto prove = [](BenchSession& session) { static_cast<void>(ProveWatchdog(session, 0)); };
  const auto interrupt_by = [&](const OperatorWish& wish, int tick,
                                const std::function<void(BenchSession&)>& work) {
    SCOPED_TRACE(ToString(wish.request));
    SCOPED_TRACE(tick);
    int ticks = 0;
    const auto run = [&] {
      BenchSession session(world_, drives_, {});
      ASSERT_THAT(session.AwaitReplies(), IsEmpty());
      session.ClearErrors();  // of a silence that an earlier interrupt ended
      world_.each_tick = [&] {
        if (++ticks == tick) InterruptMailbox().Put(wish);
      };
      work(session);
    };
    try {
      run();
      ADD_FAILURE() << "it goes on";
    } catch (const BenchInterrupted& end) {
      EXPECT_EQ(end.wish(), wish);
    }
    world_.each_tick = {};
    EXPECT_FALSE(world_.AnyEnabled());
  };
  const auto interrupt = [&](int tick, const std::function<void(BenchSession&)>& work) {
    interrupt_by({0, OperatorRequest::kFinish, -1, true}, tick, work);
  };
  const double ticks_in_ms = 1e-3 * drives_.rate_hz;
  for (const int tick : {1, 5, 40, 300, 700, 1000, 1150})
    interrupt(static_cast<int>(std::ceil(tick * ticks_in_ms)), jog);
  for (const int tick : {1, 10, 40, 60, 100}) interrupt(tick, prove);
  for (const OperatorRequest request :
       {OperatorRequest::kFinish, OperatorRequest::kStop, OperatorRequest::kDisarm}) {
    interrupt_by({7, request, -1, false}, 40, prove);  // by LCM
  }
}

TEST_P(BenchOf, ADriveErrorInMidMotionIsAFaultThatNamesTheDriveAndTheTorqueGoesOff) {
  int ticks = 0;
  const auto run = [&] {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    world_.each_tick = [&] {
      if (++ticks == 200) world_.simulated[1]->RaiseError(GetParam().protocol == "mit" ? 2 : 0x40);
    };
    static_cast<void>(Jog(session, 1, {0.1, false}, nullptr));
  };
  try {
    run();
    FAIL() << "no fault";
  } catch (const BenchFault& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("(leg2)"));
  }
  world_.each_tick = {};
  EXPECT_FALSE(world_.simulated[0]->enabled());
  constexpr std::int64_t kBraking_ns = 300'000'000;  // what a CiA 402 drive does in a fault first
  world_.clock().SleepUntil(world_.clock().now_ns() + kBraking_ns);
  EXPECT_EQ(world_.simulated[1]->torque_nm(), 0);
}

TEST_P(BenchOf, ADriveThatFallsSilentInMidMotionIsAFault) {
  int ticks = 0;
  const auto run = [&] {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    world_.each_tick = [&] {
      if (++ticks == 200) world_.simulated[0]->set_silent(true);
    };
    static_cast<void>(Jog(session, 0, {0.1, false}, nullptr));
  };
  EXPECT_THROW(run(), BenchFault);
  world_.each_tick = {};
  EXPECT_FALSE(world_.simulated[0]->enabled());
}

TEST_P(BenchOf, AJointThatIsCarriedAwayIsAFault) {
  int ticks = 0;
  const auto run = [&] {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    world_.each_tick = [&] {
      if (++ticks > 200) world_.rotor(0).position_rad = 0.4;
    };
    static_cast<void>(Jog(session, 0, {0.1, false}, nullptr));
  };
  EXPECT_THROW(run(), BenchFault);
  world_.each_tick = {};
  EXPECT_FALSE(world_.AnyEnabled());
}

TEST_P(BenchOf, TheWatchdogsProofFindsWhenADriveLetsGo) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const WatchdogResult watchdog = ProveWatchdog(session, 0);
  EXPECT_TRUE(watchdog.let_go);
  // CANSimple tells by its next heartbeat.
  EXPECT_NEAR(watchdog.limp_after_s, 0.025, GetParam().protocol == "cansimple" ? 0.012 : 0.004);
  EXPECT_LE(watchdog.pushed_after_s, 0.026);
  const double period_s = session.period_s();
  EXPECT_THAT(JudgeWatchdog("drive", watchdog, 0.025, period_s, {}), IsEmpty());
  EXPECT_EQ(JudgeWatchdog("drive", watchdog, 0.1, period_s, {}).at(0).kind, "watchdog-differs");
  // An interval on both sides of the expected time proves nothing.
  WatchdogResult vague;
  vague.let_go = true;
  vague.pushed_after_s = 0.012;
  vague.limp_after_s = 0.3;
  EXPECT_EQ(JudgeWatchdog("drive", vague, 0.2, period_s, {}).at(0).kind, "watchdog-unproved");
  // Only who writes the file knows whether it has it right.
  EXPECT_FALSE(JudgeWatchdog("drive", watchdog, 0.1, period_s, {}).at(0).mended);
  EXPECT_GT(world_.simulated[0]->watchdog_expiries(), 0);
  EXPECT_FALSE(world_.AnyEnabled());
}

TEST_P(BenchOf, NoOrderLeadsBeyondTheAmplitudeOnEitherSide) {
  for (const double far_rad : {-1.0, 1.0}) {
    BenchSession session(world_, drives_, {});
    ASSERT_THAT(session.AwaitReplies(), IsEmpty());
    session.Enable(0);
    const double origin_rad = session.position_rad(0);
    world_.sent.clear();
    for (int i = 0; i < 1000; ++i) session.Follow(origin_rad + far_rad, 0);
    for (const double asked : Asked(0)) {
      const float zero = JointOf(drives_.drives[0].config).zero_offset_rad;
      EXPECT_LE(std::abs(asked + double{zero} - origin_rad), 0.1 + 1e-3);
    }
    EXPECT_FALSE(Asked(0).empty());
    session.TorqueOff();
    world_.rotor(0).position_rad = 0;
  }
}

TEST_P(BenchOf, APushIsNoHarderThanTheBounds) {
  if (GetParam().protocol != "mit") return;  // The others' own gains push as well.
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  for (const double torque_nm : {6.0, -6.0}) {
    session.Enable(0);
    session.Push(torque_nm);
    session.Push(torque_nm);
    EXPECT_NEAR(world_.simulated[0]->torque_nm(), std::copysign(1.0, torque_nm), 0.02);
    session.TorqueOff();
  }
}

TEST_P(BenchOf, ASilenceEndsWhenTheJointOfADriveWithAClockOfItsOwnLeavesTheAmplitude) {
  if (GetParam().protocol != "cansimple") return;  // The others say no position meanwhile.
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  session.Enable(0);
  for (int i = 0; i < 20; ++i) session.Follow(session.position_rad(0), 0);
  world_.each_tick = [this] { world_.rotor(0).position_rad = 0.12; };
  const std::int64_t begin_ns = session.now_ns();
  EXPECT_EQ(session.StaySilentUntil(begin_ns + 1'000'000'000), -1) << "the watchdog is slower";
  EXPECT_LT(session.now_ns() - begin_ns, 20'000'000);
  world_.each_tick = {};
  session.TorqueOff();
}

TEST_P(BenchOf, RepliesAreTimedAndLostOnesCounted) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  std::vector<ReplyResult> replies = MeasureReplies(session, 2);
  ASSERT_EQ(replies.size(), 2U);
  EXPECT_EQ(replies[0].lost, 0);
  const double period_s = session.period_s();
  EXPECT_EQ(replies[0].answers, side().nature().answers);
  EXPECT_LE(replies[0].max_ms, 1e3 * period_s + 0.1);
  EXPECT_THAT(JudgeReplies("drive", replies[0], period_s, {}), IsEmpty());
  BusFaultPlan plan;
  plan.faults.push_back({});
  plan.faults.back().node = 2;  // the host
  plan.faults.back().probability = 0.02;
  world_.wire().SetFaults(plan);
  replies = MeasureReplies(session, 5);
  EXPECT_NEAR(replies[0].lost_share(), 0.02, 0.008);
  EXPECT_EQ(JudgeReplies("drive", replies[0], period_s, {}).at(0).kind, "noisy-bus");
}

TEST_P(BenchOf, AnswersThatAreLateByWholePeriodsAreTimedFromTheirOwnQuestion) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const std::vector<ReplyResult> prompt = MeasureReplies(session, 1);
  if (!prompt[0].answers) GTEST_SKIP() << "this drive is not asked";
  const double period_ms = 1e3 * session.period_s();
  for (const double late_ms : {0.7 * period_ms, 1.6 * period_ms, 2.5 * period_ms}) {
    BusFaultPlan plan;
    plan.faults.push_back({});
    plan.faults.back().kind = BusFaultKind::kDelay;
    plan.faults.back().node = 2;  // the host
    plan.faults.back().delay_ns = std::llround(1e6 * late_ms);
    world_.wire().SetFaults(plan);
    session.Wait(0.1);
    const std::vector<ReplyResult> replies = MeasureReplies(session, 1);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_NEAR(replies[i].median_ms, prompt[i].median_ms + late_ms, 0.15) << late_ms;
      EXPECT_EQ(replies[i].lost, 0);
      EXPECT_FALSE(replies[i].at_least);
    }
    const bool late = prompt[0].p99_ms + late_ms > period_ms;
    EXPECT_EQ(JudgeReplies("drive", replies[0], session.period_s(), {}).empty(), !late);
  }
}

TEST_P(BenchOf, AnswersThatTakeLongerThanEverySilenceAreLateByAtLeastThat) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  if (!MeasureReplies(session, 0.5)[0].answers) GTEST_SKIP() << "this drive is not asked";
  BusFaultPlan plan;
  plan.faults.push_back({});
  plan.faults.back().kind = BusFaultKind::kDelay;
  plan.faults.back().node = 2;  // the host
  plan.faults.back().delay_ns = 400'000'000;
  world_.wire().SetFaults(plan);
  session.Wait(1);
  const ReplyResult replies = MeasureReplies(session, 1)[0];
  EXPECT_TRUE(replies.at_least);
  EXPECT_EQ(JudgeReplies("drive", replies, session.period_s(), {}).back().kind, "late-replies");
}

TEST_P(BenchOf, RepeatedRepliesAreNamedAndDoNotGrowIntoLatencies) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const ReplyResult once = MeasureReplies(session, 1)[0];
  for (const double share : {0.1, 1.0}) {
    BusFaultPlan plan;
    plan.faults.push_back({});
    plan.faults.back().kind = BusFaultKind::kDuplicate;
    plan.faults.back().node = 2;  // the host
    plan.faults.back().probability = share;
    world_.wire().SetFaults(plan);
    const ReplyResult replies = MeasureReplies(session, 2)[0];
    EXPECT_GT(replies.repeated, 0);
    EXPECT_EQ(JudgeReplies("drive", replies, session.period_s(), {}).at(0).kind,
              "repeated-replies");
    if (replies.answers) {
      EXPECT_NEAR(replies.median_ms, once.median_ms, 0.15);
      EXPECT_LT(replies.max_ms, 1e3 * session.period_s());
    }
  }
}

TEST_P(BenchOf, AStepAnswersAsItsDifferentialEquationDoes) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const StepResult step = MeasureStep(session, 0, {});
  if (GetParam().protocol == "mit") {
    // 0.02 kg m^2 on 5 N m/rad with 0.2 + 0.1 N m s/rad: natural frequency 15.8 rad/s, damping
    // ratio 0.474, and so exp(-pi 0.474 / sqrt(1 - 0.474^2)) = 0.184 of overshoot.
    EXPECT_NEAR(step.overshoot, 0.184, 0.04);
    ASSERT_TRUE(step.rise_s);
    EXPECT_NEAR(*step.rise_s, 0.1, 0.015);
  }
  EXPECT_NEAR(step.remaining_rad, 0, 0.003);
  const std::string page = StepPage({{"a <drive>", {}, step}});
  EXPECT_THAT(page, HasSubstr("a &lt;drive&gt;"));
  EXPECT_THAT(page, HasSubstr("<polyline points=\""));
  EXPECT_THAT(JudgeStep("drive", {}, step), IsEmpty());
}

TEST_P(BenchOf, APositionOfADriveThatHasFallenSilentIsAFaultThatNamesIt) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  static_cast<void>(RestingPosition(session, 1));
  world_.simulated[1]->set_silent(true);
  static_cast<void>(RestingPosition(session, 0));
  try {
    static_cast<void>(RestingPosition(session, 1));
    FAIL() << "no fault";
  } catch (const BenchFault& fault) {
    EXPECT_THAT(fault.what(), HasSubstr("(leg2) has not replied for"));
  }
  // Nor can it be said that its joint has not moved.
  EXPECT_THROW(static_cast<void>(Jog(session, 0, {0.1, false}, nullptr)), BenchFault);
}

TEST_P(BenchOf, EveryReplyOfADriveThatDiedIsLostAndThoseAfterItDied) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  world_.each_tick = [&] {
    if (std::cmp_equal(session.replies(1).asked_ns.size(), std::lround(1 / session.period_s())))
      world_.simulated[1]->set_silent(true);
  };
  std::vector<ReplyResult> replies = MeasureReplies(session, 2);
  EXPECT_EQ(replies[0].lost, 0);
  EXPECT_NEAR(replies[1].lost_share(), 0.5, 0.01);
  EXPECT_EQ(JudgeReplies("drive", replies[1], 0.001, {}).at(0).kind, "noisy-bus");
  session.Wait(0.1);
  replies = MeasureReplies(session, 1);
  EXPECT_GT(replies[1].lost_share(), 0.99);
  EXPECT_EQ(JudgeReplies("drive", replies[1], 0.001, {}).at(0).kind, "noisy-bus");
}

TEST_P(BenchOf, ADriveThatLosesMostOfItsRepliesSteadilyIsFound) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  BusFaultPlan plan;
  plan.faults.push_back({});
  plan.faults.back().node = 2;  // the host
  plan.faults.back().probability = 0.7;
  world_.wire().SetFaults(plan);
  EXPECT_NEAR(MeasureReplies(session, 5)[0].lost_share(), 0.7, 0.05);
}

TEST_P(BenchOf, AJointThatIsBlockedHasNoRiseAndIsAFinding) {
  BenchSession session(world_, drives_, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  world_.each_tick = [&] {
    world_.rotor(0).position_rad = 0;
    world_.rotor(0).velocity_rad_s = 0;
  };
  const StepResult step = MeasureStep(session, 0, {});
  EXPECT_FALSE(step.rise_s);
  EXPECT_EQ(ToJson(step)["rise_s"].Dump(0), "null");
  EXPECT_THAT(Describe(step), HasSubstr("not reached"));
  EXPECT_EQ(JudgeStep("drive", {}, step).at(0).kind, "step-not-followed");
}

TEST_P(BenchOf, ADriveWithoutWatchdogIsProvedForNoLongerThanItsJointStaysWithinTheAmplitude) {
  DrivesConfig actual = drives_;
  actual.drives[0].watchdog_s = 0;
  if (auto* cia402 = std::get_if<Cia402Config>(&actual.drives[0].config))
    cia402->watchdog_reaction = 0;
  RigWorld world(actual);
  double farthest_rad = 0;
  world.each_tick = [&] {
    farthest_rad = std::max(farthest_rad, std::abs(world.rotor(0).position_rad));
  };
  BenchSession session(world, actual, {});
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  const WatchdogResult watchdog = ProveWatchdog(session, 0);
  EXPECT_FALSE(watchdog.let_go);
  EXPECT_LE(farthest_rad, 0.1);
  EXPECT_GE(watchdog.pushed_after_s, IsPushed() ? 0.05 : 0.999);
  EXPECT_EQ(watchdog.longest, !IsPushed());
  const BenchFinding finding = JudgeWatchdog("drive", watchdog, 0.025, 0.001, {}).at(0);
  EXPECT_EQ(finding.kind, "no-watchdog");
  EXPECT_FALSE(finding.mended);
  EXPECT_THAT(finding.text, HasSubstr("still drives after"));
}

INSTANTIATE_TEST_SUITE_P(EveryProtocol, BenchOf,
                         ::testing::ValuesIn(testing::ExampleOfEveryProtocol()),
                         [](const auto& example) { return example.param.protocol; });

TEST(BenchTorque, StiffnessAndVelocityOfEverySetpointTogetherStayWithinTheBound) {
  const DrivesConfig drives = DefaultDrives({"leg1"});
  const auto& mit = std::get<MitConfig>(drives.drives[0].config);
  BenchBounds bounds;
  bounds.amplitude_rad = 1;
  bounds.speed_rad_s = 5;
  bounds.torque_nm = 0.5;
  bounds.kp_nm_per_rad = 20;
  bounds.kd_nm_s_per_rad = 2;
  RigWorld world(drives);
  BenchSession session(world, drives, bounds);
  ASSERT_THAT(session.AwaitReplies(), IsEmpty());
  session.Enable(0);
  const double origin_rad = session.position_rad(0);
  double most_nm = 0;
  for (int i = 0; i < 600; ++i) {
    const double measured_rad = session.position_rad(0);
    const std::size_t before = world.sent.size();
    session.Follow(origin_rad + (i < 300 ? 0.8 : -0.8), i < 300 ? 5 : -5);
    for (std::size_t k = before; k < world.sent.size(); ++k) {
      ImpedanceCommand command;
      if (DecodeMitCommand(mit, world.sent[k], command) != Status::kOk) continue;
      most_nm = std::max(
          most_nm,
          double{command.kp_nm_per_rad} * std::abs(double{command.position_rad} - measured_rad) +
              double{command.kd_nm_s_per_rad} * std::abs(double{command.velocity_rad_s}));
    }
  }
  session.TorqueOff();
  EXPECT_LE(most_nm, 0.5 + 0.04);  // steps of 0.4 mrad, 0.025 rad/s, and of the gains
  EXPECT_GT(most_nm, 0.4);
}

TEST(BenchJudgement, AWayOfAnotherLengthOrAnotherPlaceIsAFinding) {
  const BenchJoint joint{"leg1", -2.9, 2.9, 0};
  EXPECT_THAT(JudgeWay(joint, {true, -2.85, 2.95}, {}), IsEmpty());
  EXPECT_EQ(JudgeWay(joint, {true, -2.6, 3.2}, {}).size(), 1U);
  EXPECT_THAT(JudgeWay(joint, {true, -1.45, 1.45}, {}).at(0).text, HasSubstr("0.50 times the way"));
  EXPECT_EQ(JudgeWay(joint, {false, -2.9, 2.9}, {}).size(), 1U);
}

TEST(BenchJudgement, PositionsThatADriveCannotReachOrReportAreFindings) {
  DrivesConfig drives = DefaultDrives({"leg1"});
  auto& mit = std::get<MitConfig>(drives.drives[0].config);
  mit.joint.gear_ratio = 6;  // 12.5 rad of the shaft are 2.08 rad of the joint
  EXPECT_EQ(JudgeRanges("drive", drives.drives[0], {"leg1", -2.9, 2.9, 0}).size(), 2U);
  mit.joint.gear_ratio = 1;
  EXPECT_THAT(JudgeRanges("drive", drives.drives[0], {"leg1", -2.9, 2.9, 0}), IsEmpty());
}

}  // namespace
}  // namespace tumbler
