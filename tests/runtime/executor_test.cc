#include "runtime/executor/executor.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

#include "firmware_interface/devices/mit.h"
#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::MotionShape;
using testing::RandomPrimitive;

static_assert(std::is_trivially_copyable_v<TickRecord>);

Primitive<float> Motion(unsigned seed, const MotionShape& shape = {}) {
  std::mt19937 random(seed);
  return RandomPrimitive<float>(shape, random);
}

float Start(const Primitive<float>& primitive, std::size_t joint) {
  return primitive.joints[joint].position.control_points()[0];
}

TEST(Executor, ServesNothingUntilConfigured) {
  Executor executor;
  TickOutput output;
  executor.Tick({0, 0, {}, Status::kOk, Status::kOk, OperatorCommand::kArm}, output);
  EXPECT_EQ(output.record.refusal.refusal, Refusal::kNotConfigured);
  for (const FrameBatch& batch : output.frames) EXPECT_TRUE(batch.frames().empty());
}

TEST(Executor, RefusesConfigurationsOutsideTheirRanges) {
  const Primitive<float> good = Motion(1);
  const auto configured = [](const ExecutorConfig& config, const Primitive<float>& primitive) {
    return ExecutorRig(config, primitive).configured;
  };
  EXPECT_EQ(configured({}, good), Status::kOk);
  const auto with = [](auto change) {
    ExecutorConfig config;
    change(config);
    return config;
  };
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  for (const float bad : {kNaN, 0.0F, 0.09F, 1.01F}) {
    EXPECT_EQ(configured(with([&](auto& c) { c.speed = bad; }), good), Status::kInvalidArgument)
        << bad;
  }
  EXPECT_EQ(configured(with([&](auto& c) { c.period_s = kNaN; }), good), Status::kInvalidArgument);
  EXPECT_EQ(configured(with([&](auto& c) { c.move_fraction = 0; }), good),
            Status::kInvalidArgument);
  EXPECT_EQ(configured(with([&](auto& c) { c.stale_ticks_max = 0; }), good),
            Status::kInvalidArgument);
  for (const int bad : {-1, 1001, std::numeric_limits<int>::max()}) {
    EXPECT_EQ(configured(with([&](auto& c) { c.late_ticks_max = bad; }), good),
              Status::kInvalidArgument)
        << bad;
  }
  EXPECT_EQ(configured(with([&](auto& c) { c.pause_ticks_max = 0; }), good),
            Status::kInvalidArgument);
  EXPECT_EQ(configured(with([&](auto& c) { c.joints[1].kp_nm_per_rad = kNaN; }), good),
            Status::kInvalidArgument);
  Primitive<float> moving = good;  // It would have to jump into its first velocity.
  std::vector<float> points(good.joints[0].position.control_points().begin(),
                            good.joints[0].position.control_points().end());
  points[1] += 0.5F;
  const auto knots = good.joints[0].position.knots();
  ASSERT_EQ(
      moving.joints[0].position.Assign(5, std::vector<float>(knots.begin(), knots.end()), points),
      Status::kOk);
  EXPECT_EQ(configured({}, moving), Status::kInvalidArgument);
  Primitive<float> unlimited = good;
  unlimited.joints[1].limits.velocity_max_rad_s = kNaN;
  EXPECT_EQ(configured({}, unlimited), Status::kInvalidArgument);

  Executor executor;
  EXPECT_EQ(executor.Configure({}, good, std::array<Drive*, 1>{nullptr}), Status::kInvalidArgument);
  EXPECT_EQ(executor.Configure({}, good, std::array<Drive*, 2>{nullptr, nullptr}),
            Status::kInvalidArgument);
}

TEST(Executor, GoesThroughEveryStateOfARun) {
  for (int joints = 1; joints <= kMaxJoints; ++joints) {
    MotionShape shape;
    shape.joint_count = joints;
    const Primitive<float> primitive = Motion(7, shape);
    ExecutorRig rig({}, primitive);
    ASSERT_EQ(rig.configured, Status::kOk);
    for (auto& drive : rig.drives) drive->reply.position_rad += 0.04F;
    std::vector<ExecutorState> states;
    const auto note = [&] {
      if (states.empty() || states.back() != rig.output.record.state)
        states.push_back(rig.output.record.state);
    };
    rig.Tick();
    note();
    rig.Tick(OperatorCommand::kArm);
    note();
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 1000, note));
    rig.Tick();
    note();
    rig.Tick(OperatorCommand::kMoveToStart);
    note();
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 100000, note));
    rig.Tick();
    note();
    rig.Tick(OperatorCommand::kRun);
    note();
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 10000, note));
    rig.Tick(OperatorCommand::kDisarm);
    note();
    using S = ExecutorState;
    EXPECT_EQ(states, (std::vector<S>{S::kDisarmed, S::kArming, S::kHolding, S::kMovingToStart,
                                      S::kHolding, S::kRunning, S::kSettling, S::kDisarmed}));
    EXPECT_EQ(rig.output.record.faults, 0);
    for (const auto& drive : rig.drives) EXPECT_EQ(drive->request, DriveRequest::kDisable);
  }
}

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

TEST(Executor, ArmsAtTheMeasuredPositionEvenWhileAJointIsMovedByHand) {
  ExecutorRig rig({}, Motion(10));
  rig.follow = false;
  rig.Tick();
  for (auto& drive : rig.drives) drive->start_up_ticks = 20;
  rig.Tick(OperatorCommand::kArm);
  for (int i = 0; i < 15; ++i) {
    rig.drives[0]->reply.position_rad += 0.01F;
    rig.Tick();
    EXPECT_EQ(rig.drives[0]->setpoint.position_rad, rig.drives[0]->reply.position_rad);
    EXPECT_EQ(rig.drives[0]->setpoint.velocity_rad_s, 0);
    EXPECT_EQ(rig.drives[0]->setpoint.torque_nm, 0);
  }
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 100));
  const float held = rig.drives[0]->setpoint.position_rad;
  EXPECT_EQ(held, rig.drives[0]->reply.position_rad);
  // Now the joint is pushed. The hold must not give way to the measurement.
  rig.drives[0]->reply.position_rad += 0.1F;
  for (int i = 0; i < 50; ++i) rig.Tick();
  EXPECT_EQ(rig.drives[0]->setpoint.position_rad, held);
}

TEST(Executor, RefusesToArmWithItsReason) {
  const Primitive<float> primitive = Motion(11);
  {
    ExecutorRig rig({}, primitive);
    rig.silent[1] = true;
    const RefusalDetail refusal = rig.Tick(OperatorCommand::kArm).refusal;
    EXPECT_EQ(refusal.refusal, Refusal::kNoReply);
    EXPECT_EQ(refusal.joint, 1);
    EXPECT_EQ(rig.executor.state(), ExecutorState::kDisarmed);
  }
  ExecutorConfig near;
  near.start_way_max_rad = 0.5F;
  Primitive<float> wide = primitive;
  wide.joints[1].limits.position_min_rad = -10;
  wide.joints[1].limits.position_max_rad = 10;
  for (const float way : {-0.6F, -0.4F, 0.4F, 0.6F}) {
    ExecutorRig rig(near, wide);
    rig.drives[1]->reply.position_rad += way;
    rig.Tick();
    const RefusalDetail refusal = rig.Tick(OperatorCommand::kArm).refusal;
    EXPECT_EQ(refusal.refusal, std::abs(way) > 0.5F ? Refusal::kFarFromStart : Refusal::kNone);
    if (refusal.refusal == Refusal::kNone) continue;
    EXPECT_EQ(refusal.joint, 1);
    EXPECT_NEAR(refusal.value.real(), 0.6F, 1e-5F);
    EXPECT_EQ(refusal.limit.real(), 0.5F);
  }
  {
    ExecutorRig rig(near, wide);
    ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
    rig.Tick(OperatorCommand::kDisarm);
    rig.drives[1]->reply.position_rad = rig.drives[1]->setpoint.position_rad + 0.1F;
    rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kNone)
        << "it was left there";
    rig.Tick(OperatorCommand::kDisarm);
    rig.drives[1]->reply.position_rad += 2;
    rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kFarFromStart)
        << "somebody has turned it since";
  }
  {
    ExecutorConfig known;
    known.moved_max_rad = 0.01F;
    known.last_known[1] = {true, wide.joints[1].position.control_points()[0], 6.2831853F};
    ExecutorRig rig(known, wide);
    ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
    rig.Tick(OperatorCommand::kDisarm);
    ASSERT_GT(std::abs(rig.drives[1]->reply.position_rad - known.last_known[1].position_rad),
              0.01F);
    rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kNone)
        << "this executor has moved it itself";
  }
  for (const auto& [off, expected] : {std::pair{0.4F, Refusal::kNone},
                                      {-0.4F, Refusal::kNone},
                                      {0.6F, Refusal::kMoved},
                                      {-3.0F, Refusal::kMoved},
                                      {1.0471976F, Refusal::kTurnsLost},
                                      {-2.0F * 1.0471976F, Refusal::kTurnsLost}}) {
    ExecutorConfig known;
    known.moved_max_rad = 0.5F;
    const float start = wide.joints[1].position.control_points()[0];
    known.last_known[1] = {true, start - off, 1.0471976F};  // behind a gear of 6
    ExecutorRig rig(known, wide);
    rig.Tick();
    const RefusalDetail refusal = rig.Tick(OperatorCommand::kArm).refusal;
    EXPECT_EQ(refusal.refusal, expected) << off;
    if (expected == Refusal::kNone) continue;
    EXPECT_EQ(refusal.joint, 1);
    EXPECT_NEAR(refusal.value.real(), off, 1e-5F);
    EXPECT_EQ(refusal.limit.real(), 0.5F);
  }
  const auto refusal_after = [&](auto change) {
    ExecutorRig rig({}, primitive);
    change(*rig.drives[1]);
    rig.Tick();
    return rig.Tick(OperatorCommand::kArm).refusal;
  };
  {
    ExecutorConfig known;
    known.moved_max_rad = 0.01F;
    const float start = wide.joints[1].position.control_points()[0];
    known.last_known[1] = {true, start - 0.05F, 1.0471976F};
    ExecutorRig rig(known, wide);
    rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kMoved)
        << "no turn is lost in a twentieth of one";
    rig.drives[1]->reply.position_rad = std::numeric_limits<float>::quiet_NaN();
    rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kOutsideLimits)
        << "nobody knows whether it was moved";
  }
  EXPECT_EQ(refusal_after([](auto& drive) { drive.says = DriveState::kFault; }).refusal,
            Refusal::kDriveError)
      << "a drive may fail and give no code";
  const RefusalDetail outside = refusal_after([](auto& drive) { drive.reply.position_rad = 4; });
  EXPECT_EQ(outside.refusal, Refusal::kOutsideLimits);
  EXPECT_EQ(outside.value.real(), 4);
  EXPECT_EQ(outside.limit.real(), primitive.joints[1].limits.position_max_rad);
  EXPECT_EQ(refusal_after([](auto& drive) { drive.reply.error = 3; }).refusal,
            Refusal::kDriveError);
  EXPECT_EQ(refusal_after([](auto& drive) {
              drive.reply.position_rad = std::numeric_limits<float>::quiet_NaN();
            }).refusal,
            Refusal::kOutsideLimits);
  const RefusalDetail hot = refusal_after([](auto& drive) {
    drive.reply.has_temperature = true;
    drive.reply.temperature_c = 90;
  });
  EXPECT_EQ(hot.refusal, Refusal::kTooHot);
  EXPECT_EQ(hot.limit.real(), 80);
}

TEST(Executor, ATorqueThatNoDriveReportedIsNotANumberInTheRecordAndNoFault) {
  ExecutorRig rig({}, Motion(12));
  rig.drives[0]->reply.has_torque = true;
  rig.drives[0]->reply.torque_nm = 0.5F;
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  EXPECT_EQ(rig.output.record.joints[0].measured.torque_nm, 0.5F);
  EXPECT_TRUE(std::isnan(rig.output.record.joints[1].measured.torque_nm));
  EXPECT_EQ(rig.output.record.faults, 0U);
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

TEST(Executor, GoesHomeOnlyFromTheEndOfANodeWithDrivesThatHold) {
  const Primitive<float> primitive = Motion(12);
  {
    ExecutorRig rig({}, primitive);
    for (auto& drive : rig.drives) drive->reply.position_rad += 0.1F;
    ASSERT_TRUE(rig.Reach(ExecutorState::kMovingToStart));
    rig.input.tick += 100;
    ASSERT_EQ(rig.Tick().reaction, Reaction::kHold);
    EXPECT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kWrongState)
        << "its feed-forward is not that of this pose";
  }
  for (const int missed : {198, 199}) {
    ExecutorRig rig({}, primitive);
    ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
    rig.input.tick += missed;
    ASSERT_EQ(rig.Tick().reaction, missed < 199 ? Reaction::kHold : Reaction::kDisable);
    for (int i = 0; i < 3; ++i) rig.Tick();
    EXPECT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal,
              missed < 199 ? Refusal::kNone : Refusal::kWrongState)
        << "drives have let go, and the robot lies elsewhere";
  }
  {
    ExecutorConfig ignoring;
    ASSERT_TRUE(
        ignoring.reactions.Set(Fault::kDriveError, ExecutorState::kFault, Reaction::kIgnore));
    ExecutorRig rig(ignoring, primitive);
    ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
    rig.input.tick += 100;
    ASSERT_EQ(rig.Tick().reaction, Reaction::kHold);
    rig.drives[1]->stuck = true;
    for (int i = 0; i < 3; ++i) rig.Tick();
    const RefusalDetail refusal = rig.Tick(OperatorCommand::kGoHome).refusal;
    EXPECT_EQ(refusal.refusal, Refusal::kDriveError);
    EXPECT_EQ(refusal.joint, 1);
  }
  {
    ExecutorConfig ignoring;
    ASSERT_TRUE(
        ignoring.reactions.Set(Fault::kDriveError, ExecutorState::kFault, Reaction::kIgnore));
    ExecutorRig rig(ignoring, primitive);
    ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
    rig.input.tick += 100;
    ASSERT_EQ(rig.Tick().reaction, Reaction::kHold);
    rig.drives[0]->says = DriveState::kEnabled;
    rig.drives[0]->reply.error = 0x21;
    rig.Tick();
    const RefusalDetail refusal = rig.Tick(OperatorCommand::kGoHome).refusal;
    EXPECT_EQ(refusal.refusal, Refusal::kDriveError) << "it drives its joint as yet, and reports";
    EXPECT_EQ(refusal.value.code(), 0x21U);
    EXPECT_EQ(refusal.joint, 0);
  }
  {
    ExecutorRig rig({}, primitive);
    ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
    rig.input.tick += 100;
    ASSERT_EQ(rig.Tick().reaction, Reaction::kHold);
    EXPECT_EQ(rig.Tick(OperatorCommand::kLower).refusal.refusal, Refusal::kNone);
    EXPECT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kWrongState)
        << "what is lowered does not get up";
  }
  {
    ExecutorRig rig({}, primitive);
    ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
    rig.replies[1] = 3;
    for (int i = 0; i < 100 && rig.output.record.faults == 0; ++i) rig.Tick();
    ASSERT_EQ(rig.output.record.first_fault.fault, Fault::kWrongSequence);
    ASSERT_EQ(rig.output.record.reaction, Reaction::kHold);
    for (int i = 0; i < 30; ++i) rig.Tick();
    rig.replies[1] = 1;
    EXPECT_EQ(rig.Tick(OperatorCommand::kGoHome).refusal.refusal, Refusal::kNone);
    rig.Tick();
    EXPECT_NE(rig.executor.state(), ExecutorState::kFault) << "what was answered is not found anew";
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

TEST(Executor, RefusesToRunAwayFromTheStart) {
  const Primitive<float> primitive = Motion(12);
  ExecutorRig rig({}, primitive);
  for (auto& drive : rig.drives) drive->reply.position_rad += 0.03F;
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  EXPECT_EQ(rig.Tick(OperatorCommand::kRun).refusal.refusal, Refusal::kNotAtStart);
  rig.Tick(OperatorCommand::kMoveToStart);
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
  rig.follow = false;
  // The entry tolerance is 0.05 rad, the following tolerance 0.2 rad.
  rig.drives[1]->reply.position_rad += 0.06F;
  const RefusalDetail refusal = rig.Tick(OperatorCommand::kRun).refusal;
  EXPECT_EQ(refusal.refusal, Refusal::kOutsideStartSet);
  EXPECT_EQ(refusal.joint, 1);
  EXPECT_NEAR(refusal.value.real(), 0.06F, 1e-4);
  EXPECT_EQ(refusal.limit.real(), primitive.entry_tolerance_rad);
  EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding);
  rig.drives[1]->reply.position_rad -= 0.04F;
  EXPECT_EQ(rig.Tick(OperatorCommand::kRun).refusal.refusal, Refusal::kNone);
  EXPECT_EQ(rig.executor.state(), ExecutorState::kRunning);
}

TEST(Executor, RefusesCommandsThatDoNotFitTheState) {
  ExecutorRig rig({}, Motion(13));
  rig.Tick();
  for (const OperatorCommand command : {OperatorCommand::kMoveToStart, OperatorCommand::kRun}) {
    EXPECT_EQ(rig.Tick(command).refusal.refusal, Refusal::kWrongState);
  }
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  for (const OperatorCommand command :
       {OperatorCommand::kMoveToStart, OperatorCommand::kRun, OperatorCommand::kArm,
        OperatorCommand::kClearFaults, static_cast<OperatorCommand>(99)}) {
    EXPECT_EQ(rig.Tick(command).refusal.refusal, Refusal::kWrongState);
    EXPECT_EQ(rig.executor.state(), ExecutorState::kRunning);
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

TEST(Executor, IsConfiguredAnewOnlyWhileDisarmed) {
  ExecutorRig rig({}, Motion(13));
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  rig.Reconfigure();
  EXPECT_EQ(rig.configured, Status::kWouldBlock);
  rig.Tick();
  EXPECT_EQ(rig.executor.state(), ExecutorState::kRunning) << "and goes on as it was";
  rig.Tick(OperatorCommand::kDisarm);
  rig.Reconfigure();
  EXPECT_EQ(rig.configured, Status::kOk);
}

/// The first motion, and after it another that ends so far away, outside the limits of the first.
ExecutorRig EndsOutsideTheFirstLimits(float end_rad) {
  const Primitive<float> first = Motion(13);
  Primitive<float> second = first;
  for (auto& joint : second.joints) joint.limits = {-20, 20, 500, 1e5F, 10};
  second.entry_tolerance_rad = 100;
  const auto knots = first.joints[0].position.knots();
  const auto path = first.joints[0].position.control_points();
  std::vector<float> points(path.begin(), path.end());
  for (std::size_t i = 0; i < 3; ++i) {
    points[i] = path.back();
    points[points.size() - 1 - i] = end_rad;
  }
  EXPECT_EQ(
      second.joints[0].position.Assign(5, std::vector<float>(knots.begin(), knots.end()), points),
      Status::kOk);
  SequenceGraph<float> graph = GraphOf(first);
  graph.node_count = 2;
  graph.node_storage[1].primitive = 1;
  graph.node_storage[1].safe = true;
  graph.edge_count = 1;
  graph.edge_storage[0] = {0, 1, 0.05F, EdgeCondition::kAlways, {}};
  return ExecutorRig({}, graph, {first, second});
}

TEST(Executor, MovesToTheStartOnlyFromWithinTheLimitsThatHoldThere) {
  const JointLimits<float> limits = Motion(13).joints[0].limits;
  for (const float end_rad : {-4.0F, 4.0F}) {
    ExecutorRig rig = EndsOutsideTheFirstLimits(end_rad);
    ASSERT_TRUE(rig.Reach(ExecutorState::kSettling));
    ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding));
    ASSERT_EQ(rig.output.record.node, 1);
    const RefusalDetail refusal = rig.Tick(OperatorCommand::kMoveToStart).refusal;
    EXPECT_EQ(refusal.refusal, Refusal::kOutsideLimits);
    EXPECT_EQ(refusal.joint, 0);
    EXPECT_NEAR(refusal.value.real(), end_rad, 1e-3F);
    EXPECT_EQ(refusal.limit.real(),
              end_rad < 0 ? limits.position_min_rad : limits.position_max_rad);
    EXPECT_EQ(rig.executor.state(), ExecutorState::kHolding);
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

TEST(Executor, APlanThatIsNotANumberIsHeldAndAFault) {
  Primitive<float> primitive = Motion(13);
  const auto knots = primitive.joints[1].position.knots();
  const auto path = primitive.joints[1].position.control_points();
  std::vector<float> points(path.begin(), path.end());
  points[5] = 3e38F;  // Its rate is more than a float can be.
  points[6] = -3e38F;
  ASSERT_EQ(primitive.joints[1].position.Assign(5, std::vector<float>(knots.begin(), knots.end()),
                                                points),
            Status::kOk);
  ExecutorRig rig({}, primitive);
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  const float held = rig.drives[1]->setpoint.position_rad;
  rig.Tick(OperatorCommand::kRun);
  const TickRecord& record = rig.Tick();
  EXPECT_EQ(record.first_fault.fault, Fault::kNonFinite);
  EXPECT_EQ(record.first_fault.joint, 1);
  EXPECT_EQ(record.state, ExecutorState::kFault);
  EXPECT_EQ(rig.drives[1]->setpoint.position_rad, held);
}

TEST(Executor, ASetpointThatADriveCannotBeSentIsAFault) {
  ExecutorRig rig({}, Motion(13));
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  rig.drives[1]->encode_status = Status::kInvalidArgument;
  rig.Tick();
  EXPECT_EQ(rig.executor.state(), ExecutorState::kFault);
  EXPECT_EQ(rig.Tick().first_fault.fault, Fault::kNonFinite);
  EXPECT_EQ(rig.output.record.first_fault.joint, 1);
}

TEST(Executor, ADriveFromWhichOnlyOldRepliesComeIsSilent) {
  for (const int old_ticks : {0, 4}) {
    ExecutorRig rig({}, Motion(13));
    ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
    // From now on the clock goes, and what comes is as old as that.
    for (int i = 0; i < 50; ++i) {
      rig.input.time_ns += 1'000'000;
      rig.stamp_ns = rig.input.time_ns - old_ticks * std::int64_t{1'000'000};
      rig.Tick();
    }
    EXPECT_EQ(rig.output.record.first_fault.fault,
              old_ticks == 0 ? Fault::kNone : Fault::kStaleReply);
    EXPECT_EQ(rig.output.record.joints[0].reply_age_ticks, old_ticks == 0 ? 0 : old_ticks - 1);
  }
}

TEST(Executor, AFaultOfOneJointInACollapseDoesNotStiffenTheOthers) {
  const Primitive<float> motion = Motion(13);
  ExecutorConfig config;
  config.collapse.configured = true;
  for (std::size_t i = 0; i < 2; ++i)
    config.collapse.position_rad[i] = motion.joints[i].position.control_points()[0];
  for (const ExecutorState state : {ExecutorState::kHolding, ExecutorState::kRunning})
    ASSERT_TRUE(config.reactions.Set(Fault::kLateTick, state, Reaction::kCollapse));
  ExecutorRig rig(config, motion);
  ASSERT_TRUE(rig.Reach(ExecutorState::kHolding));
  rig.input.tick += 10;
  ASSERT_EQ(rig.Tick().reaction, Reaction::kCollapse);
  rig.Tick();
  const float soft = rig.drives[1]->setpoint.kp_nm_per_rad;
  ASSERT_LT(soft, config.joints[1].kp_nm_per_rad);
  rig.drives[0]->encode_status = Status::kInvalidArgument;
  rig.Tick();
  EXPECT_EQ(rig.drives[1]->setpoint.kp_nm_per_rad, soft);
  EXPECT_EQ(rig.Tick().reaction, Reaction::kDamp);
  EXPECT_EQ(rig.drives[1]->setpoint.kp_nm_per_rad, 0);
}

TEST(Executor, WhereADriveDoesNotSayWhatItWasSentItIsArmedAtWhatItMeasures) {
  ExecutorRig rig({}, Motion(13));
  rig.drives[1]->on_wire = DriveSetpoint{std::numeric_limits<float>::quiet_NaN(), 0, 0, 0, 0};
  rig.drives[0]->on_wire = DriveSetpoint{rig.drives[0]->reply.position_rad + 0.01F, 0, 0, 0, 0};
  const float measured = rig.drives[1]->reply.position_rad;
  rig.Tick();
  rig.follow = false;
  rig.Tick(OperatorCommand::kArm);
  EXPECT_EQ(rig.output.record.joints[1].limited.position_rad, measured);
  EXPECT_EQ(rig.output.record.joints[0].limited.position_rad, rig.drives[0]->on_wire->position_rad)
      << "a drive of which it is known is held there";
  ASSERT_TRUE(rig.TickUntil(ExecutorState::kHolding, 100));
  EXPECT_EQ(rig.drives[1]->setpoint.position_rad, measured);
}

TEST(Executor, ADriveThatReportsAnErrorWhileItDrivesIsAFault) {
  ExecutorRig rig({}, Motion(13));
  ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
  rig.drives[1]->says = DriveState::kEnabled;
  rig.Tick();
  ASSERT_EQ(rig.executor.state(), ExecutorState::kRunning);
  rig.drives[1]->reply.error = 0x21;
  const TickRecord& record = rig.Tick();
  EXPECT_EQ(record.first_fault.fault, Fault::kDriveError);
  EXPECT_EQ(record.first_fault.value.code(), 0x21U);
  EXPECT_EQ(record.first_fault.joint, 1);
}

TEST(Executor, ATickThatIsNotAfterTheOneBeforeIsAFault) {
  for (const int back : {1, 50}) {
    ExecutorRig rig({}, Motion(13));
    ASSERT_TRUE(rig.Reach(ExecutorState::kRunning));
    const float before = rig.Tick().primitive_time_s;
    rig.input.tick -= back;
    const TickRecord& record = rig.Tick();
    EXPECT_EQ(record.first_fault.fault, Fault::kLateTick);
    EXPECT_EQ(record.first_fault.value.integer(), -back);
    EXPECT_EQ(record.state, ExecutorState::kFault);
    EXPECT_LE(record.primitive_time_s, before + 0.00101F) << "no time was made up for";
  }
}

TEST(Executor, AFrameOfEarlierIsOldAlsoWhereTheClockStandsStill) {
  ExecutorRig rig({}, Motion(13));
  rig.input.time_ns = 1'000'000;
  rig.Tick();  // Frames are of the time 0.
  EXPECT_EQ(rig.output.record.joints[0].reply_age_ticks, 0);
  for (int i = 0; i < 10; ++i) rig.Tick();
  EXPECT_GT(rig.output.record.joints[0].reply_age_ticks, 1000);
  EXPECT_EQ(rig.Tick(OperatorCommand::kArm).refusal.refusal, Refusal::kNoReply);
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

TEST(Executor, ErrorsOfDrivesAreClearedInOneTickByTheOperatorAndNeverOtherwise) {
  testing::ExecutorRig rig({}, Motion(31));
  ASSERT_TRUE(rig.Reach(ExecutorState::kFault));
  const auto clears = [&rig] {
    return rig.drives[0]->request == DriveRequest::kClearErrors ||
           rig.drives[1]->request == DriveRequest::kClearErrors;
  };
  rig.Tick(OperatorCommand::kClearFaults);
  EXPECT_FALSE(clears()) << "refused outside disarmed";
  rig.Tick(OperatorCommand::kDisarm);
  for (int i = 0; i < 20; ++i) {
    rig.Tick();
    ASSERT_FALSE(clears());
  }
  rig.Tick(OperatorCommand::kClearFaults);
  EXPECT_EQ(rig.drives[0]->request, DriveRequest::kClearErrors);
  EXPECT_EQ(rig.drives[1]->request, DriveRequest::kClearErrors);
  rig.Tick();
  EXPECT_EQ(rig.drives[0]->request, DriveRequest::kDisable);
  rig.Tick(OperatorCommand::kArm);
  EXPECT_EQ(rig.drives[0]->request, DriveRequest::kEnable);
}

/// Two MIT drives, and a world that answers at random from a seed: plausible replies, garbage,
/// silence, late ticks, commands.
class MitWorld {
 public:
  explicit MitWorld(unsigned seed) : primitive(Motion(30)), random(seed) {
    configs[1].command_id = 2;
    configs[1].reply_id = 18;
    for (std::size_t i = 0; i < 2; ++i) drives.emplace_back(std::make_unique<MitDrive>(configs[i]));
    const std::array<Drive*, 2> pointers{drives[0].get(), drives[1].get()};
    EXPECT_EQ(executor.Configure({}, primitive, pointers), Status::kOk);
    for (std::size_t i = 0; i < 2; ++i) position[i] = Start(primitive, i);
  }

  struct Recorded {
    TickInput input;
    std::vector<ReceivedFrame> frames;
  };

  /// The inputs of one tick; `hostile` is the share of ticks in which something odd happens.
  Recorded MakeInput(double hostile) {
    std::uniform_real_distribution<double> chance(0, 1);
    Recorded recorded;
    tick += 1;
    if (chance(random) < 0.2 * hostile) tick += static_cast<std::int64_t>(random() % 5);
    recorded.input.tick = tick;
    for (std::size_t i = 0; i < 2; ++i) {
      MitReply reply;
      reply.sender = static_cast<std::uint8_t>(i + 1);
      reply.position_rad = position[i];
      reply.temperature_c = chance(random) < 0.1 * hostile ? 100.0F : 30.0F;
      reply.error = chance(random) < 0.1 * hostile ? 2 : 0;
      CanFrame frame = EncodeMitReply(configs[i], reply);
      if (chance(random) < hostile) frame.data[random() % 8] ^= static_cast<std::uint8_t>(random());
      if (chance(random) < hostile) frame.size = static_cast<std::uint8_t>(random() % 9);
      if (chance(random) >= hostile) recorded.frames.push_back({frame, 0});
    }
    if (chance(random) < 0.05 * hostile) recorded.input.send_status = Status::kWouldBlock;
    if (chance(random) < 0.05 * hostile) recorded.input.receive_status = Status::kBusOff;
    if (chance(random) < (hostile > 0.1 ? 0.3 : 0.001)) {
      recorded.input.command = static_cast<OperatorCommand>(random() % 7);
    } else if (executor.state() == ExecutorState::kFault) {
      recorded.input.command = OperatorCommand::kDisarm;
    } else if (executor.state() == ExecutorState::kDisarmed) {
      recorded.input.command =
          chance(random) < 0.5 ? OperatorCommand::kClearFaults : OperatorCommand::kArm;
    } else if (executor.state() == ExecutorState::kHolding) {
      recorded.input.command =
          chance(random) < 0.5 ? OperatorCommand::kMoveToStart : OperatorCommand::kRun;
    }
    return recorded;
  }

  void Tick(Recorded& recorded) {
    recorded.input.received = recorded.frames;
    executor.Tick(recorded.input, output);
    for (std::size_t i = 0; i < 2; ++i) {
      ImpedanceCommand command;
      for (const CanFrame& frame : output.frames[i].frames()) {
        if (DecodeMitCommand(configs[i], frame, command) == Status::kOk &&
            command.kp_nm_per_rad > 0) {
          position[i] = command.position_rad;
        }
      }
    }
  }

  Primitive<float> primitive;
  std::mt19937 random;
  std::array<MitConfig, 2> configs;
  std::vector<std::unique_ptr<MitDrive>> drives;
  Executor executor;
  TickOutput output;
  std::array<float, 2> position{};
  std::int64_t tick = 0;
};

TEST(Executor, EveryFrameOnTheWireDecodesToASetpointWithinTheLimitsWhateverComesIn) {
  constexpr float kHalfStep_rad = 0.5F * 25.0F / 65535.0F + 1e-5F;
  constexpr float kHalfStep_rad_s = 0.5F * 100.0F / 4095.0F + 1e-4F;
  constexpr float kHalfStep_nm = 0.5F * 36.0F / 4095.0F + 1e-4F;
  int setpoints = 0;
  std::array<int, kExecutorStateCount> visits{};
  for (unsigned seed = 0; seed < 60; ++seed) {
    MitWorld world(seed);
    std::array<float, 2> last{};
    std::array<bool, 2> driven{};
    std::int64_t last_tick = 0;
    for (int i = 0; i < 4000; ++i) {
      auto input = world.MakeInput(seed % 3 == 0 ? 0.2 : (seed % 3 == 1 ? 0.005 : 0.0001));
      world.Tick(input);
      ++visits[static_cast<std::size_t>(world.output.record.state)];
      const auto elapsed = static_cast<float>(std::min<std::int64_t>(world.tick - last_tick, 3));
      last_tick = world.tick;
      for (std::size_t j = 0; j < 2; ++j) {
        ASSERT_EQ(world.output.frames[j].frames().size(), 1U) << "every tick writes every drive";
        ImpedanceCommand command;
        const bool is_setpoint =
            DecodeMitCommand(world.configs[j], world.output.frames[j].frames()[0], command) ==
                Status::kOk &&
            command.kp_nm_per_rad > 0;
        if (is_setpoint) {
          ++setpoints;
          const JointLimits<float>& limits = world.primitive.joints[j].limits;
          ASSERT_GE(command.position_rad, limits.position_min_rad - kHalfStep_rad);
          ASSERT_LE(command.position_rad, limits.position_max_rad + kHalfStep_rad);
          ASSERT_LE(std::abs(command.velocity_rad_s), limits.velocity_max_rad_s + kHalfStep_rad_s);
          ASSERT_LE(std::abs(command.torque_nm), limits.torque_max_nm + kHalfStep_nm);
          if (driven[j]) {
            ASSERT_LE(std::abs(command.position_rad - last[j]),
                      limits.velocity_max_rad_s * 0.00101F * elapsed + 2 * kHalfStep_rad);
          }
          last[j] = command.position_rad;
        }
        driven[j] = is_setpoint;
      }
    }
  }
  EXPECT_GT(setpoints, 10000);
  for (std::size_t s = 0; s < visits.size(); ++s) {
    EXPECT_GT(visits[s], 0) << "never in state " << ToString(static_cast<ExecutorState>(s));
  }
}

TEST(Executor, RecordedInputsReplayToTheSameBytes) {
  std::vector<MitWorld::Recorded> inputs;
  std::vector<CanFrame> frames;
  std::vector<TickRecord> records;
  {
    MitWorld world(5);
    for (int i = 0; i < 5000; ++i) {
      inputs.push_back(world.MakeInput(0.002));
      world.Tick(inputs.back());
      for (const FrameBatch& batch : world.output.frames) {
        frames.insert(frames.end(), batch.frames().begin(), batch.frames().end());
      }
      records.push_back(world.output.record);
    }
  }
  MitWorld replay(999);  // The seed does not matter: no random numbers are used.
  std::size_t next = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    replay.Tick(inputs[i]);
    for (const FrameBatch& batch : replay.output.frames) {
      for (const CanFrame& frame : batch.frames()) ASSERT_EQ(frame, frames[next++]) << "tick " << i;
    }
    const TickRecord& record = replay.output.record;
    ASSERT_EQ(record.state, records[i].state);
    ASSERT_EQ(record.faults, records[i].faults);
    for (std::size_t j = 0; j < 2; ++j) {
      ASSERT_EQ(record.joints[j].planned, records[i].joints[j].planned);
      ASSERT_EQ(record.joints[j].limited, records[i].joints[j].limited);
    }
  }
  EXPECT_EQ(next, frames.size());
  EXPECT_GT(next, 9000U);
}

}  // namespace
}  // namespace tumbler
