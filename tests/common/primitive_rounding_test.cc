// Primitives as the runtime has them, in single precision.

#include "common/files/primitive_rounding.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <stdexcept>

#include "common/files/primitive_limits.h"
#include "common/files/primitive_toml.h"
#include "tests/support/complete_primitive.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(PrimitiveToRuntime, RoundsEveryNumberToTheNearestFloat) {
  const Primitive<double> primitive = testing::PrimitiveExample().primitive;
  const Primitive<float> runtime = ToRuntime(primitive);
  EXPECT_EQ(runtime.name.view(), "wave");
  EXPECT_EQ(runtime.duration_s, 1.25F);
  EXPECT_EQ(runtime.settle_s, 0.375F);
  ASSERT_EQ(runtime.joint_count, 2);
  for (std::size_t j = 0; j < 2; ++j) {
    const auto points = primitive.joints[j].position.control_points();
    ASSERT_EQ(runtime.joints[j].position.control_points().size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(runtime.joints[j].position.control_points()[i], static_cast<float>(points[i]));
    }
    EXPECT_EQ(runtime.joints[j].position.end_s(), runtime.duration_s);
    EXPECT_EQ(runtime.joints[j].torque.end_s(), runtime.duration_s);
  }
}

TEST(PrimitiveToRuntime, ResultHoldsItsOwnLimitsAndWidensThemByRoundingOnly) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> angle(-3.0, 3.0);
  int widened = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Primitive<double> primitive;
    primitive.duration_s = 1.2;
    primitive.entry_tolerance_rad = primitive.following_tolerance_rad = 0.1;
    primitive.joint_count = 1;
    auto& motion = primitive.joints[0];
    motion.name = FixedString<32>("a");
    std::vector<double> points(14);
    for (double& point : points) point = angle(random);
    std::vector<double> interior;
    for (int i = 1; i < 9; ++i) interior.push_back(1.2 * i / 9);
    motion.position = testing::MakeSpline(5, interior, 1.2, points);
    motion.torque = testing::MakeSpline(0, {}, 1.2, {0.1});
    // Every limit is active, as in an optimum.
    const auto magnitude = [&motion](int d) {
      const Extent extent = ExtentOf(motion.position, d);
      return std::max(std::abs(extent.min), std::abs(extent.max));
    };
    const auto position = motion.position.Bounds(0);
    motion.limits = {position.min, position.max, magnitude(1), magnitude(2), 0.1};
    const Primitive<float> runtime = ToRuntime(primitive);
    const auto& rounded = runtime.joints[0];
    const auto& limits = rounded.limits;
    EXPECT_EQ(limits.position_min_rad, static_cast<float>(position.min));
    EXPECT_EQ(limits.position_max_rad, static_cast<float>(position.max));
    EXPECT_GE(rounded.position.Bounds(0).min, limits.position_min_rad);
    EXPECT_LE(rounded.position.Bounds(0).max, limits.position_max_rad);
    EXPECT_LE(rounded.torque.Bounds(0).max, limits.torque_max_nm);
    const std::array<float, 2> limit = {limits.velocity_max_rad_s, limits.acceleration_max_rad_s2};
    for (int d = 1; d <= 2; ++d) {
      const float now = limit[static_cast<std::size_t>(d - 1)];
      for (int i = 0; i <= 2000; ++i) {
        const auto sample = rounded.position.Evaluate(1.2F * static_cast<float>(i) / 2000.0F);
        EXPECT_LE(std::abs(d == 1 ? sample.first : sample.second), now);
      }
      EXPECT_LE(now, magnitude(d) * (1 + 1e-5));
      EXPECT_GE(now, static_cast<float>(magnitude(d)));
      if (now > static_cast<float>(magnitude(d))) ++widened;
    }
  }
  EXPECT_GT(widened, 20);  // With fewer, the checks above tested nothing.
}

TEST(PrimitiveToRuntime, RefusesWhatRoundingWouldDistort) {
  PrimitiveFile file = testing::PrimitiveExample();
  auto& motion = file.primitive.joints[0];
  // As floats, knots 1e-9 s apart are equal.
  motion.position =
      testing::MakeSpline(5, {0.5, 0.5 + 1e-9}, 1.25, {0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1});
  try {
    ToRuntime(file.primitive);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("joint 'left'"), HasSubstr("same time")));
  }
  // With knots 1 us apart, an acceleration has two or three right digits.
  motion.position = testing::MakeSpline(3, {0.7, 0.700001, 0.700002}, 1.25,
                                        {1.3, 1.3, 1.3, 1.3000003, 1.3, 1.3, 1.3});
  const auto bounds = motion.position.Bounds(2);
  motion.limits = {-2, 2, 100, std::max(-bounds.min, bounds.max), 2};
  try {
    ToRuntime(file.primitive);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("joint 'left'"), HasSubstr("acceleration"),
                                    HasSubstr("rad/s^2 beyond")));
  }
  file = testing::PrimitiveExample();
  file.primitive.entry_tolerance_rad = 1e-300;
  EXPECT_THROW(ToRuntime(file.primitive), std::invalid_argument);
}

}  // namespace
}  // namespace tumbler
