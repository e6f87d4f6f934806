#pragma once

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "common/files/primitive_rounding.h"
#include "firmware_interface/devices/xsens_mti.h"
#include "tests/support/motions.h"
#include "tests/support/random_feedback.h"

namespace tumbler::testing {

/// A primitive of two joints with feedback, as the executor plays it.
inline Primitive<float> MotionWithFeedback(unsigned seed, MotionShape shape = {}) {
  std::mt19937 random(seed);
  Primitive<double> primitive = RandomPrimitive<double>(shape, random);
  primitive.feedback = RandomFeedback(primitive, 5, random);
  if (seed % 3 == 0) ShareTorqueKnots(primitive, random);
  return ToRuntime(primitive);
}

/// The frames of a sensor on a link with this pitch (about -y) and rate of pitch.
inline std::vector<CanFrame> SensorFrames(double pitch_rad, double rate_rad_s,
                                          const XsensMtiConfig& config = {}) {
  const std::array<double, 4> attitude{std::cos(pitch_rad / 2), 0, -std::sin(pitch_rad / 2), 0};
  return {XsensQuaternionFrame(config, attitude), XsensRateFrame(config, {0, -rate_rad_s, 0})};
}

}  // namespace tumbler::testing
