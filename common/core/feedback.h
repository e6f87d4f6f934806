#pragma once

#include <algorithm>
#include <cstddef>

#include "common/core/index.h"
#include "common/core/primitive.h"

namespace tumbler {

/// The law of a primitive's feedback. Let a be the absolute angle of the feedback's link, a root
/// pitch plus the joints of its chain, and a* the plan's at the same time in the primitive. Then
///
///   e = a - a*, less whole turns;   e' = da/dt - speed da*/dt                     (1)
///   w_j = share z(|e|) clamp(K_j(t) e + D_j(t) e', -m_j, m_j)                     (2)
///   c_j goes towards w_j, by at most r_j in a second                              (3)
///
/// and c_j is added to the position setpoint of joint j, ahead of the last gate. K and D are the
/// gains, m and r the limits of the correction. z is a dead zone with a ramp: 0 to `error_min_rad`,
/// 1 from `error_full_rad` on, a straight line in between. A robot that stands on a flat foot needs
/// no correction until the foot tips, and a law that catches it then may well shake it before. The
/// share is 0 when a run begins, grows to 1 in
/// `fade_in_s` while the angle is known, and falls to 0 in `fade_out_s` while it is not; e and e'
/// then stay what they were. After the end of the primitive the plan's angle is the last one, at
/// rest; t goes on, and the gains stay the last ones after their last knot.
///
/// Only positions are corrected: of position, velocity, torque and gains, they are all that every
/// drive protocol carries and every drive follows. A drive turns the correction into torque by its
/// own stiffness.
///
/// Freestanding; the results are bit-identical on every machine that rounds each operation once.

/// A place between two knots of the gains.
template <typename Scalar>
struct GainPlace {
  int knot = 0;      ///< The knot before it.
  Scalar share = 0;  ///< 0 at that knot, 1 at the next.
};

/// The place of a time, which is clamped to the knots; NaN counts as the first.
/// @param guess  a knot with which the search begins. The result does not depend on it.
/// @pre the feedback is present, with at least two knots.
template <typename Scalar>
[[nodiscard]] GainPlace<Scalar> FindGains(const Feedback<Scalar>& feedback, Scalar time_s,
                                          int guess) noexcept {
  const Scalar* const knots = feedback.knots_s.data();
  const int last = feedback.knot_count - 1;
  int knot = guess >= 0 && guess < last ? guess : 0;
  if (!(time_s >= knots[knot])) knot = 0;
  while (knot + 1 < last && time_s >= knots[knot + 1]) ++knot;
  const Scalar from = knots[knot];
  const Scalar to = knots[knot + 1];
  const Scalar time = time_s > from ? (time_s < to ? time_s : to) : from;
  return {knot, (time - from) / (to - from)};
}

/// A gain there.
template <typename Scalar>
[[nodiscard]] Scalar GainAt(const std::array<Scalar, kMaxGainKnots>& gain,
                            const GainPlace<Scalar>& place) noexcept {
  const Scalar before = gain[Index(place.knot)];
  return before + place.share * (gain[Index(place.knot + 1)] - before);
}

/// An angle of less than 100 turns, less whole turns: within -pi ... pi, but for rounding.
template <typename Scalar>
[[nodiscard]] Scalar WithoutTurns(Scalar angle_rad) noexcept {
  constexpr auto kPi = static_cast<Scalar>(3.14159265358979323846);
  constexpr auto kTurn = static_cast<Scalar>(6.28318530717958647693);
  if (angle_rad >= -kPi && angle_rad <= kPi) return angle_rad;
  for (int i = 0; i < 100 && angle_rad > kPi; ++i) angle_rad -= kTurn;
  for (int i = 0; i < 100 && angle_rad < -kPi; ++i) angle_rad += kTurn;
  return angle_rad;
}

/// The number x, limited to -most ... most. @pre most >= 0
template <typename Scalar>
[[nodiscard]] Scalar Limited(Scalar x, Scalar most) noexcept {
  const Scalar below = x < most ? x : most;
  return below > -most ? below : -most;
}

/// The share (2) of the feedback after a time, from what it was before: it fades in while the error
/// is known, and else out.
template <typename Scalar>
[[nodiscard]] Scalar NextShare(const Feedback<Scalar>& feedback, Scalar before, bool known,
                               Scalar time_s) noexcept {
  return known ? std::min(Scalar{1}, before + time_s / feedback.fade_in_s)
               : std::max(Scalar{0}, before - time_s / feedback.fade_out_s);
}

/// How much of the correction an error asks for, from 0 to 1: z of (2).
template <typename Scalar>
[[nodiscard]] Scalar ErrorShare(const Feedback<Scalar>& feedback, Scalar error_rad) noexcept {
  const Scalar size = error_rad < 0 ? -error_rad : error_rad;
  if (size >= feedback.error_full_rad) return 1;
  if (size <= feedback.error_min_rad) return 0;
  return (size - feedback.error_min_rad) / (feedback.error_full_rad - feedback.error_min_rad);
}

/// The correction (2) that a joint is to have.
/// @param share  of the whole feedback, times ErrorShare.
template <typename Scalar>
[[nodiscard]] Scalar WantedCorrection(const JointFeedback<Scalar>& joint,
                                      const GainPlace<Scalar>& place, Scalar error_rad,
                                      Scalar rate_error_rad_s, Scalar share) noexcept {
  const Scalar sum = GainAt(joint.angle_gain, place) * error_rad +
                     GainAt(joint.rate_gain, place) * rate_error_rad_s;
  return share * Limited(sum, joint.correction_max_rad);
}

/// The correction (3) after a time, from what it was before.
template <typename Scalar>
[[nodiscard]] Scalar NextCorrection(Scalar before_rad, Scalar wanted_rad, Scalar rate_max_rad_s,
                                    Scalar time_s) noexcept {
  return before_rad + Limited(wanted_rad - before_rad, rate_max_rad_s * time_s);
}

}  // namespace tumbler
