#include "runtime/executor/safety.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace tumbler {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

SafetyLimits SomeLimits() {
  JointLimits<float> joint;
  joint.position_min_rad = -1.5F;
  joint.position_max_rad = 2.0F;
  joint.velocity_max_rad_s = 10;
  joint.acceleration_max_rad_s2 = 100;
  joint.torque_max_nm = 8;
  return MakeSafetyLimits(joint, 0.001F, 0.01F);
}

TEST(LimitSetpoint, LeavesAPlanInsideTheLimitsAlone) {
  const JointSetpoint previous{0.5F, 3.0F, 1.0F};
  const JointSetpoint planned{0.503F, 3.2F, 1.2F};
  const LimitedSetpoint result = LimitSetpoint(SomeLimits(), planned, previous, 1);
  EXPECT_EQ(result.setpoint, planned);
  EXPECT_FALSE(result.changed);
  EXPECT_FALSE(result.non_finite);
}

TEST(LimitSetpoint, StopsEachQuantityAtItsOwnLimit) {
  const SafetyLimits limits = SomeLimits();
  const JointSetpoint near_top{1.995F, 0, 7.9F};
  const LimitedSetpoint high = LimitSetpoint(limits, {3.0F, 20.0F, 9.0F}, near_top, 1);
  EXPECT_EQ(high.setpoint, (JointSetpoint{2.0F, 10.0F, 8.0F}));
  EXPECT_TRUE(high.changed);
  const LimitedSetpoint low = LimitSetpoint(limits, {-3.0F, -20.0F, -9.0F}, {-1.495F, 0, -7.9F}, 1);
  EXPECT_EQ(low.setpoint, (JointSetpoint{-1.5F, -10.0F, -8.0F}));
}

TEST(LimitSetpoint, AllowsOneStepForEachElapsedTick) {
  const SafetyLimits limits = SomeLimits();
  for (int ticks = 1; ticks <= 3; ++ticks) {
    const LimitedSetpoint result = LimitSetpoint(limits, {1, 0, 8}, {}, ticks);
    EXPECT_FLOAT_EQ(result.setpoint.position_rad, 0.01001F * static_cast<float>(ticks));
    EXPECT_FLOAT_EQ(result.setpoint.torque_nm, 0.8F * static_cast<float>(ticks));
  }
}

TEST(LimitSetpoint, GoesBackInsideLimitsThatHaveBecomeNarrowerStepByStep) {
  const SafetyLimits limits = SomeLimits();
  JointSetpoint now{2.5F, 0, -9.5F};
  for (int i = 0; i < 200; ++i) {
    const JointSetpoint before = now;
    now = LimitSetpoint(limits, {2.6F, 0, -9.6F}, before, 1).setpoint;
    ASSERT_LE(now.position_rad, before.position_rad);
    ASSERT_LE(before.position_rad - now.position_rad, limits.position_step_rad + 1e-6F);
    ASSERT_GE(now.torque_nm, before.torque_nm);
    ASSERT_LE(now.torque_nm - before.torque_nm, limits.torque_step_nm + 1e-6F);
  }
  EXPECT_EQ(now.position_rad, limits.position_max_rad);
  EXPECT_EQ(now.torque_nm, -limits.torque_max_nm);
}

TEST(LimitSetpoint, HoldsThePositionAndFadesTheTorqueWhenThePlanIsNotFinite) {
  const JointSetpoint previous{0.5F, 3.0F, 2.0F};
  for (const float bad : {kNaN, kInfinity, -kInfinity}) {
    for (int field = 0; field < 3; ++field) {
      JointSetpoint planned = previous;
      (field == 0   ? planned.position_rad
       : field == 1 ? planned.velocity_rad_s
                    : planned.torque_nm) = bad;
      const LimitedSetpoint result = LimitSetpoint(SomeLimits(), planned, previous, 1);
      EXPECT_TRUE(result.non_finite);
      EXPECT_EQ(result.setpoint.position_rad, 0.5F);
      EXPECT_EQ(result.setpoint.velocity_rad_s, 0.0F);
      EXPECT_FLOAT_EQ(result.setpoint.torque_nm, 1.2F);
    }
  }
}

TEST(LimitSetpoint, WhateverIsPlannedStaysWithinLimitsAndSteps) {
  std::mt19937 random(20);
  std::uniform_real_distribution<float> wide(-30, 30);
  std::uniform_int_distribution<int> kind(0, 9);
  std::uniform_int_distribution<int> ticks_of(1, 3);
  const auto value = [&](float scale) {
    switch (kind(random)) {
      case 0:
        return kNaN;
      case 1:
        return kInfinity;
      case 2:
        return -std::numeric_limits<float>::max();
      case 3:
        return std::numeric_limits<float>::denorm_min();
      default:
        return wide(random) * scale;
    }
  };
  const SafetyLimits limits = SomeLimits();
  JointSetpoint previous;
  for (int i = 0; i < 200000; ++i) {
    const int ticks = ticks_of(random);
    const JointSetpoint planned{previous.position_rad + value(0.01F), value(1), value(1)};
    const JointSetpoint now = LimitSetpoint(limits, planned, previous, ticks).setpoint;
    const auto share = static_cast<float>(ticks) * 1.000001F;
    ASSERT_GE(now.position_rad, limits.position_min_rad);
    ASSERT_LE(now.position_rad, limits.position_max_rad);
    ASSERT_LE(std::abs(now.velocity_rad_s), limits.velocity_max_rad_s);
    ASSERT_LE(std::abs(now.torque_nm), limits.torque_max_nm);
    ASSERT_LE(std::abs(now.position_rad - previous.position_rad),
              limits.position_step_rad * share + 1e-6F);
    ASSERT_LE(std::abs(now.torque_nm - previous.torque_nm), limits.torque_step_nm * share + 1e-5F);
    previous = now;
  }
}

TEST(ClampOrLow, ClampsAndGivesLowForNaN) {
  EXPECT_EQ(ClampOrLow(0.5F, -1, 2), 0.5F);
  EXPECT_EQ(ClampOrLow(-kInfinity, -1, 2), -1);
  EXPECT_EQ(ClampOrLow(3, -1, 2), 2);
  EXPECT_EQ(ClampOrLow(kNaN, -1, 2), -1);
}

TEST(AreFinite, SeesEachPlaceAndEachKind) {
  EXPECT_TRUE(AreFinite(0.0F, -1.0F, std::numeric_limits<float>::max()));
  for (const float bad : {kNaN, kInfinity, -kInfinity}) {
    EXPECT_FALSE(IsFinite(bad));
    EXPECT_FALSE(AreFinite(bad, 1.0F, 2.0F));
    EXPECT_FALSE(AreFinite(1.0F, bad, 2.0F));
    EXPECT_FALSE(AreFinite(1.0F, 2.0F, bad));
    EXPECT_FALSE(AreFinite(bad, -bad, 2.0F));
  }
}

}  // namespace
}  // namespace tumbler
