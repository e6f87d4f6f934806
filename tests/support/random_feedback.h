#pragma once

#include <array>
#include <cstddef>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"

namespace tumbler::testing {

/// A feedback on the angle of the link behind the last joint, with random gains and a random plan.
template <typename Scalar>
Feedback<Scalar> RandomFeedback(const Primitive<Scalar>& primitive, int knots,
                                std::mt19937& random) {
  using Spline = typename Feedback<Scalar>::Spline;
  std::uniform_real_distribution<double> number(-1, 1);
  Feedback<Scalar> feedback;
  feedback.link = FixedString<32>("last_link");
  feedback.knot_count = knots;
  for (int i = 0; i < knots; ++i) {
    const bool last = i == knots - 1;
    feedback.knots_s[static_cast<std::size_t>(i)] =
        last ? primitive.duration_s
             : primitive.duration_s * static_cast<Scalar>(i) / static_cast<Scalar>(knots - 1);
  }
  constexpr int kDegree = 5, kPoints = 16;
  std::array<Scalar, Spline::kMaxKnots> path_knots{};
  std::array<Scalar, kPoints> points{};
  for (Scalar& c : points) c = static_cast<Scalar>(3 * number(random));
  points[1] = points[0];
  points[kPoints - 2] = points[kPoints - 1];
  if (Spline::ClampedUniformKnots(kDegree, kPoints, primitive.duration_s, path_knots) !=
          Status::kOk ||
      feedback.angle.Assign(kDegree,
                            std::span<const Scalar>(path_knots.data(), kPoints + kDegree + 1),
                            points) != Status::kOk) {
    throw std::logic_error("no spline");
  }
  feedback.error_min_rad = Scalar(0.0625);
  feedback.error_full_rad = Scalar(0.125);
  feedback.error_max_rad = Scalar(0.75);
  feedback.start_error_max_rad = Scalar(0.25);
  feedback.fade_in_s = Scalar(0.05);
  feedback.fade_out_s = Scalar(0.1);
  for (int j = 0; j < primitive.joint_count; ++j) {
    JointFeedback<Scalar>& joint = feedback.joints[static_cast<std::size_t>(j)];
    joint.chain = Scalar(j == primitive.joint_count - 1 ? 1 : 0);
    for (std::size_t k = 0; k < static_cast<std::size_t>(knots); ++k) {
      joint.angle_gain[k] = static_cast<Scalar>(number(random));
      joint.rate_gain[k] = static_cast<Scalar>(0.2 * number(random));
    }
    joint.correction_max_rad = Scalar(0.25);
    joint.correction_rate_max_rad_s = Scalar(5);
  }
  return feedback;
}

/// Gives its plan's angle the knots of the feed-forward, as the optimiser does.
template <typename Scalar>
void ShareTorqueKnots(Primitive<Scalar>& primitive, std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  const auto& torque = primitive.joints[0].torque;
  std::vector<Scalar> points(torque.control_points().size());
  double angle = number(random);
  for (Scalar& c : points) c = static_cast<Scalar>(angle += 0.1 * number(random));
  if (primitive.feedback.angle.Assign(torque.degree(), torque.knots(), points) != Status::kOk)
    throw std::logic_error("no spline");
}

/// Gives the primitive of a file such a feedback, with the chains of the root and the last link.
inline void AddRandomFeedback(PrimitiveFile& file, int knots, unsigned seed) {
  std::mt19937 random(seed);
  file.primitive.feedback = RandomFeedback(file.primitive, knots, random);
  std::vector<double> chain(static_cast<std::size_t>(file.primitive.joint_count), 0.0);
  file.chains = {{"root_link", chain}};
  chain.back() = 1;
  file.chains.push_back({"last_link", chain});
}

}  // namespace tumbler::testing
