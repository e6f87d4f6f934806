#include "common/files/primitive_rounding.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/primitive_limits.h"
#include "common/files/toml_reader.h"

namespace tumbler {
namespace {

using Motion = JointMotion<double>;

// How far rounding to float may push a velocity or acceleration beyond its limit, as a share of the
// limit. With knots 10 ms apart float carries accelerations to about 0.1 rad/s^2; more than this
// says that the knots are too close.
constexpr double kRoundingAllowance = 1e-3;

[[noreturn]] void FailPart(const std::string& part, const std::string& problem) {
  throw std::invalid_argument(
      fmt::format("{} cannot be played in single precision: {}", part, problem));
}

std::string PartOf(const Motion& motion) { return fmt::format("joint '{}'", motion.name.view()); }

[[noreturn]] void FailRounding(const Motion& motion, const std::string& problem) {
  FailPart(PartOf(motion), problem);
}

float Rounded(double value) { return static_cast<float>(value); }

// The nearest float. A limit beyond the range of float becomes the largest float.
float RoundedLimit(double value) {
  constexpr double kLargest = static_cast<double>(std::numeric_limits<float>::max());
  return static_cast<float>(std::clamp(value, -kLargest, kLargest));
}

JointMotion<float>::Spline Rounded(const std::string& part, const Motion::Spline& spline,
                                   const char* what) {
  std::vector<float> knots(spline.knots().size());
  std::transform(spline.knots().begin(), spline.knots().end(), knots.begin(),
                 [](double x) { return Rounded(x); });
  for (std::size_t i = 1; i < knots.size(); ++i) {
    if (knots[i] == knots[i - 1] && spline.knots()[i] != spline.knots()[i - 1]) {
      FailPart(part, fmt::format("knots {} and {} of its {} spline round to the same time", i - 1,
                                 i, what));
    }
  }
  std::vector<float> points(spline.control_points().size());
  std::transform(spline.control_points().begin(), spline.control_points().end(), points.begin(),
                 [](double x) { return Rounded(x); });
  JointMotion<float>::Spline result;
  if (result.Assign(spline.degree(), knots, points) != Status::kOk) {
    FailPart(part, fmt::format("its {} spline holds a number beyond the range of float", what));
  }
  return result;
}

// What a curve reaches in single precision is off its extent by less than this share of the largest
// control point: each of its sums has at most eight products, and their basis functions as many
// factors.
constexpr double kEvaluation = 16 * static_cast<double>(std::numeric_limits<float>::epsilon());

// The limit of the bound, widened to what the rounded path reaches where that exceeds it.
float Widened(const Motion& motion, const Bound& bound, std::span<const float> points) {
  double largest = 0;
  for (const float point : points)
    largest = std::max(largest, static_cast<double>(std::abs(point)));
  const double reached =
      std::min(std::max(bound.path.max, -bound.path.min) + kEvaluation * largest, largest);
  const double excess = reached - bound.max;
  if (!(excess <= kRoundingAllowance * bound.max)) {
    FailRounding(motion, fmt::format("rounding takes its {} {} {} beyond the limit of {} {}; move "
                                     "the knots apart",
                                     bound.name, MessageNumber(excess), bound.unit,
                                     MessageNumber(bound.max), bound.unit));
  }
  if (!(excess > 0)) return static_cast<float>(bound.max);
  return std::nextafter(static_cast<float>(reached), std::numeric_limits<float>::max());
}

Feedback<float> Rounded(const Primitive<double>& primitive) {
  const Feedback<double>& feedback = primitive.feedback;
  Feedback<float> result;
  if (!feedback.present()) return result;
  const std::string part = "the feedback";
  result.link = feedback.link;
  result.knot_count = feedback.knot_count;
  result.angle = Rounded(part, feedback.angle, "angle");
  result.error_min_rad = Rounded(feedback.error_min_rad);
  result.error_full_rad = Rounded(feedback.error_full_rad);
  result.error_max_rad = Rounded(feedback.error_max_rad);
  result.start_error_max_rad = Rounded(feedback.start_error_max_rad);
  result.fade_in_s = Rounded(feedback.fade_in_s);
  result.fade_out_s = Rounded(feedback.fade_out_s);
  bool keeps = result.error_max_rad > 0 && result.start_error_max_rad > 0 && result.fade_in_s > 0 &&
               result.fade_out_s > 0;
  for (std::size_t i = 0; i < feedback.knots().size(); ++i) {
    result.knots_s[i] = Rounded(feedback.knots_s[i]);
    if (i > 0 && !(result.knots_s[i] > result.knots_s[i - 1])) {
      FailPart(part, fmt::format("knots {} and {} of its gains round to the same time", i - 1, i));
    }
  }
  for (std::size_t j = 0; j < primitive.motions().size(); ++j) {
    const JointFeedback<double>& joint = feedback.joints[j];
    JointFeedback<float>& rounded = result.joints[j];
    rounded.chain = Rounded(joint.chain);
    std::ranges::transform(joint.angle_gain, rounded.angle_gain.begin(),
                           [](double x) { return Rounded(x); });
    std::ranges::transform(joint.rate_gain, rounded.rate_gain.begin(),
                           [](double x) { return Rounded(x); });
    rounded.correction_max_rad = Rounded(joint.correction_max_rad);
    rounded.correction_rate_max_rad_s = Rounded(joint.correction_rate_max_rad_s);
    keeps = keeps && rounded.correction_rate_max_rad_s > 0;
  }
  if (!keeps) FailPart(part, "a limit or a fading time rounds to zero");
  return result;
}

AbortTable<float> RoundedAborts(const Primitive<double>& primitive) {
  AbortTable<float> result;
  float from_s = 0;
  for (const AbortSpan<double>& span : primitive.aborts.spans()) {
    AbortSpan<float>& rounded = result.span_storage[static_cast<std::size_t>(result.span_count++)];
    rounded.until_s = Rounded(span.until_s);
    rounded.way = span.way;
    rounded.late_max_s = Rounded(span.late_max_s);
    rounded.limits_share = Rounded(span.limits_share);
    std::ranges::transform(span.position_rad, rounded.position_rad.begin(),
                           [](double x) { return Rounded(x); });
    if (!(rounded.until_s > from_s)) {
      FailPart("the table of aborts",
               fmt::format("span {} rounds to no time", result.span_count - 1));
    }
    if (span.way == AbortWay::kFold && !(rounded.limits_share > 0))
      FailPart("the table of aborts", "a share of the limits rounds to zero");
    from_s = rounded.until_s;
  }
  return result;
}

}  // namespace

Primitive<float> ToRuntime(const Primitive<double>& primitive) {
  Primitive<float> result;
  result.name = primitive.name;
  result.duration_s = Rounded(primitive.duration_s);
  result.settle_s = Rounded(primitive.settle_s);
  result.entry_tolerance_rad = Rounded(primitive.entry_tolerance_rad);
  result.following_tolerance_rad = Rounded(primitive.following_tolerance_rad);
  for (const float value :
       {result.duration_s, result.entry_tolerance_rad, result.following_tolerance_rad}) {
    if (!(value > 0) || !std::isfinite(value)) {
      throw std::invalid_argument(
          "duration or a tolerance of the primitive does not fit single precision");
    }
  }
  if (!std::isfinite(result.settle_s)) {
    throw std::invalid_argument("settle time of the primitive does not fit single precision");
  }
  result.joint_count = primitive.joint_count;
  for (std::size_t i = 0; i < primitive.motions().size(); ++i) {
    const Motion& motion = primitive.joints[i];
    JointMotion<float>& rounded = result.joints[i];
    rounded.name = motion.name;
    rounded.position = Rounded(PartOf(motion), motion.position, "position");
    rounded.torque = Rounded(PartOf(motion), motion.torque, "torque");
    rounded.limits = {RoundedLimit(motion.limits.position_min_rad),
                      RoundedLimit(motion.limits.position_max_rad),
                      RoundedLimit(motion.limits.velocity_max_rad_s),
                      RoundedLimit(motion.limits.acceleration_max_rad_s2),
                      RoundedLimit(motion.limits.torque_max_nm)};
    const auto bounds = BoundsOf(rounded, rounded.limits);
    rounded.limits.velocity_max_rad_s =
        Widened(motion, bounds[1], rounded.position.control_points(1));
    rounded.limits.acceleration_max_rad_s2 =
        Widened(motion, bounds[2], rounded.position.control_points(2));
    for (const Bound& bound : {bounds[0], bounds[3]}) {
      if (bound.Holds()) continue;
      FailRounding(motion, "its " + ToText(bound));
    }
  }
  result.feedback = Rounded(primitive);
  result.aborts = RoundedAborts(primitive);
  return result;
}

}  // namespace tumbler
