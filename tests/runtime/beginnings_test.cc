// With which node a run begins, when the robot may lie in several ways, and goes on after a fall.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <vector>

#include "runtime/executor/executor.h"
#include "runtime/executor/run_procedure.h"
#include "tests/support/executor_rig.h"
#include "tests/support/sensing_rig.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::MotionWithFeedback;
using testing::SensingRig;
using testing::SensorFrames;

constexpr double kOnItsBack_rad = std::numbers::pi;

/// A motion that may be begun lying at a pitch of 0 (node 0) or of pi (node 1), within 0.3 rad.
SequenceGraph<float> TwoBeginnings(const Primitive<float>& motion) {
  SequenceGraph<float> graph = GraphOf(motion);
  graph.node_count = 2;
  graph.node_storage[0].name = FixedString<48>("stand");
  graph.node_storage[1].name = FixedString<48>("rise");
  graph.beginning_count = 2;
  graph.beginning_storage[0] = {0, 0.0F};
  graph.beginning_storage[1] = {1, static_cast<float>(kOnItsBack_rad)};
  graph.beginning_within_rad = 0.3F;
  return graph;
}

/// One at the start of the motion.
class LyingRig : public SensingRig {
 public:
  LyingRig(const ExecutorConfig& config, bool has_sensor)
      : LyingRig(config, has_sensor, MotionWithFeedback(3)) {}

  /// What it answers to kRun, told this by its sensor.
  RefusalDetail Run(double pitch_rad, double rate_rad_s) {
    sensor_frames = SensorFrames(pitch_rad, rate_rad_s);
    Tick();
    return Tick(OperatorCommand::kRun).refusal;
  }

 private:
  LyingRig(const ExecutorConfig& config, bool has_sensor, const Primitive<float>& motion)
      : SensingRig(config, has_sensor, TwoBeginnings(motion), motion) {
    EXPECT_TRUE(Reach(ExecutorState::kHolding));
    Tick(OperatorCommand::kMoveToStart);
    EXPECT_TRUE(TickUntil(ExecutorState::kHolding));
  }
};

TEST(Beginnings, TheMeasuredPitchSaysWithWhichNodeARunBegins) {
  for (const auto& [pitch_rad, node] : {std::pair{0.0, 0},
                                        {0.29, 0},
                                        {-0.29, 0},
                                        {kOnItsBack_rad, 1},
                                        {-kOnItsBack_rad, 1},
                                        {kOnItsBack_rad - 0.29, 1}}) {
    LyingRig rig({}, true);
    EXPECT_EQ(rig.Run(pitch_rad, 0).refusal, Refusal::kNone) << pitch_rad;
    EXPECT_EQ(rig.executor.state(), ExecutorState::kRunning);
    rig.Tick();
    EXPECT_EQ(rig.output.record.node, node) << pitch_rad;
  }
}

TEST(Beginnings, ARobotThatLiesOtherwiseOrStillTurnsDoesNotBegin) {
  LyingRig rig({}, true);
  for (const double pitch_rad :
       {0.31, -0.31, kOnItsBack_rad / 2, -kOnItsBack_rad / 2, kOnItsBack_rad - 0.31}) {
    const RefusalDetail refusal = rig.Run(pitch_rad, 0);
    EXPECT_EQ(refusal.refusal, Refusal::kLiesOtherwise) << pitch_rad;
    EXPECT_GT(refusal.value.real(), 0.3F);
    EXPECT_EQ(refusal.limit.real(), 0.3F);
    EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding);
  }
  const RefusalDetail turning = rig.Run(0, -0.5);
  EXPECT_EQ(turning.refusal, Refusal::kNotAtRest);
  EXPECT_NEAR(turning.value.real(), 0.5F, 0.01F);
}

TEST(Beginnings, WithoutWhatTheSensorSaysOnlyTheOperatorKnows) {
  for (const bool told : {false, true}) {
    ExecutorConfig config;
    if (told) config.begin = 1;
    LyingRig rig(config, true);
    rig.sensor_frames.clear();
    for (int i = 0; i < 20; ++i) rig.Tick();
    const RefusalDetail refusal = rig.Tick(OperatorCommand::kRun).refusal;
    EXPECT_EQ(refusal.refusal, told ? Refusal::kNone : Refusal::kPitchUnknown);
    if (!told) {
      EXPECT_EQ(refusal.value.integer(), static_cast<int>(SensorStatus::kStale));
    }
    rig.Tick();
    EXPECT_EQ(rig.output.record.node, told ? 1 : 0);
  }
}

TEST(Beginnings, WithoutASensorTheOperatorsWordCountsAndElseTheStart) {
  for (const int begin : {-1, 0, 1}) {
    ExecutorConfig config;
    config.begin = begin;
    LyingRig rig(config, false);
    EXPECT_EQ(rig.Run(kOnItsBack_rad / 2, 3).refusal, Refusal::kNone) << "nobody hears the sensor";
    rig.Tick();
    EXPECT_EQ(rig.output.record.node, begin == 1 ? 1 : 0);
  }
}

TEST(Beginnings, ASensorThatContradictsTheOperatorIsBelieved) {
  ExecutorConfig config;
  config.begin = 1;
  LyingRig rig(config, true);
  EXPECT_EQ(rig.Run(0, 0).refusal, Refusal::kLiesOtherwise);
  EXPECT_EQ(rig.Run(kOnItsBack_rad, 0).refusal, Refusal::kNone);
}

TEST(Beginnings, ExecutorsRefuseThoseThatMakeNoSense) {
  const Primitive<float> motion = MotionWithFeedback(3);
  const auto configured = [&](const auto& change) {
    ExecutorConfig config;
    SequenceGraph<float> graph = TwoBeginnings(motion);
    change(config, graph);
    return ExecutorRig(config, graph, {motion}).configured;
  };
  EXPECT_EQ(configured([](auto&, auto&) {}), Status::kOk);
  EXPECT_EQ(configured([](auto& config, auto&) { config.begin = 1; }), Status::kOk);
  EXPECT_EQ(configured([](auto& config, auto&) { config.begin = 2; }), Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto& config, auto& graph) {
              config.begin = 1;
              graph.beginning_count = 1;
            }),
            Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto&, auto& graph) { graph.beginning_storage[1].node = 2; }),
            Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto&, auto& graph) { graph.beginning_count = 99; }),
            Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto&, auto& graph) { graph.node_storage[1].after_fall = 2; }),
            Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto&, auto& graph) { graph.last_pitch_rad[1] = NAN; }),
            Status::kInvalidArgument);
  EXPECT_EQ(configured([](auto& config, auto&) { config.get_ups_max = -1; }),
            Status::kInvalidArgument);
}

TEST(Beginnings, ARunWaitsForAMomentUntilTheRobotIsStill) {
  RunProcedureConfig config;
  config.start_ticks_max = 20;
  for (const int still_after : {10, 30}) {
    LyingRig rig({}, true);
    rig.Tick(OperatorCommand::kDisarm);
    RunProcedure procedure(config);
    int asked = 0;
    for (int i = 0; i < 20000 && !procedure.done(); ++i) {
      if (rig.output.record.refusal.refusal == Refusal::kNotAtRest) ++asked;
      rig.sensor_frames = SensorFrames(0, asked < still_after ? 1.0 : 0.0);
      rig.Tick(procedure.Next(rig.output.record));
    }
    EXPECT_EQ(procedure.outcome(),
              still_after == 10 ? RunOutcome::kCompleted : RunOutcome::kRefused);
    if (still_after == 30) {
      EXPECT_EQ(procedure.refusal().refusal, Refusal::kNotAtRest);
    }
  }
}

/// A motion that may follow itself, wherever it ends.
Primitive<float> MotionAfterItself() {
  Primitive<float> motion = MotionWithFeedback(3);
  motion.entry_tolerance_rad = 100;
  return motion;
}

/// The motion over and over ("stand", a cycle), and one that gets up from a pitch of pi ("rise"),
/// which ends as the other.
SequenceGraph<float> Rounds(const Primitive<float>& motion) {
  SequenceGraph<float> graph = TwoBeginnings(motion);
  graph.node_storage[0].safe = graph.node_storage[0].ends_cycle = true;
  graph.node_storage[1].safe = true;
  graph.edge_count = 2;
  graph.edge_storage[0] = {0, 0, 0.05F, EdgeCondition::kAlways, {}};
  graph.edge_storage[1] = {1, 0, 0.05F, EdgeCondition::kAlways, {}};
  return graph;
}

/// The same with "the other way" (node 2) after a fall in "stand".
SequenceGraph<float> RoundsWithAnotherWay(const Primitive<float>& motion) {
  SequenceGraph<float> graph = Rounds(motion);
  graph.node_count = 3;
  graph.node_storage[2] = graph.node_storage[0];
  graph.node_storage[2].name = FixedString<48>("the other way");
  graph.node_storage[0].after_fall = 2;
  graph.edge_count = 3;
  graph.edge_storage[2] = {2, 0, 0.05F, EdgeCondition::kAlways, {}};
  return graph;
}

/// An executor that plays them.
class FallingRig : public SensingRig {
 public:
  explicit FallingRig(const ExecutorConfig& config, bool has_sensor = true)
      : FallingRig(config, has_sensor, Rounds(MotionAfterItself()), {MotionAfterItself()}) {}
  FallingRig(const ExecutorConfig& config, const SequenceGraph<float>& graph)
      : FallingRig(config, graph, {MotionAfterItself()}) {}
  FallingRig(const ExecutorConfig& config, const SequenceGraph<float>& graph,
             const std::vector<Primitive<float>>& motions)
      : FallingRig(config, true, graph, motions) {}

  /// Ticks until this node is running.
  bool TickUntilPlays(int node) {
    const auto plays = [&] {
      return executor.state() == ExecutorState::kRunning && output.record.node == node;
    };
    for (int i = 0; i < 100000 && !plays(); ++i) Tick();
    return plays();
  }
  /// Plays the present node to its end, and says then how the robot lies.
  bool EndLying(double pitch_rad) {
    sensor_frames = SensorFrames(pitch_rad, 0);
    return TickUntil(ExecutorState::kSettling) && TickWhile(ExecutorState::kSettling);
  }
  bool TickWhile(ExecutorState state) {
    for (int i = 0; i < 100000 && executor.state() == state; ++i) Tick();
    return executor.state() != state;
  }

 private:
  FallingRig(const ExecutorConfig& config, bool has_sensor, const SequenceGraph<float>& graph,
             const std::vector<Primitive<float>>& motions)
      : SensingRig(config, has_sensor, graph, motions) {
    EXPECT_TRUE(Reach(ExecutorState::kRunning));
  }
};

ExecutorConfig GetsUp(int times) {
  ExecutorConfig config;
  config.get_ups_max = times;
  return config;
}

TEST(Falls, ARobotThatIsNotWhereAMotionLeavesItIsAFault) {
  for (const double pitch_rad : {0.31, -0.31, kOnItsBack_rad}) {
    FallingRig rig({});
    ASSERT_TRUE(rig.EndLying(pitch_rad));
    EXPECT_EQ(rig.executor.state(), ExecutorState::kFault) << pitch_rad;
    const TickRecord& record = rig.Tick();
    EXPECT_EQ(record.first_fault.fault, Fault::kFallen);
    EXPECT_EQ(record.first_fault.joint, -1);
    EXPECT_NEAR(record.first_fault.value.real(), std::abs(pitch_rad), 0.01);
    EXPECT_EQ(record.first_fault.limit.real(), 0.3F);
    EXPECT_EQ(record.cycles, 0) << "a cycle that ends in a fall is not complete";
  }
  FallingRig rig({});
  ASSERT_TRUE(rig.EndLying(2 * kOnItsBack_rad - 0.29));
  EXPECT_EQ(rig.executor.state(), ExecutorState::kRunning);
  EXPECT_EQ(rig.Tick().cycles, 1);
}

TEST(Falls, ARobotThatMayGetsUpAndGoesOnAsOftenAsItMay) {
  FallingRig rig(GetsUp(2));
  ASSERT_TRUE(rig.EndLying(0));
  for (int fall = 0; fall < 2; ++fall) {
    ASSERT_TRUE(rig.EndLying(kOnItsBack_rad));
    ASSERT_EQ(rig.executor.state(), ExecutorState::kMovingToStart);
    ASSERT_TRUE(rig.TickWhile(ExecutorState::kMovingToStart));
    ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
    EXPECT_EQ(rig.Tick().node, 1);
    ASSERT_TRUE(rig.EndLying(0));
    EXPECT_EQ(rig.Tick().node, 0);
    EXPECT_EQ(rig.output.record.cycles, 1) << "that before the first fall";
    EXPECT_EQ(rig.output.record.faults, 0U);
  }
  ASSERT_TRUE(rig.EndLying(kOnItsBack_rad));
  EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  EXPECT_EQ(rig.Tick().first_fault.fault, Fault::kFallen);
}

TEST(Falls, WhereThereIsAnotherWayItIsTakenUntilTheRobotFallsThereToo) {
  FallingRig rig(GetsUp(9), RoundsWithAnotherWay(MotionAfterItself()));
  // Lies as "stand" begins, and begins in its place what it fell in last not.
  const auto falls = [&rig] {
    return rig.EndLying(1) && rig.executor.state() == ExecutorState::kMovingToStart;
  };
  const auto begins = [&rig] {
    rig.sensor_frames = SensorFrames(0, 0);
    return rig.TickWhile(ExecutorState::kMovingToStart) &&
           rig.executor.state() == ExecutorState::kRunning;
  };
  EXPECT_EQ(rig.Tick().node, 0);
  ASSERT_TRUE(falls() && begins());
  EXPECT_EQ(rig.Tick().node, 2);
  ASSERT_TRUE(rig.EndLying(0));
  EXPECT_EQ(rig.Tick().node, 2) << "along the edge to \"stand\", too";
  ASSERT_TRUE(falls() && begins());
  EXPECT_EQ(rig.Tick().node, 0) << "fell there last";
  ASSERT_TRUE(falls() && begins());
  EXPECT_EQ(rig.Tick().node, 2);
  // A new run knows nothing of falls before it.
  rig.Tick(OperatorCommand::kDisarm);
  rig.sensor_frames = SensorFrames(0, 0);
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  EXPECT_EQ(rig.Tick().node, 0);
}

TEST(Falls, TheOtherWayIsBegunWithAlsoAfterRising) {
  FallingRig rig(GetsUp(9), RoundsWithAnotherWay(MotionAfterItself()));
  ASSERT_TRUE(rig.EndLying(kOnItsBack_rad));
  ASSERT_TRUE(rig.TickWhile(ExecutorState::kMovingToStart));
  EXPECT_EQ(rig.Tick().node, 1);
  ASSERT_TRUE(rig.EndLying(0));
  EXPECT_EQ(rig.Tick().node, 2);
  // A fall in what has no other way changes nothing.
  FallingRig rises(GetsUp(9), RoundsWithAnotherWay(MotionAfterItself()));
  ASSERT_TRUE(rises.EndLying(kOnItsBack_rad));
  ASSERT_TRUE(rises.TickWhile(ExecutorState::kMovingToStart));
  ASSERT_TRUE(rises.EndLying(kOnItsBack_rad)) << "in the rise";
  ASSERT_TRUE(rises.TickWhile(ExecutorState::kMovingToStart));
  ASSERT_TRUE(rises.EndLying(0));
  EXPECT_EQ(rises.Tick().node, 2);
}

TEST(Falls, TheOtherWayBeginsWithinItsOwnEntryTolerance) {
  const Primitive<float> motion = MotionAfterItself();
  Primitive<float> exact = motion;
  exact.entry_tolerance_rad = 1e-3F;
  SequenceGraph<float> graph = RoundsWithAnotherWay(motion);
  graph.node_storage[2].primitive = 1;
  for (const float off_rad : {0.5e-3F, 2e-3F}) {
    FallingRig rig(GetsUp(9), graph, {motion, exact});
    ASSERT_TRUE(rig.EndLying(1));
    rig.sensor_frames = SensorFrames(0, 0);
    for (int i = 0; i < 100000 && rig.executor.state() == ExecutorState::kMovingToStart; ++i) {
      rig.follow = false;
      rig.drives[0]->reply.position_rad = rig.drives[0]->setpoint.position_rad + off_rad;
      rig.drives[1]->reply.position_rad = rig.drives[1]->setpoint.position_rad;
      rig.Tick();
    }
    EXPECT_EQ(rig.executor.state(),
              off_rad < 1e-3F ? ExecutorState::kRunning : ExecutorState::kFault);
  }
}

TEST(Falls, FromFallToRiseEverySetpointIsWithinTheLimits) {
  FallingRig rig(GetsUp(1));
  const Primitive<float> motion = MotionAfterItself();
  rig.sensor_frames = SensorFrames(kOnItsBack_rad, 0);
  std::array<float, 2> last{rig.drives[0]->setpoint.position_rad,
                            rig.drives[1]->setpoint.position_rad};
  int moved = 0;
  for (int i = 0; i < 100000 && !(rig.output.record.node == 1); ++i) {
    const bool moves = rig.Tick().state == ExecutorState::kMovingToStart;
    for (std::size_t j = 0; j < 2; ++j) {
      const float position = rig.drives[j]->setpoint.position_rad;
      const JointLimits<float>& limits = motion.joints[j].limits;
      const float most =
          (moves ? ExecutorConfig{}.move_fraction : 1.0F) * limits.velocity_max_rad_s;
      EXPECT_LE(std::abs(position - last[j]), most * 0.001F + 1e-5F);
      EXPECT_LE(position, limits.position_max_rad);
      EXPECT_GE(position, limits.position_min_rad);
      if (moves && position != last[j]) ++moved;
      last[j] = position;
    }
  }
  EXPECT_EQ(rig.output.record.node, 1);
  EXPECT_GT(moved, 100);
}

/// The frames of a sensor that is turned about its link's axis, out of the robot's plane.
std::vector<CanFrame> SidewaysFrames(double roll_rad, double rate_rad_s) {
  return {XsensQuaternionFrame({}, {std::cos(roll_rad / 2), std::sin(roll_rad / 2), 0, 0}),
          XsensRateFrame({}, {rate_rad_s, 0, 0})};
}

TEST(Falls, ARobotThatLiesOnItsSideHasFallenAndDoesNotGetUp) {
  for (const double roll_rad : {0.4, -0.8, 1.57}) {
    FallingRig rig(GetsUp(3));
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
    rig.sensor_frames = SidewaysFrames(roll_rad, 0);
    ASSERT_TRUE(rig.TickWhile(ExecutorState::kSettling));
    const TickRecord& record = rig.Tick();
    EXPECT_EQ(record.sensor.status, SensorStatus::kTilted);
    EXPECT_EQ(record.state, ExecutorState::kFault) << roll_rad;
    EXPECT_EQ(record.first_fault.fault, Fault::kFallen);
    EXPECT_EQ(record.reaction, Reaction::kHold);
    EXPECT_NEAR(record.first_fault.value.real(), std::abs(roll_rad), 0.01);
    EXPECT_EQ(record.cycles, 0) << "a cycle that ends in a fall is not complete";
    EXPECT_NE(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kNone);
  }
}

TEST(Falls, ARobotThatStillTipsOverIsAwaitedForASecond) {
  FallingRig rig(GetsUp(3)), at_rest(GetsUp(3));
  int ticks = 0, at_once = 0;
  for (FallingRig* const each : {&rig, &at_rest}) {
    ASSERT_TRUE(each->TickUntil(ExecutorState::kSettling));
    each->sensor_frames = SidewaysFrames(0.9, each == &rig ? 0.5 : 0);
    int& count = each == &rig ? ticks : at_once;
    for (; each->executor.state() == ExecutorState::kSettling && count < 5000; ++count)
      each->Tick();
    EXPECT_EQ(each->Tick().first_fault.fault, Fault::kFallen);
  }
  EXPECT_EQ(ticks - at_once, 1000);
}

TEST(Falls, WhereTheSensorThatTellsOfThemIsNotBelievedTheRobotStaysOrGoesHome) {
  for (const bool tilted : {false, true}) {
    FallingRig rig(GetsUp(3));
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
    // For a moment it says what cannot be, and then that all is well.
    rig.sensor_frames = tilted ? SidewaysFrames(1.2, 0) : SensorFrames(0, 60);
    rig.Tick();
    rig.sensor_frames = SensorFrames(0, 0);
    ASSERT_TRUE(rig.TickWhile(ExecutorState::kSettling));
    const TickRecord& record = rig.Tick();
    const SensorStatus status = tilted ? SensorStatus::kTilted : SensorStatus::kTooFast;
    EXPECT_EQ(record.first_fault.fault, Fault::kPitchUnknown);
    EXPECT_EQ(record.first_fault.value.integer(), static_cast<int>(status));
    EXPECT_EQ(record.reaction, Reaction::kHold);
    // What has been answered does not stop the way home.
    ASSERT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kNone);
    ASSERT_TRUE(rig.TickWhile(ExecutorState::kSettling));
    for (int i = 0; i < 100000 && rig.executor.state() == ExecutorState::kRunning; ++i) rig.Tick();
    for (int i = 0; i < 100000 && rig.executor.state() == ExecutorState::kSettling; ++i) rig.Tick();
    EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding);
  }
}

TEST(Falls, ASensorThatIsSilentAtTheEndOfANodeIsAwaitedForASecond) {
  FallingRig rig({}), back({});
  int ticks = 0;
  for (FallingRig* const each : {&rig, &back}) {
    ASSERT_TRUE(each->TickUntil(ExecutorState::kSettling));
    each->sensor_frames.clear();
  }
  const int settles = static_cast<int>(std::lround(rig.executor.graph().edge(0).settle_s * 1000));
  for (; rig.executor.state() == ExecutorState::kSettling && ticks < 5000; ++ticks) rig.Tick();
  EXPECT_NEAR(ticks, settles + 1000, 2);
  EXPECT_EQ(rig.Tick().first_fault.fault, Fault::kPitchUnknown);
  EXPECT_EQ(rig.output.record.first_fault.value.integer(), static_cast<int>(SensorStatus::kStale));
  for (int i = 0; i < settles + 500; ++i) back.Tick();
  ASSERT_EQ(back.executor.state(), ExecutorState::kSettling);
  back.sensor_frames = SensorFrames(0, 0);
  ASSERT_TRUE(back.TickWhile(ExecutorState::kSettling));
  EXPECT_EQ(back.executor.state(), ExecutorState::kRunning) << "it was only late";
}

TEST(Falls, WhereNobodyKnowsOfTheFallTheSequenceGoesOn) {
  ExecutorConfig ignores, unknown = GetsUp(3);
  for (std::size_t s = 1; s < kExecutorStateCount; ++s) {
    ignores.reactions.Set(Fault::kFallen, static_cast<ExecutorState>(s), Reaction::kIgnore);
    unknown.reactions.Set(Fault::kPitchUnknown, static_cast<ExecutorState>(s), Reaction::kIgnore);
  }
  FallingRig without(GetsUp(0), false), silent(unknown), ignored(ignores);
  for (FallingRig* const rig : {&without, &silent, &ignored}) {
    rig->sensor_frames = SensorFrames(kOnItsBack_rad, 0);
    if (rig == &silent) rig->sensor_frames.clear();
    ASSERT_TRUE(rig->TickUntil(ExecutorState::kSettling));
    ASSERT_TRUE(rig->TickWhile(ExecutorState::kSettling));
    EXPECT_EQ(rig->executor.state(), ExecutorState::kRunning);
    EXPECT_EQ(rig->Tick().node, 0);
    EXPECT_EQ(rig->output.record.cycles, 1);
  }
}

TEST(Falls, ARobotThatLiesAsNoMotionBeginsOrDoesNotComeToRestStaysAfterASecond) {
  for (const bool turns : {false, true}) {
    FallingRig rig(GetsUp(9));
    const double pitch_rad = turns ? kOnItsBack_rad : kOnItsBack_rad / 2;
    ASSERT_TRUE(rig.EndLying(pitch_rad));
    ASSERT_EQ(rig.executor.state(), ExecutorState::kMovingToStart);
    rig.sensor_frames = SensorFrames(pitch_rad, turns ? 1.0 : 0.0);
    int ticks = 0, still = 0;
    for (; ticks < 100000 && rig.executor.state() == ExecutorState::kMovingToStart; ++ticks) {
      const float before = rig.drives[0]->setpoint.position_rad;
      rig.Tick();
      still = rig.drives[0]->setpoint.position_rad == before ? still + 1 : 0;
    }
    EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
    EXPECT_EQ(rig.Tick().first_fault.fault, Fault::kFallen);
    EXPECT_NEAR(rig.output.record.first_fault.value.real(), pitch_rad, 0.01);
    EXPECT_NEAR(still, 1000, 20) << "joints at the start for a second";
  }
}

TEST(Falls, WhatTheOperatorSaidOfTheBeginningIsOverOnceTheRobotHasFallen) {
  ExecutorConfig config = GetsUp(1);
  config.begin = 0;
  FallingRig rig(config);
  EXPECT_EQ(rig.output.record.node, 0);
  ASSERT_TRUE(rig.EndLying(kOnItsBack_rad));
  ASSERT_TRUE(rig.TickWhile(ExecutorState::kMovingToStart));
  ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
  EXPECT_EQ(rig.Tick().node, 1) << "it lies as that one begins";
}

TEST(Falls, WhereAJointIsOutsideTheLimitsOfTheStartNobodyGetsUp) {
  const Primitive<float> first = MotionAfterItself();
  for (const bool outside : {false, true}) {
    Primitive<float> second = first;
    const auto knots = first.joints[0].position.knots();
    const auto path = first.joints[0].position.control_points();
    std::vector<float> points(path.begin(), path.end());
    const float end_rad = first.joints[0].limits.position_max_rad + (outside ? 0.1F : -0.1F);
    for (std::size_t i = 0; i < 3; ++i) points[points.size() - 1 - i] = end_rad;
    ASSERT_EQ(
        second.joints[0].position.Assign(5, std::vector<float>(knots.begin(), knots.end()), points),
        Status::kOk);
    for (auto& joint : second.joints) joint.limits = {-20, 20, 500, 1e5F, 10};
    SequenceGraph<float> graph = RoundsWithAnotherWay(first);
    graph.edge_storage[0].to = 2;
    graph.node_storage[2].primitive = 1;
    FallingRig rig(GetsUp(1), graph, {first, second});
    ASSERT_TRUE(rig.TickUntilPlays(2));
    ASSERT_TRUE(rig.EndLying(kOnItsBack_rad));
    EXPECT_EQ(rig.executor.state(),
              outside ? ExecutorState::kFault : ExecutorState::kMovingToStart);
    if (outside) {
      EXPECT_EQ(rig.Tick().first_fault.fault, Fault::kFallen);
    }
  }
}

TEST(Executor, AFrameWithTheSensorsIdentifierInTheOtherFormatIsLeftToTheDrives) {
  const Primitive<float> motion = MotionWithFeedback(3);
  XsensMtiConfig config;
  config.rate_id = 101;  // The number of the second drive.
  XsensMti device(config);
  ExecutorRig rig({}, motion);
  rig.sensor.device = &device;
  rig.Reconfigure();
  ASSERT_EQ(rig.configured, Status::kOk);
  rig.silent[1] = true;
  CanFrame frame = XsensRateFrame(config, {0, 0, 0});
  rig.sensor_frames = {frame};
  rig.Tick();
  EXPECT_EQ(rig.output.record.joints[1].reply_age_ticks, -1) << "that was the sensor";
  frame.extended = true;
  rig.sensor_frames = {frame};
  rig.Tick();
  EXPECT_EQ(rig.output.record.joints[1].reply_age_ticks, 0);
}

TEST(Falls, TheOperatorIsObeyedWhileTheRobotGetsUp) {
  FallingRig stopped(GetsUp(1));
  ASSERT_TRUE(stopped.EndLying(kOnItsBack_rad));
  ASSERT_EQ(stopped.Tick(OperatorCommand::kStop).state, ExecutorState::kStopping);
  ASSERT_TRUE(stopped.TickUntil(ExecutorState::kHolding));
  for (int i = 0; i < 3000; ++i) stopped.Tick();
  EXPECT_EQ(stopped.executor.state(), ExecutorState::kHolding) << "it does not get up after a stop";

  for (const bool before : {false, true}) {
    FallingRig finishes(GetsUp(1));
    if (before) finishes.Tick(OperatorCommand::kFinish);
    ASSERT_TRUE(finishes.EndLying(kOnItsBack_rad));
    if (before) {
      EXPECT_EQ(finishes.executor.state(), ExecutorState::kFault) << "no new motion begins";
      EXPECT_EQ(finishes.Tick().first_fault.fault, Fault::kFallen);
      continue;
    }
    finishes.Tick(OperatorCommand::kFinish);
    ASSERT_TRUE(finishes.TickWhile(ExecutorState::kMovingToStart));
    EXPECT_EQ(finishes.executor.state(), ExecutorState::kHolding) << "it stays down";
  }
}

TEST(Falls, ACycleWhoseEndIsCutShortCountsOnlyWhereTheRobotHasNotFallen) {
  for (const double pitch_rad : {0.29, kOnItsBack_rad}) {
    const int cycles = pitch_rad < 1 ? 1 : 0;
    for (const char* const how : {"stop", "disarm", "late tick"}) {
      FallingRig rig(GetsUp(1));
      rig.sensor_frames = SensorFrames(pitch_rad, 0);
      ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
      EXPECT_EQ(rig.output.record.cycles, 1);
      if (std::string_view(how) == "stop") {
        rig.Tick(OperatorCommand::kStop);
      } else if (std::string_view(how) == "disarm") {
        rig.Tick(OperatorCommand::kDisarm);
      } else {
        rig.input.tick += 100;
        rig.Tick();
        EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
        rig.Tick(OperatorCommand::kDisarm);  // Taken back once.
      }
      EXPECT_EQ(rig.Tick().cycles, cycles) << how << " at a pitch of " << pitch_rad;
    }
  }
}

TEST(Falls, FromAFallThatIsAFaultNoWayLeadsHome) {
  for (const bool knows : {true, false}) {
    FallingRig rig({});
    ASSERT_TRUE(rig.EndLying(kOnItsBack_rad));
    ASSERT_EQ(rig.executor.state(), ExecutorState::kFault);
    if (!knows) rig.sensor_frames.clear();
    for (int i = 0; i < 20; ++i) rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kFaultLatched);
    EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
    EXPECT_EQ(rig.output.record.cycles, 0);
  }
}

TEST(Falls, WhoCannotGetUpIsHeldAlsoWhereTheFaultIsIgnored) {
  ExecutorConfig config = GetsUp(3);
  for (std::size_t s = 1; s < kExecutorStateCount; ++s)
    config.reactions.Set(Fault::kFallen, static_cast<ExecutorState>(s), Reaction::kIgnore);
  FallingRig rig(config);
  ASSERT_TRUE(rig.EndLying(kOnItsBack_rad));
  ASSERT_EQ(rig.executor.state(), ExecutorState::kMovingToStart);
  rig.sensor_frames.clear();
  ASSERT_TRUE(rig.TickWhile(ExecutorState::kMovingToStart));
  EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  EXPECT_NEAR(rig.Tick().first_fault.value.real(), kOnItsBack_rad, 0.01) << "by which it fell";
}

TEST(Falls, OnTheWayHomeAfterAFaultNobodyGetsUp) {
  FallingRig rig(GetsUp(9));
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling));
  rig.input.tick += 100;  // A late tick: a hold at the end of the node.
  rig.Tick();
  ASSERT_EQ(rig.executor.state(), ExecutorState::kFault);
  rig.sensor_frames = SensorFrames(kOnItsBack_rad, 0);
  rig.Tick();
  ASSERT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kNone);
  ASSERT_TRUE(rig.TickWhile(ExecutorState::kSettling));
  EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  EXPECT_NE(rig.Tick().faults & (1U << static_cast<unsigned>(Fault::kFallen)), 0U);
}

TEST(Falls, ARunGoesThroughAFallToItsEndAndTheNextOneMayFallAgain) {
  ExecutorConfig config = GetsUp(1);
  config.cycles = 2;
  FallingRig rig(config);
  rig.Tick(OperatorCommand::kDisarm);
  for (int run = 0; run < 2; ++run) {
    RunProcedure procedure({});
    int falls = 0, rises = 0;
    for (int i = 0; i < 200000 && !procedure.done(); ++i) {
      const TickRecord& last = rig.output.record;
      const bool falls_now =
          falls == 0 && last.state == ExecutorState::kRunning && last.cycles == 1 && last.node == 0;
      if (falls_now) {
        ++falls;
        rig.sensor_frames = SensorFrames(kOnItsBack_rad, 0);
      }
      if (last.state == ExecutorState::kRunning && last.node == 1) {
        rises = 1;
        rig.sensor_frames = SensorFrames(0, 0);
      }
      rig.Tick(procedure.Next(last));
    }
    EXPECT_EQ(procedure.outcome(), RunOutcome::kCompleted);
    EXPECT_EQ(falls, 1);
    EXPECT_EQ(rises, 1);
    EXPECT_EQ(rig.output.record.cycles, 2);
  }
}

TEST(Executor, ALimpJointOnItsStopIsArmedAtItsLimit) {
  const Primitive<float> motion = MotionWithFeedback(3);
  const float limit = motion.joints[1].limits.position_max_rad;
  for (const float beyond : {0.015F, 0.025F}) {
    ExecutorRig rig({}, motion);
    rig.drives[1]->reply.position_rad = limit + beyond;
    rig.Tick();
    const Refusal refusal = rig.Tick(OperatorCommand::kArm).refusal.refusal;
    EXPECT_EQ(refusal, beyond < 0.02F ? Refusal::kNone : Refusal::kOutsideLimits);
    if (refusal != Refusal::kNone) continue;
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 1000));
    EXPECT_LE(rig.drives[1]->setpoint.position_rad, limit);
  }
}

}  // namespace
}  // namespace tumbler
