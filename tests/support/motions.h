#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/core/primitive.h"

namespace tumbler::testing {

/// The size and shape of the primitive that `RandomPrimitive` makes.
struct MotionShape {
  int joint_count = 2;
  int control_points = 12;
  double duration_s = 1.2;
  double settle_s = 0.05;
  double amplitude_rad = 1.0;  ///< Control points lie within +- this.
  int torque_points = 0;       ///< Of the feed-forward; 0: as many as the path has.
};

/// A primitive from rest to rest with random quintic paths and random cubic feed-forward. Its
/// limits are the bounds of its control points with 10 % to spare, as an optimiser's would be.
template <typename Scalar>
Primitive<Scalar> RandomPrimitive(const MotionShape& shape, std::mt19937& random) {
  std::uniform_real_distribution<double> point(-shape.amplitude_rad, shape.amplitude_rad);
  std::uniform_real_distribution<double> torque(-3.0, 3.0);
  Primitive<Scalar> primitive;
  primitive.name = FixedString<48>("random");
  primitive.duration_s = static_cast<Scalar>(shape.duration_s);
  primitive.settle_s = static_cast<Scalar>(shape.settle_s);
  primitive.entry_tolerance_rad = Scalar(0.05);
  primitive.following_tolerance_rad = Scalar(0.2);
  primitive.joint_count = shape.joint_count;
  using Spline = typename JointMotion<Scalar>::Spline;
  const auto n = static_cast<std::size_t>(shape.control_points);
  const auto assign = [&](Spline& spline, int degree, const std::vector<Scalar>& points) {
    std::array<Scalar, Spline::kMaxKnots> knots{};
    if (Spline::ClampedUniformKnots(degree, static_cast<int>(points.size()), primitive.duration_s,
                                    knots) != Status::kOk ||
        spline.Assign(degree,
                      std::span(knots.data(), points.size() + static_cast<std::size_t>(degree) + 1),
                      points) != Status::kOk) {
      throw std::logic_error("the shape of the motion is not valid");
    }
  };
  for (int j = 0; j < shape.joint_count; ++j) {
    JointMotion<Scalar>& motion = primitive.joints[static_cast<std::size_t>(j)];
    motion.name = FixedString<32>("joint" + std::to_string(j + 1));
    std::vector<Scalar> points(n);
    for (Scalar& c : points) c = static_cast<Scalar>(point(random));
    points[1] = points[2] = points[0];              // Rest at the start,
    points[n - 3] = points[n - 2] = points[n - 1];  // and at the end.
    assign(motion.position, 5, points);
    std::vector<Scalar> torques(static_cast<std::size_t>(
        shape.torque_points > 0 ? shape.torque_points : shape.control_points));
    for (Scalar& c : torques) c = static_cast<Scalar>(torque(random));
    assign(motion.torque, 3, torques);
    const auto largest = [](const Interval<Scalar>& bounds) {
      return std::max(-bounds.min, bounds.max);
    };
    const Interval<Scalar> position = motion.position.Bounds(0);
    motion.limits.position_min_rad = position.min - Scalar(0.1);
    motion.limits.position_max_rad = position.max + Scalar(0.1);
    motion.limits.velocity_max_rad_s = Scalar(1.1) * largest(motion.position.Bounds(1));
    motion.limits.acceleration_max_rad_s2 = Scalar(1.1) * largest(motion.position.Bounds(2));
    motion.limits.torque_max_nm = Scalar(1.1) * largest(motion.torque.Bounds(0));
  }
  return primitive;
}

/// The random primitive of a seed.
inline Primitive<float> Motion(unsigned seed, const MotionShape& shape = {}) {
  std::mt19937 random(seed);
  return RandomPrimitive<float>(shape, random);
}

/// Where a joint begins.
inline float Start(const Primitive<float>& primitive, std::size_t joint) {
  return primitive.joints[joint].position.control_points()[0];
}

}  // namespace tumbler::testing
