#include "runtime/executor/sensor_watch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "firmware_interface/devices/xsens_mti.h"
#include "tests/support/sensor_motion.h"

namespace tumbler {
namespace {

constexpr double kHalfTurn = std::numbers::pi;

TEST(AngleOf, IsTheArcTangentInAllQuadrants) {
  for (double angle = -kHalfTurn; angle <= kHalfTurn; angle += 1e-4) {
    for (const double radius : {1e-3, 1.0, 50.0}) {
      const auto x = static_cast<float>(radius * std::cos(angle));
      const auto y = static_cast<float>(radius * std::sin(angle));
      EXPECT_NEAR(static_cast<double>(AngleOf(x, y)),
                  std::atan2(static_cast<double>(y), static_cast<double>(x)), 5e-7)
          << angle;
    }
  }
  EXPECT_EQ(AngleOf(0, 0), 0);
  EXPECT_EQ(AngleOf(std::numeric_limits<float>::quiet_NaN(), 0), 0);
}

/// A watch with its sensor, fed tick by tick.
struct WatchRig {
  explicit WatchRig(const SensorSettings& settings = {}) : watch(sensor, settings) {
    watch.Start(0.001F);
  }

  SensorStatus Tick(const std::vector<CanFrame>& frames, int elapsed = 1) {
    for (const CanFrame& frame : frames) watch.Count(sensor.Decode(frame), sensor.reading(), 0);
    watch.EndTick(elapsed, sensor.reading());
    return watch.status();
  }
  /// A tick in which the sensor reports, with the noise that every sensor has.
  SensorStatus Report(double pitch_rad, double rate_rad_s) {
    flip = -flip;
    return Tick(testing::SensorFrames(pitch_rad + 1e-4 * flip, rate_rad_s));
  }

  XsensMti sensor;
  SensorWatch watch;
  double flip = 1;
};

TEST(SensorWatch, FindsPitchAndRateThroughAnyMountingAndAnyHeading) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> angle(-kHalfTurn, kHalfTurn);
  using Matrix = std::array<std::array<double, 3>, 3>;
  const auto rotation = [](const std::array<double, 4>& q) {
    const auto [w, x, y, z] = q;
    return Matrix{{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                   {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                   {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
  };
  const auto product = [](const std::array<double, 4>& a, const std::array<double, 4>& b) {
    return std::array<double, 4>{a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                                 a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                                 a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                                 a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  };
  for (int i = 0; i < 500; ++i) {
    std::array<double, 4> mount{normal(random), normal(random), normal(random), normal(random)};
    double length = 0;
    for (const double x : mount) length += x * x;
    for (double& x : mount) x /= std::sqrt(length);
    const Matrix sensor_to_link = rotation(mount);
    SensorSettings settings;
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c)
        settings.mounting[r][c] = static_cast<float>(sensor_to_link[r][c]);
    }
    ASSERT_TRUE(settings.IsValid());
    const double pitch = angle(random), heading = angle(random),
                 rate = std::clamp(10 * normal(random), -30.0, 30.0);
    // The link: turned by the pitch about -y, and then by the heading about z.
    const std::array<double, 4> link = product({std::cos(heading / 2), 0, 0, std::sin(heading / 2)},
                                               {std::cos(pitch / 2), 0, -std::sin(pitch / 2), 0});
    // v_link = M v_sensor, so a rate of -rate about the link's y is M^T (0, -rate, 0).
    std::array<double, 3> turn{};
    for (std::size_t c = 0; c < 3; ++c) turn[c] = -rate * sensor_to_link[1][c];
    WatchRig rig(settings);
    const XsensMtiConfig ids;
    EXPECT_EQ(
        rig.Tick({XsensQuaternionFrame(ids, product(link, mount)), XsensRateFrame(ids, turn)}),
        SensorStatus::kOk);
    EXPECT_NEAR(std::remainder(static_cast<double>(rig.watch.pitch_rad()) - pitch, 2 * kHalfTurn),
                0, 2e-4);
    EXPECT_NEAR(static_cast<double>(rig.watch.rate_rad_s()), rate, 4e-3);
  }
}

TEST(SensorWatch, IsWithoutDataUntilBothPartsHaveComeAndStaleWhenTheyAreOld) {
  WatchRig rig;
  EXPECT_EQ(rig.Tick({}), SensorStatus::kNoData);
  EXPECT_EQ(rig.watch.age_ticks(), -1);
  const std::vector<CanFrame> frames = testing::SensorFrames(0.2, 0);
  EXPECT_EQ(rig.Tick({frames[0]}), SensorStatus::kNoData) << "the rate is missing";
  EXPECT_EQ(rig.Tick({frames[1]}), SensorStatus::kOk) << "parts may come in two ticks";
  EXPECT_EQ(rig.watch.age_ticks(), 1) << "it is as old as the older of them";
  for (int i = 0; i < 4; ++i) EXPECT_EQ(rig.Tick({}), SensorStatus::kOk);
  EXPECT_EQ(rig.Tick({}), SensorStatus::kStale);
  EXPECT_EQ(rig.watch.age_ticks(), 6);
  EXPECT_EQ(rig.Report(1.0, 0), SensorStatus::kOk) << "what it did meanwhile is not known";
  EXPECT_EQ(rig.Tick({}, 7), SensorStatus::kStale) << "missed ticks count";
}

TEST(SensorWatch, AReportIsMadeOfTheNewestHalfOfEachKind) {
  WatchRig rig;
  const auto before = testing::SensorFrames(0.1, 0), after = testing::SensorFrames(0.2, 0.5);
  rig.Tick({before[0]});
  rig.Tick({after[0]});
  EXPECT_EQ(rig.watch.status(), SensorStatus::kNoData);
  EXPECT_EQ(rig.Tick({after[1]}), SensorStatus::kOk);
  EXPECT_NEAR(rig.watch.pitch_rad(), 0.2F, 1e-3F);
  EXPECT_EQ(rig.watch.age_ticks(), 1) << "that of the second attitude";
}

TEST(SensorWatch, OnlyNewsOfARotationShowTheRobotOnItsSide) {
  WatchRig rig;
  const auto rolled = [](double roll_rad, double length) {
    return std::vector{XsensQuaternionFrame({}, {length * std::cos(roll_rad / 2),
                                                 length * std::sin(roll_rad / 2), 0, 0}),
                       XsensRateFrame({}, {0, 0, 0})};
  };
  double flip = 1e-3;
  const auto tilt_rad = [&](double roll_rad, double length) {
    flip = -flip;  // the noise that every sensor has
    EXPECT_EQ(rig.Tick(rolled(roll_rad + flip, length)), SensorStatus::kTilted);
    return static_cast<double>(rig.watch.tilt_rad());
  };
  EXPECT_NEAR(tilt_rad(0.8, 1), 0.8, 2e-3);
  EXPECT_EQ(tilt_rad(0.8, 0.9), 0) << "that is no rotation";
  EXPECT_NEAR(tilt_rad(0.8, 1), 0.8, 2e-3);
  for (int repeat = 1; repeat <= 25; ++repeat) {
    EXPECT_EQ(rig.Tick(rolled(0.8, 1)), SensorStatus::kTilted);
    EXPECT_EQ(rig.watch.tilt_rad() > 0, repeat <= 21)
        << "a frozen sensor shows nothing: " << repeat;
  }
  EXPECT_NEAR(tilt_rad(0.8, 1), 0.8, 2e-3);
  EXPECT_EQ(tilt_rad(0.1, 1), 0) << "it has come back";
}

TEST(SensorWatch, TakesNoSensorThatRepeatsItselfForLong) {
  WatchRig rig;
  const std::vector<CanFrame> frames = testing::SensorFrames(0.2, 0);
  for (int i = 0; i <= 20; ++i) EXPECT_EQ(rig.Tick(frames), SensorStatus::kOk) << i;
  EXPECT_EQ(rig.Tick(frames), SensorStatus::kFrozen);
  EXPECT_EQ(rig.Report(0.3, 0), SensorStatus::kFrozen) << "it is not believed again";
  rig.watch.Trust();
  EXPECT_EQ(rig.Report(0.3, 0), SensorStatus::kOk);
}

TEST(SensorWatch, TakesNoAttitudeThatIsNoRotationOrLeavesThePlane) {
  const XsensMtiConfig ids;
  const CanFrame still = XsensRateFrame(ids, {0, 0, 0});
  EXPECT_EQ(WatchRig().Tick({XsensQuaternionFrame(ids, {0.9, 0, 0, 0}), still}),
            SensorStatus::kNoRotation);
  EXPECT_EQ(WatchRig().Tick({XsensQuaternionFrame(ids, {0, 0, 0, 0}), still}),
            SensorStatus::kNoRotation);
  const auto rolled = [&](double roll) {
    return XsensQuaternionFrame(ids, {std::cos(roll / 2), std::sin(roll / 2), 0, 0});
  };
  EXPECT_EQ(WatchRig().Tick({rolled(0.25), still}), SensorStatus::kOk);
  EXPECT_EQ(WatchRig().Tick({rolled(0.35), still}), SensorStatus::kTilted);
  EXPECT_EQ(WatchRig().Tick({rolled(0), XsensRateFrame(ids, {9, 0, 0})}), SensorStatus::kTilted);
  EXPECT_EQ(WatchRig().Tick({rolled(0), XsensRateFrame(ids, {0, 0, -9})}), SensorStatus::kTilted);
  EXPECT_EQ(WatchRig().Tick({rolled(0), XsensRateFrame(ids, {0, 36, 0})}), SensorStatus::kTooFast);
  EXPECT_EQ(WatchRig().Tick({rolled(0), XsensRateFrame(ids, {0, 34, 0})}), SensorStatus::kOk);
}

TEST(SensorWatch, TakesNoSensorWhoseAxesAreExchangedOnceTheRobotTurnsFromWhereItStoodLevel) {
  // Attitude and rates fit each other, and nothing is tilted: the turn is about another axis.
  const XsensMtiConfig ids;
  double pitch_rad = 0;
  WatchRig rig;
  for (int i = 0; i < 200 && rig.watch.status() != SensorStatus::kTilted; ++i) {
    const double rate_rad_s = 50 * 1e-3 * i;
    pitch_rad += rate_rad_s * 1e-3;
    rig.Tick({XsensQuaternionFrame(ids, {std::cos(pitch_rad / 2), 0, 0, std::sin(pitch_rad / 2)}),
              XsensRateFrame(ids, {0, 0, rate_rad_s})});
  }
  EXPECT_EQ(rig.watch.status(), SensorStatus::kTilted);
  EXPECT_LT(pitch_rad, 0.15);
  // A twist of a landing is over soon, and a heading that drifts is none.
  WatchRig landing;
  for (int i = 0; i < 1000; ++i) {
    const double rate_rad_s = i % 300 < 10 ? 3 : 0.05;
    ASSERT_EQ(landing.Tick({XsensQuaternionFrame(ids, {1, 0, 1e-4 * (i % 2), 0}),
                            XsensRateFrame(ids, {0, 0, rate_rad_s})}),
              SensorStatus::kOk)
        << i;
  }
}

TEST(SensorWatch, DoubtsATurnThatIsNotInThePlaneLongBeforeItHasGoneFar) {
  // Exchanged axes, as above, and a slow turn: its angle is trusted no longer after 10 mrad.
  const XsensMtiConfig ids;
  WatchRig rig, falls;
  const auto turn = [&](WatchRig& exchanged) {
    double yaw_rad = 0;
    for (int i = 0; i < 200 && !exchanged.watch.is_doubtful(); ++i) {
      const double rate_rad_s = 5e-3 * i;
      yaw_rad += rate_rad_s * 1e-3;
      const double c = std::cos(yaw_rad / 2), s = std::sin(yaw_rad / 2);
      EXPECT_EQ(exchanged.Tick({XsensQuaternionFrame(ids, {c, 0, 0, s}),
                                XsensRateFrame(ids, {0.05, 0.1, rate_rad_s})}),
                SensorStatus::kOk);
    }
    EXPECT_TRUE(exchanged.watch.is_doubtful());
    EXPECT_LT(yaw_rad, 0.012);
  };
  turn(rig);
  turn(falls);
  // It ends by itself, within a second, and at once when the robot falls in its plane.
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(rig.Report(0, 0), SensorStatus::kOk);
  EXPECT_FALSE(rig.watch.is_doubtful());
  for (int i = 0; i < 50; ++i) falls.Report(2e-3 * i, 2);
  EXPECT_FALSE(falls.watch.is_doubtful());
  // About the other axis, too.
  for (int i = 0; i < 80; ++i) {
    rig.Tick(
        {XsensQuaternionFrame(ids, {1, 0, 0, 1e-4 * (i % 2)}), XsensRateFrame(ids, {0.4, 0, 0})});
  }
  EXPECT_TRUE(rig.watch.is_doubtful());
  // A gyroscope that is off by 0.03 rad/s is none, at any rate of reports.
  for (const int elapsed : {1, 4}) {
    WatchRig off;
    for (int i = 0; i < 2000; ++i) {
      for (int k = 1; k < elapsed; ++k) off.Tick({});
      off.Tick({XsensQuaternionFrame(ids, {1, 0, 0, 1e-4 * (i % 2)}),
                XsensRateFrame(ids, {0, 0, 0.03})});
      ASSERT_FALSE(off.watch.is_doubtful()) << i << " of every " << elapsed;
    }
  }
}

TEST(SensorWatch, DoubtsNoMotionInThePlaneOfASensorThatIsNoisyAndSitsAskew) {
  const XsensMtiConfig ids;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr double kRoll_rad = 0.02;
  WatchRig rig;
  for (int i = 0; i < 20000; ++i) {
    const double pitch = 6 * std::sin(2e-3 * i), rate = 12 * std::cos(2e-3 * i);
    // The turn about y, then the sensor's roll about its x.
    const double c = std::cos(pitch / 2), s = std::sin(pitch / 2);
    const double cr = std::cos(kRoll_rad / 2), sr = std::sin(kRoll_rad / 2);
    const auto noisy = [&](double x) { return x + 20e-3 * normal(random); };
    ASSERT_EQ(rig.Tick({XsensQuaternionFrame(ids, {c * cr, c * sr, s * cr, -s * sr}),
                        XsensRateFrame(ids, {noisy(0), noisy(rate * std::cos(kRoll_rad)),
                                             noisy(-rate * std::sin(kRoll_rad))})}),
              SensorStatus::kOk)
        << i;
    ASSERT_FALSE(rig.watch.is_doubtful()) << i;
  }
}

TEST(SensorWatch, BelievesAMotionWhoseRateFitsAndNoJumpOrWrongRate) {
  // Whole turns at up to 12 rad/s, with noise of 5 mrad and 20 mrad/s.
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  WatchRig rig;
  const auto pitch = [](double t) { return 6 * std::sin(2 * t); };
  const auto rate = [](double t) { return 12 * std::cos(2 * t); };
  for (int i = 0; i < 20000; ++i) {
    const double t = 1e-3 * i;
    ASSERT_EQ(rig.Tick(testing::SensorFrames(pitch(t) + 5e-3 * normal(random),
                                             rate(t) + 20e-3 * normal(random))),
              SensorStatus::kOk)
        << t;
  }
  WatchRig jumps;
  for (int i = 0; i < 100; ++i) ASSERT_EQ(jumps.Report(0.2, 0), SensorStatus::kOk);
  EXPECT_EQ(jumps.Report(0.3, 0), SensorStatus::kInconsistent);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(jumps.Report(0.3, 0), SensorStatus::kInconsistent);

  WatchRig wrong;  // The attitude turns, and the rate is that of another axis.
  SensorStatus status = SensorStatus::kOk;
  for (int i = 0; i < 200 && status == SensorStatus::kOk; ++i) status = wrong.Report(3e-3 * i, 0);
  EXPECT_EQ(status, SensorStatus::kInconsistent);
}

TEST(SensorWatch, NoticesReportsThatComeLaterThanTheyDidWhateverTheClocksBeganWith) {
  for (const std::uint32_t start : {0U, 123456789U, 0xfffffff0U}) {
    WatchRig rig;
    const XsensMtiConfig ids;
    const auto tick = [&](int n, double behind_s) {
      std::vector<CanFrame> frames = testing::SensorFrames(1e-4 * (n % 2), 0);
      // The sensor's clock runs 50 ppm slow.
      const double sensor_s = (1e-3 * n - behind_s) * (1 - 50e-6);
      frames.push_back(XsensTimeFrame(
          ids, start + static_cast<std::uint32_t>(std::llround(std::max(sensor_s, 0.0) * 1e4))));
      return rig.Tick(frames);
    };
    int n = 1;
    for (; n < 20000; ++n) ASSERT_EQ(tick(n, 0), SensorStatus::kOk) << n;
    for (; n < 20100; ++n) ASSERT_EQ(tick(n, 0.005), SensorStatus::kOk) << n;
    for (; n < 20200; ++n) ASSERT_EQ(tick(n, 0.1), SensorStatus::kLate) << n;
    for (; n < 20300; ++n) ASSERT_EQ(tick(n, 0), SensorStatus::kOk) << "prompt again";
  }
}

TEST(SensorWatch, TakesNoLeapOfTheSensorsClockForPromptness) {
  // Half the range of the clock and a little less or more: what the leap makes later is then up to
  // 2^31 steps late, which no int32 holds.
  for (std::uint32_t leap = 0x80000000U - 3; leap <= 0x80000000U + 3; ++leap) {
    WatchRig rig;
    const auto tick = [&](std::uint32_t n, std::uint32_t by) {
      std::vector<CanFrame> frames = testing::SensorFrames(1e-4 * (n % 2), 0);
      frames.push_back(XsensTimeFrame(XsensMtiConfig{}, 10 * n + by));
      return rig.Tick(frames);
    };
    std::uint32_t n = 1;
    for (; n < 200; ++n) ASSERT_EQ(tick(n, 0), SensorStatus::kOk) << n;
    const bool late = tick(n++, leap) == SensorStatus::kLate;
    EXPECT_NE(tick(n++, 0) == SensorStatus::kLate, late) << "a leap by " << leap;
  }
}

TEST(SensorSettings, AreRefusedWhereTheyMakeNoSense) {
  SensorSettings settings;
  EXPECT_TRUE(settings.IsValid());
  settings.mounting[1] = {0, -1, 0};
  EXPECT_FALSE(settings.IsValid()) << "a mirror is no rotation";
  settings = {};
  settings.mounting[0] = {2, 0, 0};
  EXPECT_FALSE(settings.IsValid());
  settings = {};
  settings.chain[1] = 0.5F;
  EXPECT_FALSE(settings.IsValid());
  settings = {};
  settings.age_ticks_max = 0;
  EXPECT_FALSE(settings.IsValid());
  settings = {};
  settings.jump_max_rad = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(settings.IsValid());
}

}  // namespace
}  // namespace tumbler
