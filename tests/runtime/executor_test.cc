#include "runtime/executor/executor.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include "tests/support/executor_rig.h"
#include "tests/support/motions.h"

namespace tumbler {
namespace {

using testing::ExecutorRig;
using testing::Motion;
using testing::MotionShape;

static_assert(std::is_trivially_copyable_v<TickRecord>);

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

}  // namespace
}  // namespace tumbler
