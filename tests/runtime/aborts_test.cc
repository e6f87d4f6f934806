// What becomes of a motion that cannot simply go on: the ways of its table of aborts, whatever the
// fault and the time.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "runtime/executor/executor.h"
#include "runtime/executor/run_procedure.h"
#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"
#include "tests/support/sensor_motion.h"
#include "tests/support/sequence_files.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::MotionShape;

constexpr std::array kWays{AbortWay::kCatch, AbortWay::kFold, AbortWay::kRollOut, AbortWay::kDamp};

/// The faults that are answered by the table while running.
constexpr std::array kAborting{Fault::kStaleReply, Fault::kWrongSequence, Fault::kHeartbeatLost,
                               Fault::kLateTick, Fault::kOperatorStop};

struct TableRow {
  float until_s;
  AbortWay way;
  float late_max_s = 0.01F;
  float share = 0.5F;
};

/// The motion with this table; folds go to the middle between both limits.
Primitive<float> WithAborts(Primitive<float> motion, const std::vector<TableRow>& spans) {
  motion.aborts.span_count = static_cast<int>(spans.size());
  for (std::size_t i = 0; i < spans.size(); ++i) {
    AbortSpan<float>& span = motion.aborts.span_storage[i];
    span = {spans[i].until_s, spans[i].way, spans[i].late_max_s, spans[i].share, {}};
    for (std::size_t j = 0; j < motion.motions().size(); ++j) {
      const JointLimits<float>& limits = motion.joints[j].limits;
      span.position_rad[j] = 0.5F * (limits.position_min_rad + limits.position_max_rad);
    }
  }
  return motion;
}

Primitive<float> AbortedMotion(unsigned seed = 3) {
  std::mt19937 random(seed);
  MotionShape shape;
  shape.duration_s = 0.6;
  shape.settle_s = 0.2;
  return testing::RandomPrimitive<float>(shape, random);
}

/// One way for the whole time.
Primitive<float> OneWay(AbortWay way, unsigned seed = 3) {
  const Primitive<float> motion = AbortedMotion(seed);
  return WithAborts(motion, {{motion.duration_s, way}});
}

/// Begins the motion and plays so many ticks of it.
void PlayTo(ExecutorRig& rig, std::int64_t ticks) {
  ASSERT_EQ(rig.configured, Status::kOk);
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.Tick(OperatorCommand::kMoveToStart);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
  rig.Tick(OperatorCommand::kRun);
  for (std::int64_t i = 0; i < ticks; ++i) rig.Tick();
  ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
}

/// Makes the fault happen to joint 1, or to all, and ticks until it is found.
void ProvokeAbort(ExecutorRig& rig, Fault fault, int late = 5) {
  OperatorCommand command = OperatorCommand::kNone;
  if (fault == Fault::kStaleReply) rig.silent[1] = true;
  if (fault == Fault::kWrongSequence) rig.replies[1] = 2;
  if (fault == Fault::kHeartbeatLost) rig.drives[1]->heartbeat_age = {30, 26};
  if (fault == Fault::kLateTick) rig.input.tick += late;
  if (fault == Fault::kOperatorStop) command = OperatorCommand::kStop;
  for (int i = 0; i < 12 && rig.executor.state() == ExecutorState::kRunning; ++i) rig.Tick(command);
}

Reaction ReactionOf(AbortWay way) {
  switch (way) {
    case AbortWay::kCatch:
      return Reaction::kHold;
    case AbortWay::kFold:
      return Reaction::kFold;
    case AbortWay::kRollOut:
      return Reaction::kRollOut;
    case AbortWay::kDamp:
      return Reaction::kDamp;
  }
  return Reaction::kIgnore;
}

TEST(Aborts, EveryTickOfAMotionIsAnsweredByTheWayOfItsSpan) {
  const Primitive<float> bare = AbortedMotion();
  const std::vector<TableRow> spans = {{0.1F, AbortWay::kCatch},
                                       {0.25F, AbortWay::kFold},
                                       {0.26F, AbortWay::kDamp},
                                       {0.5F, AbortWay::kRollOut},
                                       {bare.duration_s, AbortWay::kFold}};
  const Primitive<float> motion = WithAborts(bare, spans);
  std::array<int, kAbortWayCount> seen{};
  for (int ticks = 0; ticks < 600; ++ticks) {
    ExecutorRig rig({}, motion);
    PlayTo(rig, ticks);
    rig.input.tick += 5;
    const TickRecord& record = rig.Tick();
    ASSERT_EQ(record.first_fault.fault, Fault::kLateTick);
    const float time_s = static_cast<float>(ticks) * 0.001F;  // of the tick before
    std::size_t span = 0;
    while (span + 1 < spans.size() && time_s >= spans[span].until_s) ++span;
    EXPECT_EQ(ToString(record.reaction), std::string(ToString(ReactionOf(spans[span].way))))
        << ticks;
    EXPECT_EQ(record.first_fault.reaction, record.reaction);
    ++seen[static_cast<std::size_t>(spans[span].way)];
  }
  for (const int count : seen) EXPECT_GE(count, 10);
}

TEST(Aborts, EveryFaultAfterWhichTheDrivesObeyIsAnsweredByTheTableAndNoOther) {
  for (const FaultInfo& info : kFaultTable) {
    const bool aborting = std::ranges::find(kAborting, info.fault) != kAborting.end();
    EXPECT_EQ(info.reactions[static_cast<std::size_t>(ExecutorState::kRunning)] == Reaction::kAbort,
              aborting)
        << info.name;
    for (const StateInfo& state : kStateTable) {
      if (state.state == ExecutorState::kRunning) continue;
      EXPECT_NE(info.reactions[static_cast<std::size_t>(state.state)], Reaction::kAbort);
    }
  }
  for (const Fault fault : kAborting) {
    for (const AbortWay way : kWays) {
      ExecutorRig rig({}, OneWay(way));
      PlayTo(rig, 200);
      ProvokeAbort(rig, fault);
      const TickRecord& record = rig.output.record;
      if (fault == Fault::kOperatorStop && way == AbortWay::kCatch) {
        EXPECT_EQ(record.faults, 0U) << "a plain stop";
        EXPECT_EQ(record.state, ExecutorState::kStopping);
        continue;
      }
      EXPECT_EQ(record.faults, 1U << static_cast<unsigned>(fault)) << ToString(fault);
      EXPECT_EQ(record.reaction, ReactionOf(way)) << ToString(fault);
      EXPECT_EQ(record.state, ExecutorState::kFault);
    }
  }
}

TEST(Aborts, WithoutATableOrAtAnotherSpeedAFaultIsDampedAndAStopBrakes) {
  for (const bool slow : {false, true}) {
    for (const Fault fault : kAborting) {
      ExecutorConfig config;
      if (slow) config.speed = 0.5F;
      ExecutorRig rig(config, slow ? OneWay(AbortWay::kRollOut) : AbortedMotion());
      PlayTo(rig, 200);
      ProvokeAbort(rig, fault);
      if (fault == Fault::kOperatorStop) {
        EXPECT_EQ(rig.output.record.state, ExecutorState::kStopping);
      } else {
        EXPECT_EQ(rig.output.record.reaction, Reaction::kDamp) << ToString(fault);
      }
    }
  }
}

/// Whether two ticks order the same of a joint, apart from the state.
bool SameOrders(const testing::ScriptedDrive& a, const testing::ScriptedDrive& b) {
  return a.request == b.request && a.setpoint.position_rad == b.setpoint.position_rad &&
         a.setpoint.velocity_rad_s == b.setpoint.velocity_rad_s &&
         a.setpoint.torque_nm == b.setpoint.torque_nm &&
         a.setpoint.kp_nm_per_rad == b.setpoint.kp_nm_per_rad &&
         a.setpoint.kd_nm_s_per_rad == b.setpoint.kd_nm_s_per_rad;
}

TEST(Aborts, AMotionThatIsRolledOutGetsTheOrdersOfOneThatIsNotAndIsHeldLikeIt) {
  for (const Fault fault : {Fault::kStaleReply, Fault::kHeartbeatLost, Fault::kOperatorStop}) {
    for (const int ticks : {0, 1, 250, 595}) {
      const Primitive<float> motion = OneWay(AbortWay::kRollOut);
      ExecutorRig rolled({}, motion), undisturbed({}, motion);
      PlayTo(rolled, ticks);
      PlayTo(undisturbed, ticks);
      const auto both = [&](OperatorCommand command) {
        rolled.Tick(command);
        undisturbed.Tick();
        for (std::size_t j = 0; j < 2; ++j)
          ASSERT_TRUE(SameOrders(*rolled.drives[j], *undisturbed.drives[j])) << ticks;
      };
      if (fault == Fault::kStaleReply) rolled.silent[1] = true;
      if (fault == Fault::kHeartbeatLost) rolled.drives[1]->heartbeat_age = {30, 26};
      both(fault == Fault::kOperatorStop ? OperatorCommand::kStop : OperatorCommand::kNone);
      for (int i = 0; i < 7; ++i) both(OperatorCommand::kNone);
      rolled.silent[1] = false;
      for (int i = 0; i < 1000; ++i) both(OperatorCommand::kNone);
      EXPECT_EQ(rolled.executor.state(), ExecutorState::kFault);
      EXPECT_EQ(rolled.output.record.reaction, Reaction::kHold) << "the motion has ended";
      EXPECT_EQ(rolled.output.record.primitive_time_s, motion.duration_s);
      EXPECT_EQ(undisturbed.executor.state(), ExecutorState::kHolding);
    }
  }
}

TEST(Aborts, AMotionThatIsRolledOutKeepsItsFeedback) {
  testing::MotionShape shape;
  shape.duration_s = 0.6;
  shape.settle_s = 0.2;
  Primitive<float> motion = testing::MotionWithFeedback(5, shape);
  motion.aborts = OneWay(AbortWay::kRollOut).aborts;
  motion.following_tolerance_rad = 10;
  std::array<XsensMti, 2> sensors;
  std::array<ExecutorRig, 2> rigs{ExecutorRig({}, motion), ExecutorRig({}, motion)};
  const auto measure = [&] {
    for (ExecutorRig& rig : rigs) {
      // The fed-back angle is off by 0.2 rad, whatever the joint does.
      const float plan = motion.feedback.angle.Evaluate(rig.output.record.primitive_time_s).value;
      const float joint = rig.drives[1]->reply.position_rad;
      rig.sensor_frames = testing::SensorFrames(static_cast<double>(plan - joint) + 0.2, 0);
    }
  };
  for (std::size_t i = 0; i < 2; ++i) {
    rigs[i].sensor.device = &sensors[i];
    rigs[i].sensor.settings.repeats_max = 0;
    rigs[i].sensor.settings.jump_max_rad = 100;
    rigs[i].sensor.settings.rate_max_rad_s = 100;
    rigs[i].Reconfigure();
  }
  measure();
  for (ExecutorRig& rig : rigs) PlayTo(rig, 0);
  float most = 0;
  for (int i = 0; i < 1000; ++i) {
    measure();
    rigs[0].Tick(i == 200 ? OperatorCommand::kStop : OperatorCommand::kNone);
    rigs[1].Tick();
    for (std::size_t j = 0; j < 2; ++j)
      ASSERT_TRUE(SameOrders(*rigs[0].drives[j], *rigs[1].drives[j])) << i;
    if (i > 200) most = std::max(most, std::abs(rigs[0].output.record.joints[1].correction_rad));
  }
  EXPECT_EQ(rigs[0].executor.state(), ExecutorState::kFault);
  EXPECT_GT(most, 0.01) << "there is something to correct";
}

TEST(Aborts, WhereAMotionWasRolledOutTheRunCanGoHomeAndElsewhereItCannot) {
  for (const AbortWay way : kWays) {
    ExecutorRig rig({}, OneWay(way));
    PlayTo(rig, 300);
    rig.input.tick += 5;
    rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kWrongState)
        << "the motion has not ended";
    for (int i = 0; i < 800; ++i) rig.Tick();
    rig.Tick(OperatorCommand::kGoHome);
    const bool home = way == AbortWay::kRollOut;
    EXPECT_EQ(rig.output.record.refusal.refusal, home ? Refusal::kNone : Refusal::kWrongState);
    EXPECT_EQ(rig.output.record.state, home ? ExecutorState::kSettling : ExecutorState::kFault);
  }
}

TEST(Aborts, AMotionThatIsTooLateIsNotRolledOutButDamped) {
  const Primitive<float> bare = AbortedMotion();
  const Primitive<float> motion = WithAborts(bare, {{bare.duration_s, AbortWay::kRollOut, 0.010F}});
  for (int late = 3; late < 20; ++late) {
    ExecutorRig rig({}, motion);
    PlayTo(rig, 200);
    rig.input.tick += late;
    EXPECT_EQ(rig.Tick().reaction, late <= 10 ? Reaction::kRollOut : Reaction::kDamp) << late;
  }
  // What comes later adds up, whatever fault it began with.
  for (const Fault first : {Fault::kLateTick, Fault::kOperatorStop}) {
    ExecutorRig rig({}, motion);
    PlayTo(rig, 200);
    ProvokeAbort(rig, first, 4);
    ASSERT_EQ(rig.output.record.reaction, Reaction::kRollOut);
    for (int i = 0; i < 20; ++i) rig.Tick();
    rig.input.tick += 6;
    EXPECT_EQ(rig.Tick().reaction, Reaction::kRollOut);
    for (int i = 0; i < 20; ++i) rig.Tick();
    rig.input.tick += 5;
    EXPECT_EQ(rig.Tick().reaction, Reaction::kDamp);
  }
  // So does that with which it began.
  ExecutorRig rig({}, motion);
  PlayTo(rig, 200);
  ProvokeAbort(rig, Fault::kLateTick, 4);
  for (int i = 0; i < 20; ++i) rig.Tick();
  rig.input.tick += 4;
  EXPECT_EQ(rig.Tick().reaction, Reaction::kRollOut);
  for (int i = 0; i < 20; ++i) rig.Tick();
  rig.input.tick += 3;
  EXPECT_EQ(rig.Tick().reaction, Reaction::kDamp);
}

TEST(Aborts, ADriveThatStaysSilentIsNoneThatObeys) {
  const ExecutorConfig config;
  for (const AbortWay way : {AbortWay::kRollOut, AbortWay::kFold}) {
    for (const bool comes_back : {false, true}) {
      ExecutorRig rig(config, OneWay(way));
      PlayTo(rig, 100);
      rig.silent[0] = true;
      for (int age = 1; age <= 5 * config.stale_ticks_max; ++age) {
        EXPECT_EQ(rig.Tick().reaction,
                  age <= config.stale_ticks_max ? Reaction::kIgnore : ReactionOf(way))
            << age;
      }
      rig.silent[0] = !comes_back;
      EXPECT_EQ(rig.Tick().reaction, comes_back ? ReactionOf(way) : Reaction::kDamp);
    }
  }
}

TEST(Aborts, AFoldArrivesAtItsPoseAndStaysThereWithTheNormalGains) {
  for (const float share : {0.05F, 0.3F, 1.0F}) {
    const Primitive<float> bare = AbortedMotion(7);
    const Primitive<float> motion =
        WithAborts(bare, {{bare.duration_s, AbortWay::kFold, 0, share}});
    ExecutorRig rig({}, motion);
    PlayTo(rig, 300);
    rig.input.tick += 5;
    rig.Tick();
    for (int i = 0; i < 20000; ++i) rig.Tick();
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_EQ(rig.drives[j]->setpoint.position_rad,
                motion.aborts.span_storage[0].position_rad[j]);
      EXPECT_EQ(rig.drives[j]->setpoint.velocity_rad_s, 0);
      EXPECT_EQ(rig.drives[j]->setpoint.torque_nm, 0);
      EXPECT_EQ(rig.drives[j]->setpoint.kp_nm_per_rad, 200);
    }
    EXPECT_EQ(rig.output.record.reaction, Reaction::kFold);
  }
}

TEST(Aborts, AFoldIsAsFastAsItsShareOfTheLimits) {
  const Primitive<float> bare = AbortedMotion(7);
  std::array<int, 2> ticks{};
  for (std::size_t run = 0; run < 2; ++run) {
    ExecutorRig rig(
        {}, WithAborts(bare, {{bare.duration_s, AbortWay::kFold, 0, run == 0 ? 0.02F : 0.01F}}));
    PlayTo(rig, 0);
    rig.input.tick += 5;
    rig.Tick();
    const float pose =
        0.5F * (bare.joints[0].limits.position_min_rad + bare.joints[0].limits.position_max_rad);
    while (rig.drives[0]->setpoint.position_rad != pose && ticks[run] < 50000) {
      rig.Tick();
      ++ticks[run];
    }
  }
  // A way at half the velocity and half the acceleration takes between sqrt(2) and 2 times as long.
  EXPECT_GE(ticks[1], 1.38 * ticks[0]);
  EXPECT_LE(ticks[1], 2.05 * ticks[0]);
}

TEST(Aborts, AJointWhoseHeartbeatIsMissingFoldsWithTheOthers) {
  const Primitive<float> motion = OneWay(AbortWay::kFold);
  ExecutorRig rig({}, motion);
  PlayTo(rig, 300);
  rig.drives[1]->heartbeat_age = {30, 26};
  for (int i = 0; i < 20000; ++i) rig.Tick();
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_EQ(rig.drives[j]->setpoint.position_rad, motion.aborts.span_storage[0].position_rad[j]);
  }
}

TEST(Aborts, InANodeWithExchangedRolesTheJointsExchangeThePosesParts) {
  const testing::SequenceFolder folder(testing::GaitText());
  const auto sequence = std::make_unique<Sequence<float>>(ToRuntime(ReadSequence(folder.file())));
  for (Primitive<float>& primitive : sequence->primitives) {
    if (primitive.joint_count == 0) continue;
    primitive.aborts.span_count = 1;
    AbortSpan<float>& span = primitive.aborts.span_storage[0];
    span = {primitive.duration_s, AbortWay::kFold, 0, 0.5F, {}};
    for (std::size_t j = 0; j < 2; ++j)
      span.position_rad[j] = primitive.joints[j].limits.position_max_rad * (j == 0 ? 0.5F : 0.25F);
  }
  ExecutorConfig config;
  config.cycles = 2;
  for (const bool swapped : {false, true}) {
    ExecutorRig rig(
        config, sequence->graph,
        {sequence->primitives.begin(), sequence->primitives.begin() + sequence->primitive_count});
    PlayTo(rig, 1);
    for (int i = 0; i < 100000 && sequence->graph.node(rig.output.record.node).swapped != swapped;
         ++i) {
      rig.Tick();
    }
    const int node = rig.output.record.node;
    ASSERT_EQ(sequence->graph.node(node).swapped, swapped);
    ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
    rig.input.tick += 5;
    ASSERT_EQ(rig.Tick().reaction, Reaction::kFold);
    for (int i = 0; i < 20000; ++i) rig.Tick();
    for (int j = 0; j < 2; ++j) {
      const auto role = static_cast<std::size_t>(sequence->graph.RoleOf(node, j));
      EXPECT_EQ(rig.drives[static_cast<std::size_t>(j)]->setpoint.position_rad,
                sequence->PrimitiveOf(node).aborts.span_storage[0].position_rad[role]);
    }
  }
}

TEST(Aborts, AStrongerReactionTakesOverAndAWeakerOneDoesNot) {
  for (const AbortWay way : {AbortWay::kRollOut, AbortWay::kFold}) {
    ExecutorRig rig({}, OneWay(way));
    PlayTo(rig, 200);
    rig.input.tick += 5;
    rig.Tick();
    rig.Tick(OperatorCommand::kStop);  // is answered by a hold
    EXPECT_EQ(rig.output.record.reaction, ReactionOf(way));
    rig.drives[0]->reply.error = 4;
    EXPECT_EQ(rig.Tick().reaction, Reaction::kDamp);
    rig.input.send_status = Status::kLinkDown;
    EXPECT_EQ(rig.Tick().reaction, Reaction::kDisable);
  }
}

TEST(Aborts, DisarmingEndsEveryWayAtOnceAndTheNextRunIsAsEver) {
  for (const AbortWay way : kWays) {
    ExecutorRig rig({}, OneWay(way));
    PlayTo(rig, 200);
    rig.input.tick += 5;
    rig.Tick();
    rig.Tick(OperatorCommand::kDisarm);
    for (const auto& drive : rig.drives) EXPECT_EQ(drive->request, DriveRequest::kDisable);
    rig.Tick(OperatorCommand::kClearFaults);
    PlayTo(rig, 50);
    EXPECT_EQ(rig.output.record.reaction, Reaction::kIgnore);
    EXPECT_EQ(rig.output.record.faults, 0U);
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling, 1000));
  }
}

/// A random table for a motion.
std::vector<TableRow> RandomSpans(float duration_s, std::mt19937& random) {
  std::uniform_real_distribution<float> share(0.01F, 1.0F);
  std::vector<float> ends;
  const int inner = std::uniform_int_distribution<int>(0, kMaxAbortSpans - 1)(random);
  for (int i = 0; i < inner; ++i) ends.push_back(share(random) * duration_s * 0.999F);
  std::ranges::sort(ends);
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  ends.push_back(duration_s);
  std::vector<TableRow> spans;
  spans.reserve(ends.size());
  for (const float end : ends)
    spans.push_back({end, kWays[random() % kWays.size()], 0.02F * share(random), share(random)});
  return spans;
}

/// Whatever the table, the fault, the time and what comes after it: the setpoints keep every limit,
/// and a joint that is caught or folds keeps that of acceleration, too.
TEST(Aborts, NoSetpointIsOutsideALimitWhateverTheTimeTheWayAndWhatComesAfter) {
  std::mt19937 random(77);
  std::array<int, kReactionCount> seen{};
  for (int run = 0; run < 300; ++run) {
    MotionShape shape;
    shape.duration_s = 0.3;
    shape.joint_count = 1 + run % 3;
    const Primitive<float> bare = testing::RandomPrimitive<float>(shape, random);
    Primitive<float> motion = WithAborts(bare, RandomSpans(bare.duration_s, random));
    std::uniform_real_distribution<float> share(0.0F, 1.0F);
    for (AbortSpan<float>& span : motion.aborts.span_storage) {
      for (std::size_t j = 0; j < motion.motions().size(); ++j) {
        const JointLimits<float>& limits = motion.joints[j].limits;
        span.position_rad[j] = limits.position_min_rad +
                               share(random) * (limits.position_max_rad - limits.position_min_rad);
      }
    }
    const ExecutorConfig config;
    ExecutorRig rig(config, motion);
    PlayTo(rig, static_cast<std::int64_t>(random() % 299));
    const Fault fault = kAborting[random() % kAborting.size()];
    if (motion.joint_count == 1) {
      rig.input.tick += 4;
    } else {
      ProvokeAbort(rig, fault, static_cast<int>(3 + random() % 20));
    }
    std::array<JointSetpoint, kMaxJoints> last;
    for (int tick = 0; tick < 600; ++tick) {
      for (std::size_t j = 0; j < last.size(); ++j) last[j] = rig.output.record.joints[j].limited;
      if (tick == 100 && run % 2 == 0) rig.input.tick += 8;
      if (tick == 150 && run % 5 == 0) rig.drives[0]->reply.error = 3;
      const std::int64_t before = rig.output.record.tick;
      const TickRecord& record = rig.Tick();
      ++seen[static_cast<std::size_t>(record.reaction)];
      const auto elapsed = static_cast<float>(std::min<std::int64_t>(record.tick - before, 3));
      for (std::size_t j = 0; j < motion.motions().size(); ++j) {
        const JointSetpoint& now = record.joints[j].limited;
        const JointLimits<float>& limits = motion.joints[j].limits;
        ASSERT_GE(now.position_rad, limits.position_min_rad);
        ASSERT_LE(now.position_rad, limits.position_max_rad);
        ASSERT_LE(std::abs(now.velocity_rad_s), limits.velocity_max_rad_s);
        ASSERT_LE(std::abs(now.torque_nm), limits.torque_max_nm);
        ASSERT_LE(std::abs(now.position_rad - last[j].position_rad),
                  1.0011F * elapsed * limits.velocity_max_rad_s * config.period_s + 1e-6F);
        ASSERT_LE(std::abs(now.torque_nm - last[j].torque_nm),
                  elapsed * limits.torque_max_nm * config.period_s / config.torque_rise_s * 1.001F);
        const bool brakes = record.state == ExecutorState::kStopping ||
                            record.reaction == Reaction::kFold ||
                            record.reaction == Reaction::kHold;
        // Its first tick begins from wherever the motion was.
        if (!brakes || tick == 0) continue;
        ASSERT_LE(std::abs(now.velocity_rad_s - last[j].velocity_rad_s),
                  1.001F * elapsed * limits.acceleration_max_rad_s2 * config.period_s + 1e-5F)
            << "run " << run << ", tick " << tick << ", " << ToString(record.reaction);
      }
    }
  }
  for (const Reaction reaction :
       {Reaction::kHold, Reaction::kFold, Reaction::kRollOut, Reaction::kDamp}) {
    EXPECT_GE(seen[static_cast<std::size_t>(reaction)], 1000) << ToString(reaction);
  }
}

TEST(Aborts, ATableThatMakesNoSenseIsRefused) {
  const Primitive<float> bare = AbortedMotion();
  const auto configured = [](const Primitive<float>& motion) {
    return ExecutorRig({}, motion).configured;
  };
  const auto with = [&](auto change) {
    Primitive<float> motion =
        WithAborts(bare, {{0.2F, AbortWay::kRollOut}, {bare.duration_s, AbortWay::kFold}});
    change(motion.aborts);
    return configured(motion);
  };
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(with([](auto& /*aborts*/) {}), Status::kOk);
  EXPECT_EQ(with([](auto& a) { a.span_count = -1; }), Status::kInvalidArgument);
  EXPECT_EQ(with([](auto& a) { a.span_count = kMaxAbortSpans + 1; }), Status::kInvalidArgument);
  EXPECT_EQ(with([](auto& a) { a.span_count = 1; }), Status::kInvalidArgument)
      << "it ends too early";
  for (const float bad : {kNaN, 0.0F, -0.1F, 1.0F}) {
    EXPECT_EQ(with([&](auto& a) { a.span_storage[0].until_s = bad; }), Status::kInvalidArgument);
  }
  for (const float bad : {kNaN, 0.0F, 1.1F}) {
    EXPECT_EQ(with([&](auto& a) { a.span_storage[1].limits_share = bad; }),
              Status::kInvalidArgument);
  }
  for (const float bad : {kNaN, -0.001F, std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(with([&](auto& a) { a.span_storage[0].late_max_s = bad; }), Status::kInvalidArgument);
  }
  EXPECT_EQ(with([](auto& a) { a.span_storage[0].way = static_cast<AbortWay>(4); }),
            Status::kInvalidArgument);
  for (const float bad : {kNaN, 100.0F, -100.0F}) {
    EXPECT_EQ(with([&](auto& a) { a.span_storage[1].position_rad[1] = bad; }),
              Status::kInvalidArgument);
  }
}

/// The procedure's own part.
class AbortedRun : public ::testing::Test {
 protected:
  static RunProcedureConfig Config() {
    RunProcedureConfig config;
    config.hold_ticks = 50;
    config.fault_ticks = 40;
    config.stop_hold_ticks = 25;
    config.end_hold_ticks = 300;
    config.go_home = true;
    return config;
  }
  /// Plays a run that is aborted in this tick of the motion. @returns the ticks after it until the
  /// torque is off.
  int Play(ExecutorRig& rig, RunProcedure& procedure, int at, bool by_the_operator) {
    int running = 0, after = -1;
    for (int i = 0; i < 20000 && !procedure.done(); ++i) {
      if (rig.output.record.state == ExecutorState::kRunning) ++running;
      if (after >= 0 && rig.output.record.state != ExecutorState::kDisarmed) ++after;
      if (running == at && after < 0) {
        after = 0;
        if (by_the_operator) {
          procedure.RequestStop();
        } else {
          rig.input.tick += 5;
        }
      }
      went_home_ = went_home_ || rig.output.record.command == OperatorCommand::kGoHome;
      rig.Tick(procedure.Next(rig.output.record));
    }
    EXPECT_TRUE(procedure.done());
    return after;
  }
  bool went_home_ = false;
};

TEST_F(AbortedRun, IsNotDisturbedBeforeItsMotionHasEndedHoweverLongThatTakes) {
  for (const bool by_the_operator : {false, true}) {
    went_home_ = false;
    ExecutorRig rig({}, OneWay(AbortWay::kRollOut));
    RunProcedure procedure(Config());
    const int after = Play(rig, procedure, 100, by_the_operator);
    EXPECT_GE(after, 500) << "the motion has 500 ticks left, and a fault is answered for 40";
    EXPECT_EQ(rig.output.record.primitive_time_s, AbortedMotion().duration_s);
    EXPECT_EQ(procedure.outcome(), by_the_operator ? RunOutcome::kStopped : RunOutcome::kFault);
    EXPECT_EQ(went_home_, !by_the_operator) << "after a stop nothing moves any more";
  }
}

TEST_F(AbortedRun, IsHeldAtItsEndWhereTheJointsAreHeldAndLetGoWhereTheyAreDamped) {
  for (const AbortWay way : {AbortWay::kCatch, AbortWay::kFold, AbortWay::kDamp}) {
    ExecutorRig rig({}, OneWay(way));
    RunProcedure procedure(Config());
    const int after = Play(rig, procedure, 100, false);
    if (way == AbortWay::kDamp) {
      EXPECT_LE(after, 60);
    } else {
      EXPECT_GE(after, 300);
    }
    EXPECT_EQ(procedure.outcome(), RunOutcome::kFault);
  }
}

TEST(Aborts, AMotionThatIsRolledOutIsOverOnceItsLimitedSetpointIsAtItsEnd) {
  Primitive<float> motion = OneWay(AbortWay::kRollOut);
  for (auto& joint : motion.joints) joint.limits.velocity_max_rad_s *= 0.05F;  // It is held back.
  motion.following_tolerance_rad = 10;
  ExecutorRig rig({}, motion);
  PlayTo(rig, 100);
  ProvokeAbort(rig, Fault::kLateTick);
  ASSERT_EQ(rig.output.record.reaction, Reaction::kRollOut);
  int late = 0;
  for (int i = 0; i < 100000 && rig.output.record.reaction == Reaction::kRollOut; ++i) {
    rig.Tick();
    if (rig.output.record.primitive_time_s == motion.duration_s) ++late;
  }
  EXPECT_GT(late, 10) << "the plan was at its end long before";
  EXPECT_EQ(rig.output.record.reaction, Reaction::kHold);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_NEAR(rig.output.record.joints[j].limited.position_rad,
                motion.joints[j].position.control_points().back(), 1e-4F);
  }
}

}  // namespace
}  // namespace tumbler
