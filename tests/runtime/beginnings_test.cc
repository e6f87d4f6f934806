// With which node a run begins, when the robot may lie in several ways.

#include <gtest/gtest.h>

#include <numbers>

#include "runtime/core/executor.h"
#include "runtime/core/run_procedure.h"
#include "tests/support/executor_rig.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::MotionWithFeedback;
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

/// An executor at the start of the motion, with or without a sensor.
class LyingRig : public ExecutorRig {
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
      : ExecutorRig(config, TwoBeginnings(motion), {motion}) {
    if (has_sensor) {
      sensor.device = &device_;
      sensor.settings.repeats_max = 0;
      sensor.settings.jump_max_rad = 10;
    }
    Reconfigure();
    EXPECT_EQ(configured, Status::kOk);
    sensor_frames = SensorFrames(0, 0);
    EXPECT_TRUE(Reach(ExecutorState::kHolding));
    Tick(OperatorCommand::kMoveToStart);
    EXPECT_TRUE(TickUntil(ExecutorState::kHolding));
  }
  XsensMti device_;
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
