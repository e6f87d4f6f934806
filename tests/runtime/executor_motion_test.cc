// How the executor moves: along a motion, to its start, through missed ticks, and to rest.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::Motion;
using testing::MotionShape;
using testing::RandomPrimitive;
using testing::Start;

TEST(Executor, PlaysTheSplinesTickByTick) {
  const Primitive<float> primitive = Motion(8);
  for (const float speed : {1.0F, 0.5F, 0.1F}) {
    ExecutorConfig config;
    config.speed = speed;
    config.torque_rise_s = 1e-6F;  // Otherwise the feed-forward would change slowly at the splice.
    ExecutorRig rig(config, primitive);
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kMoveToStart);
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kRun);
    const auto expected_ticks =
        static_cast<std::int64_t>(std::ceil(1.2 / (0.001 * static_cast<double>(speed)) - 1e-3));
    EXPECT_NEAR(static_cast<double>(rig.executor.run_ticks()), static_cast<double>(expected_ticks),
                1);
    std::int64_t n = 0;
    while (rig.executor.state() == ExecutorState::kRunning) {
      const double t = std::min(static_cast<double>(n) * 0.001 * static_cast<double>(speed), 1.2);
      EXPECT_NEAR(rig.output.record.primitive_time_s, t, 1e-6);
      for (std::size_t j = 0; j < 2; ++j) {
        const auto sample = primitive.joints[j].position.Evaluate(static_cast<float>(t));
        const JointRecord& record = rig.output.record.joints[j];
        EXPECT_NEAR(record.limited.position_rad, sample.value, 2e-5);
        EXPECT_NEAR(record.limited.velocity_rad_s, speed * sample.first, 2e-3);
        EXPECT_NEAR(record.planned_acceleration_rad_s2, speed * speed * sample.second,
                    1e-3F * primitive.joints[j].limits.acceleration_max_rad_s2);
        const float torque = primitive.joints[j].torque.Evaluate(static_cast<float>(t)).value;
        EXPECT_NEAR(record.limited.torque_nm, speed * speed * torque, 2e-4);
        EXPECT_FALSE(record.limit_active);
      }
      rig.Tick();
      ++n;
    }
    EXPECT_EQ(n, rig.executor.run_ticks());
    EXPECT_EQ(rig.output.record.joints[0].planned_acceleration_rad_s2, 0);
    EXPECT_EQ(rig.output.record.primitive_time_s, primitive.duration_s);
    EXPECT_FLOAT_EQ(rig.output.record.joints[0].limited.position_rad,
                    primitive.joints[0].position.control_points().back());
  }
}

TEST(Executor, SharedKnotsChangeNoBitOfASetpoint) {
  // The second joint gets knots of its own, and then those of the first. Either way its setpoints
  // must be those of its splines.
  std::mt19937 random(9);
  MotionShape shape;
  Primitive<float> shared = RandomPrimitive<float>(shape, random);
  Primitive<float> distinct = shared;
  shape.control_points = 17;
  distinct.joints[0] = RandomPrimitive<float>(shape, random).joints[0];
  for (const Primitive<float>& primitive : {shared, distinct}) {
    ExecutorRig rig({}, primitive);
    ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
    while (rig.executor.state() == ExecutorState::kRunning) {
      const TickRecord& record = rig.Tick();
      if (record.state != ExecutorState::kRunning) break;
      for (std::size_t j = 0; j < 2; ++j) {
        const auto sample = primitive.joints[j].position.Evaluate(record.primitive_time_s);
        ASSERT_EQ(record.joints[j].planned.position_rad, sample.value);
        ASSERT_EQ(record.joints[j].planned.velocity_rad_s, sample.first);
        ASSERT_EQ(record.joints[j].planned_acceleration_rad_s2, sample.second);
        ASSERT_EQ(record.joints[j].planned.torque_nm,
                  primitive.joints[j].torque.Evaluate(record.primitive_time_s).value);
      }
    }
  }
}

TEST(Executor, LoweringTakesStiffnessAndFeedForwardAwayInTheSameTwoSeconds) {
  ExecutorRig rig({}, Motion(12));
  ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
  const DriveSetpoint held = rig.drives[1]->setpoint;
  ASSERT_GT(std::abs(held.torque_nm), 1e-3F) << "the end of the motion needs some";
  rig.follow = false;
  EXPECT_EQ(rig.Tick(OperatorCommand::kLower).refusal.refusal, Refusal::kNone);
  for (int tick = 2; tick <= 2100; ++tick) {
    // Who asks once more does not begin anew.
    if (tick == 1000) {
      rig.Tick(OperatorCommand::kLower);
    } else {
      rig.Tick();
    }
    const float left = std::max(0.0F, 1 - static_cast<float>(tick) / 2000);
    ASSERT_NEAR(rig.drives[1]->setpoint.kp_nm_per_rad, held.kp_nm_per_rad * left, 1e-2F) << tick;
    ASSERT_NEAR(rig.drives[1]->setpoint.torque_nm, held.torque_nm * left, 1e-4F) << tick;
  }
}

TEST(Executor, PlaysAPathAsEvenlyAfterHoursAsAtItsBeginning) {
  MotionShape shape;
  shape.duration_s = 9000;
  shape.control_points = 64;
  shape.amplitude_rad = 3;
  ExecutorConfig config;
  config.late_ticks_max = config.pause_ticks_max = 1000;  // so that the hours can be skipped
  for (const float speed : {1.0F, 0.5F}) {
    config.speed = speed;
    ExecutorRig rig(config, Motion(12, shape));
    std::mt19937 random(12);
    const auto exact = RandomPrimitive<double>(shape, random);
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kRun);
    ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
    const std::int64_t begin = rig.output.record.tick;
    for (const double at_s : {20.0, 700.0, 8300.0, 8800.0}) {
      // The gate holds the setpoint back, but not the plan.
      const double ticks = at_s * 1000 / static_cast<double>(speed);
      for (; static_cast<double>(rig.input.tick - begin) < ticks; rig.input.tick += 999) rig.Tick();
      for (int i = 0; i < 40; ++i) {
        const TickRecord& record = rig.Tick();
        const double time_s =
            static_cast<double>(record.tick - begin) * static_cast<double>(config.period_s * speed);
        const auto& path = exact.joints[0].position;
        EXPECT_NEAR(static_cast<double>(record.joints[0].planned.position_rad),
                    path.Evaluate(time_s).value, 4e-6)
            << time_s << " s";
      }
    }
  }
}

TEST(Executor, LowersOnlyARobotThatIsHeldAndThenMovesItNoMore) {
  const Primitive<float> primitive = Motion(13);
  for (const ExecutorState state :
       {ExecutorState::kDisarmed, ExecutorState::kArming, ExecutorState::kMovingToStart,
        ExecutorState::kRunning, ExecutorState::kSettling, ExecutorState::kStopping}) {
    ExecutorRig rig({}, primitive);
    for (auto& drive : rig.drives) drive->reply.position_rad += 0.03F;
    ASSERT_TRUE(rig.Reach(state));
    EXPECT_EQ(rig.Tick(OperatorCommand::kLower).refusal.refusal, Refusal::kWrongState);
    EXPECT_NE(rig.executor.state(), ExecutorState::kFault);
  }
  for (const ExecutorState state : {ExecutorState::kHolding, ExecutorState::kFault}) {
    ExecutorRig rig({}, primitive);
    ASSERT_TRUE(rig.Reach(state));
    EXPECT_EQ(rig.Tick(OperatorCommand::kLower).refusal.refusal, Refusal::kNone);
    for (const OperatorCommand command : {OperatorCommand::kMoveToStart, OperatorCommand::kRun}) {
      EXPECT_EQ(rig.Tick(command).refusal.refusal, Refusal::kWrongState);
      EXPECT_EQ(rig.executor.state(), state);
    }
  }
}

TEST(Executor, AMotionThatEndsInMotionIsBrakedBeforeItsNodeIsOver) {
  Primitive<float> primitive = Motion(13);
  primitive.settle_s = 0;
  const auto knots = primitive.joints[0].position.knots();
  const auto path = primitive.joints[0].position.control_points();
  std::vector<float> points(path.begin(), path.end());
  points.back() += 0.06F;
  ASSERT_EQ(primitive.joints[0].position.Assign(5, std::vector<float>(knots.begin(), knots.end()),
                                                points),
            Status::kOk);
  JointLimits<float>& limits = primitive.joints[0].limits;
  limits.position_max_rad += 1;
  ExecutorRig rig({}, primitive);
  ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
  float velocity = rig.output.record.joints[0].limited.velocity_rad_s;
  ASSERT_GT(velocity, 10 * limits.acceleration_max_rad_s2 * 0.001F);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 1000, [&] {
    const float now = rig.output.record.joints[0].limited.velocity_rad_s;
    EXPECT_LE(velocity - now, limits.acceleration_max_rad_s2 * 0.001F * 1.001F);
    velocity = now;
  }));
  EXPECT_EQ(velocity, 0);
}

TEST(Executor, ALongMotionEndsExactlyWhereItsPathEnds) {
  MotionShape shape;
  shape.duration_s = 40;
  ExecutorConfig config;
  config.late_ticks_max = config.pause_ticks_max = 1000;  // so that the time can be skipped
  Primitive<float> primitive = Motion(13, shape);
  JointMotion<float>& joint = primitive.joints[0];
  const auto knots = joint.position.knots();
  const auto path = joint.position.control_points();
  std::vector<float> points(path.begin(), path.end());
  points.back() += 3;  // It ends in motion, and a time that is a little off would show.
  ASSERT_EQ(joint.position.Assign(5, std::vector<float>(knots.begin(), knots.end()), points),
            Status::kOk);
  joint.limits = {-20, 20, 60, 1e3F, 10};
  ExecutorRig rig(config, primitive);
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.Tick(OperatorCommand::kRun);
  for (int i = 0; i < 1000 && rig.executor.state() == ExecutorState::kRunning; ++i) {
    rig.input.tick += 99;
    rig.Tick();
  }
  ASSERT_EQ(rig.executor.state(), ExecutorState::kSettling);
  EXPECT_EQ(rig.output.record.primitive_time_s, primitive.duration_s);
  EXPECT_GT(rig.output.record.joints[0].planned.velocity_rad_s, 1);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_EQ(rig.output.record.joints[j].planned.position_rad,
              primitive.joints[j].position.control_points().back());
  }
}

TEST(Executor, MovesToTheStartWithinItsShareOfTheLimits) {
  const Primitive<float> primitive = Motion(14);
  for (const float fraction : {0.2F, 0.05F}) {
    ExecutorConfig config;
    config.move_fraction = fraction;
    ExecutorRig rig(config, primitive);
    rig.drives[0]->reply.position_rad = primitive.joints[0].limits.position_max_rad - 0.01F;
    rig.drives[1]->reply.position_rad = primitive.joints[1].limits.position_min_rad + 0.01F;
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    rig.Tick(OperatorCommand::kMoveToStart);
    std::array<float, 2> last_velocity{};
    float share_max = 0;
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 200000, [&] {
      for (std::size_t j = 0; j < 2; ++j) {
        const JointLimits<float>& limits = primitive.joints[j].limits;
        const float velocity = rig.output.record.joints[j].limited.velocity_rad_s;
        const float acceleration = (velocity - last_velocity[j]) / config.period_s;
        last_velocity[j] = velocity;
        share_max = std::max({share_max, std::abs(velocity) / limits.velocity_max_rad_s,
                              std::abs(acceleration) / limits.acceleration_max_rad_s2});
        EXPECT_FALSE(rig.output.record.joints[j].limit_active);
      }
    }));
    EXPECT_LT(share_max, fraction * 1.01F);
    EXPECT_GT(share_max, fraction * 0.95F) << "it may use its share";
    EXPECT_EQ(rig.output.record.joints[0].limited.position_rad, Start(primitive, 0));
    EXPECT_EQ(rig.output.record.joints[1].limited.position_rad, Start(primitive, 1));
  }
}

TEST(Executor, FinishesAMotionOnTheLimitedSetpointNotOnThePlannedOne) {
  Primitive<float> primitive = Motion(15);
  // The gate has to hold the motion back.
  for (auto& joint : primitive.joints) joint.limits.velocity_max_rad_s *= 0.3F;
  primitive.following_tolerance_rad = 10;
  ExecutorRig rig({}, primitive);
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kSettling, 100000));
  EXPECT_NEAR(rig.output.record.joints[0].limited.position_rad,
              primitive.joints[0].position.control_points().back(), 1e-4);
  EXPECT_NEAR(rig.output.record.joints[1].limited.position_rad,
              primitive.joints[1].position.control_points().back(), 1e-4);
}

TEST(Executor, AMoveIsOverOnlyOnceTheLimitedSetpointIsAtTheStart) {
  Primitive<float> primitive = Motion(15);
  // So far from zero that floats are 2 mrad apart, and one tick's step of 0.9 mrad is lost in them.
  const auto knots = primitive.joints[0].position.knots();
  const auto path = primitive.joints[0].position.control_points();
  std::vector<float> points(path.begin(), path.end());
  for (float& point : points) point += 30000;
  ASSERT_EQ(primitive.joints[0].position.Assign(5, std::vector<float>(knots.begin(), knots.end()),
                                                points),
            Status::kOk);
  primitive.joints[0].limits = {29990, 30010, 0.9F, 100, 10};
  ExecutorRig rig({}, primitive);
  ASSERT_EQ(rig.configured, Status::kOk);
  rig.drives[0]->reply.position_rad += 0.1F;
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.Tick(OperatorCommand::kMoveToStart);
  EXPECT_FALSE(rig.TickUntil(ExecutorState::kHolding, 5000)) << "the plan takes a second";
  EXPECT_EQ(rig.output.record.joints[0].planned.position_rad, points[0]);
  EXPECT_GT(rig.output.record.joints[0].limited.position_rad, points[0] + 0.05F);
  for (int i = 0; i < 200 && rig.executor.state() != ExecutorState::kHolding; ++i) {
    rig.input.tick += 1;  // Two ticks' step is enough for the next float.
    rig.Tick();
  }
  EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding);
  EXPECT_EQ(rig.output.record.joints[0].limited.position_rad, points[0]);
}

TEST(Executor, HoldsTheLastFeedForwardAfterARunAndDropsItAfterAStop) {
  const Primitive<float> primitive = Motion(16);
  ExecutorRig rig({}, primitive);
  ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
  for (int i = 0; i < 100; ++i) rig.Tick();
  EXPECT_EQ(rig.drives[0]->setpoint.torque_nm, primitive.joints[0].torque.control_points().back());
  ExecutorRig stopped({}, primitive);
  ASSERT_TRUE(stopped.Reach(ExecutorState::kStopping));
  for (int i = 0; i < 1000; ++i) stopped.Tick();
  EXPECT_EQ(stopped.drives[0]->setpoint.torque_nm, 0);
}

TEST(Executor, MakesUpForAMissedTickInsteadOfPlayingSlower) {
  const Primitive<float> primitive = Motion(17);
  ExecutorRig rig({}, primitive);
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  const float before = rig.Tick().primitive_time_s;
  rig.input.tick += 2;
  const TickRecord& record = rig.Tick();
  EXPECT_EQ(record.faults, 0);
  EXPECT_NEAR(record.primitive_time_s, before + 0.003F, 1e-6);
  EXPECT_EQ(record.joints[0].limited.position_rad,
            primitive.joints[0].position.Evaluate(record.primitive_time_s).value);
}

/// Checks every tick of a run with random events: position, velocity and torque never jump by more
/// than limits and accelerations allow, and never leave the limits. No transition may break this.
struct Watch {
  const Primitive<float>& primitive;
  const ExecutorConfig& config;
  std::vector<JointSetpoint> last;

  void Check(const ExecutorRig& rig) {
    const TickRecord& record = rig.output.record;
    for (std::size_t j = 0; j < record.joint_count; ++j) {
      const JointSetpoint now = record.joints[j].limited;
      const JointLimits<float>& limits = primitive.joints[j].limits;
      ASSERT_GE(now.position_rad, limits.position_min_rad);
      ASSERT_LE(now.position_rad, limits.position_max_rad);
      ASSERT_LE(std::abs(now.velocity_rad_s), limits.velocity_max_rad_s);
      ASSERT_LE(std::abs(now.torque_nm), limits.torque_max_nm);
      const bool armed =
          record.state != ExecutorState::kDisarmed && record.state != ExecutorState::kArming;
      if (armed && j < last.size()) {
        const float step = limits.velocity_max_rad_s * config.period_s * 1.01F + 1e-6F;
        ASSERT_LE(std::abs(now.position_rad - last[j].position_rad), step)
            << "tick " << record.tick;
        const float velocity_step =
            limits.acceleration_max_rad_s2 * config.period_s * 1.02F + 1e-4F;
        ASSERT_LE(std::abs(now.velocity_rad_s - last[j].velocity_rad_s), velocity_step)
            << "tick " << record.tick;
        const float torque_step =
            limits.torque_max_nm * config.period_s / config.torque_rise_s * 1.01F + 1e-4F;
        ASSERT_LE(std::abs(now.torque_nm - last[j].torque_nm), torque_step)
            << "tick " << record.tick;
        ASSERT_FALSE(record.joints[j].limit_active &&
                     now.position_rad != record.joints[j].planned.position_rad)
            << "the gate had to hold a position back at tick " << record.tick;
      }
    }
    last.resize(record.joint_count);
    for (std::size_t j = 0; j < record.joint_count; ++j) last[j] = record.joints[j].limited;
  }
};

TEST(Executor, AStopAtAnyMomentOfAnyPhaseJumpsNowhereAndEndsAtRestWithinTheLimits) {
  std::mt19937 random(18);
  for (int trial = 0; trial < 300; ++trial) {
    MotionShape shape;
    shape.joint_count = 1 + trial % 3;
    shape.duration_s = 0.3 + 0.01 * (trial % 50);
    const Primitive<float> primitive = RandomPrimitive<float>(shape, random);
    ExecutorConfig config;
    config.speed = trial % 2 == 0 ? 1.0F : 0.4F;
    config.move_fraction = 0.5F;
    ExecutorRig rig(config, primitive);
    Watch watch{primitive, config, {}};
    for (auto& drive : rig.drives) drive->reply.position_rad += 0.04F;
    const auto tick = [&](OperatorCommand command = OperatorCommand::kNone) {
      rig.Tick(command);
      watch.Check(rig);
      return !::testing::Test::HasFatalFailure();
    };
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    ASSERT_TRUE(tick(OperatorCommand::kMoveToStart));
    const bool stop_in_move = trial % 4 == 0;
    std::uniform_int_distribution<int> moment(
        0, stop_in_move ? 40 : static_cast<int>(rig.executor.run_ticks()) + 60);
    if (!stop_in_move) {
      while (rig.executor.state() == ExecutorState::kMovingToStart) ASSERT_TRUE(tick());
      ASSERT_TRUE(tick(OperatorCommand::kRun));
    }
    const int stop_at = moment(random);
    for (int i = 0; i < stop_at; ++i) ASSERT_TRUE(tick());
    ASSERT_TRUE(tick(OperatorCommand::kStop));
    for (int i = 0; i < 3000 && rig.executor.state() != ExecutorState::kHolding; ++i)
      ASSERT_TRUE(tick());
    ASSERT_EQ(rig.executor.state(), ExecutorState::kHolding);
    for (int i = 0; i < 50; ++i) ASSERT_TRUE(tick());
    const float rest = rig.output.record.joints[0].limited.position_rad;
    ASSERT_TRUE(tick());
    EXPECT_EQ(rig.output.record.joints[0].limited.position_rad, rest);
    EXPECT_EQ(rig.output.record.joints[0].limited.velocity_rad_s, 0);
    ASSERT_TRUE(tick(OperatorCommand::kMoveToStart)) << "and it can go on from there";
    while (rig.executor.state() == ExecutorState::kMovingToStart) ASSERT_TRUE(tick());
    EXPECT_EQ(rig.output.record.faults, 0);
  }
}

}  // namespace
}  // namespace tumbler
