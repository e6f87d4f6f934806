#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/core/bspline.h"
#include "common/core/capacity.h"
#include "common/core/fixed_string.h"

namespace tumbler {

/// The most control points of one spline. A path of 1.2 s has about 12; the feed-forward may have
/// more.
inline constexpr int kMaxControlPoints = 64;

/// Limits of one joint. The motion was made within them, and no setpoint ever exceeds them.
template <typename Scalar>
struct JointLimits {
  Scalar position_min_rad = 0;
  Scalar position_max_rad = 0;
  Scalar velocity_max_rad_s = 0;       ///< Of |velocity|.
  Scalar acceleration_max_rad_s2 = 0;  ///< Of |acceleration|.
  Scalar torque_max_nm = 0;            ///< Of |torque|.
};

/// The motion of one actuated joint, as splines in the time [s] since the motion began.
template <typename Scalar>
struct JointMotion {
  using Spline = BSpline<Scalar, kMaxControlPoints>;

  /// The joint's name in the robot's URDF.
  FixedString<32> name;
  /// The joint's angle [rad], twice continuously differentiable.
  Spline position;
  /// Feed-forward [N m]: the torque that the plan expects of the motor.
  Spline torque;
  JointLimits<Scalar> limits;
};

/// The most knots of a feedback's gains.
inline constexpr int kMaxGainKnots = 16;

/// The part of one joint in a feedback.
template <typename Scalar>
struct JointFeedback {
  /// By how much the link's absolute angle grows with the joint's: +1, -1, or 0 where the joint is
  /// not between the root and the link.
  Scalar chain = 0;
  /// Gain on the error of the link's angle at each knot of the gains [rad/rad].
  std::array<Scalar, kMaxGainKnots> angle_gain{};
  /// Gain on the error of its rate, likewise [rad/(rad/s)].
  std::array<Scalar, kMaxGainKnots> rate_gain{};
  Scalar correction_max_rad = 0;         ///< Of |correction|.
  Scalar correction_rate_max_rad_s = 0;  ///< Of the change of the correction in time.
};

/// How the setpoints of a primitive answer an error of one link's absolute angle. The law is in
/// `common/core/feedback.h`.
template <typename Scalar>
struct Feedback {
  using Spline = BSpline<Scalar, kMaxControlPoints>;

  FixedString<32> link;  ///< The link's name in the robot's URDF.
  int knot_count = 0;    ///< Knots of the gains; 0: the primitive has no feedback.
  /// Times of the gains' knots [s], increasing, from 0 to the primitive's duration or
  /// later, which is in the hold after it. Between two
  /// knots a gain is a straight line.
  std::array<Scalar, kMaxGainKnots> knots_s{};
  /// The link's angle in the plan [rad], continuously differentiable: root pitch plus the joints of
  /// its chain. Its values differ from a measured angle by any number of whole turns.
  Spline angle;
  /// Where the error is smaller, nothing is corrected, and from the second on everything: not more
  /// than `error_max_rad`, and the first not more than the second.
  Scalar error_min_rad = 0, error_full_rad = 0;
  Scalar error_max_rad = 0;        ///< Where the error is larger, nothing is corrected.
  Scalar start_error_max_rad = 0;  ///< The same at the start: then not in the whole motion.
  Scalar fade_in_s = 0;            ///< The time in which the correction grows to its full share.
  Scalar fade_out_s = 0;  ///< The time in which it vanishes when the angle is not known any more.
  std::array<JointFeedback<Scalar>, kMaxJoints> joints;  ///< In the order of the primitive's.

  [[nodiscard]] bool present() const noexcept { return knot_count > 0; }
  /// The knots in use.
  [[nodiscard]] std::span<const Scalar> knots() const noexcept {
    return {knots_s.data(), static_cast<std::size_t>(knot_count)};
  }
};

/// The most spans in a primitive's table of aborts.
inline constexpr int kMaxAbortSpans = 8;

/// What the joints do when a motion cannot simply go on.
enum class AbortWay : std::uint8_t {
  kCatch,    ///< They brake at their acceleration limits, and are held where they come to rest.
  kFold,     ///< They go to a pose in which the robot lands softly, and are held there.
  kRollOut,  ///< The motion goes on to its end as planned, and is held there.
  kDamp,     ///< They only resist being moved, so that the robot sinks.
};
inline constexpr int kAbortWayCount = 4;

/// A part of a motion's time in which one way to abort it hurts the robot least.
template <typename Scalar>
struct AbortSpan {
  Scalar until_s =
      0;  ///< Its end; the span before ends where it begins, and the first begins at 0.
  AbortWay way = AbortWay::kCatch;
  /// Of kRollOut: a motion that is later than this is damped instead.
  Scalar late_max_s = 0;
  /// Of kFold: the share of the limits of velocity and acceleration that the way to the pose may
  /// use, above 0 and at most 1. What moves away from the pose, or too fast, brakes at the whole
  /// limit.
  Scalar limits_share = 0;
  /// Of kFold: the pose, within the limits of position.
  std::array<Scalar, kMaxJoints> position_rad{};
};

/// How a motion is aborted, by the time in it: found offline, by what becomes of the robot.
template <typename Scalar>
struct AbortTable {
  int span_count = 0;                                          ///< 0: nothing is known.
  std::array<AbortSpan<Scalar>, kMaxAbortSpans> span_storage;  ///< The last ends with the motion.

  [[nodiscard]] constexpr bool present() const noexcept { return span_count > 0; }
  [[nodiscard]] constexpr std::span<const AbortSpan<Scalar>> spans() const noexcept {
    return {span_storage.data(), static_cast<std::size_t>(span_count)};
  }
  /// The span of a time; beyond the ends the first or last. @pre present()
  [[nodiscard]] constexpr const AbortSpan<Scalar>& At(Scalar time_s) const noexcept {
    const AbortSpan<Scalar>* found = span_storage.data();
    for (int i = 1; i < span_count && time_s >= found->until_s; ++i) ++found;
    return *found;
  }
};

/// A motion primitive: one motion of the robot's actuated joints. The optimiser makes it, its file
/// stores it, and the executor plays it.
///
/// A primitive says how the joints move, and nothing else. Where the robot goes while they move,
/// what was proved about the motion and what it was made from is in the file
/// (`common/files/primitive_toml.h`). Which primitives follow each other, and in which of them two
/// legs exchange their roles, is in a sequence (`common/core/sequence.h`).
///
/// A motion need not start or end at rest: its joints have the velocities and accelerations that
/// their splines have there.
///
/// `Scalar` is double offline and in files, and float in the executor.
template <typename Scalar>
struct Primitive {
  FixedString<48> name;
  /// How long the motion takes. Every spline ends here.
  Scalar duration_s = 1;
  /// How long the last setpoint is held before the motion counts as finished.
  Scalar settle_s = 0;
  /// The motion starts only when |measured - first position| of every joint is at most this.
  Scalar entry_tolerance_rad = 0;
  /// While the motion runs, a joint whose |measured - setpoint| exceeds this is a fault.
  Scalar following_tolerance_rad = 0;
  /// How many of `joints` are in use, at least 1.
  int joint_count = 0;
  std::array<JointMotion<Scalar>, kMaxJoints> joints;
  /// How the joints answer what an inertial sensor measures, besides.
  Feedback<Scalar> feedback;
  /// What the joints do when the motion has to be aborted.
  AbortTable<Scalar> aborts;

  /// The joints in use.
  [[nodiscard]] std::span<const JointMotion<Scalar>> motions() const noexcept {
    return {joints.data(), static_cast<std::size_t>(joint_count)};
  }
};

}  // namespace tumbler
