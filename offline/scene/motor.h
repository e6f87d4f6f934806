#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "offline/model/contact_law.h"

namespace tumbler {

/// A torque of dry friction against the motion.
struct DryFriction {
  double torque_nm = 0;    ///< What a motor has to add, in the direction of motion.
  double by_velocity = 0;  ///< Its derivative [N m s/rad].
};

/// Of a joint whose task does not say what its motor loses.
inline constexpr double kUsualViscousFriction_nm_s_per_rad = 0.02;
/// Dry friction in a joint is full above this speed, and as smooth below it as that of contact, so
/// that a joint creeps rather than sticks, as feet do.
inline constexpr double kDryFrictionFullAbove_rad_s = 0.05;

/// The part of dry friction that acts against this velocity [rad/s]: -1 to 1. S is a double, or the
/// lanes of vectors.
template <class S>
[[gnu::always_inline]] inline S DryFrictionShare(const S& velocity) {
  return FrictionShare(velocity * S(1 / kDryFrictionFullAbove_rad_s));
}

/// The same for one robot, with its derivative.
/// @param full_nm  its full strength, >= 0.
inline DryFriction EvaluateDryFriction(double full_nm, double velocity_rad_s) {
  static const ContactLaw creep{.v_max_m_per_s = kDryFrictionFullAbove_rad_s};
  const double square = velocity_rad_s * velocity_rad_s;
  const FrictionGain friction = EvaluateFrictionGain(creep, square);
  return {full_nm * friction.gain * velocity_rad_s,
          full_nm * (friction.gain + 2 * square * friction.gain_s2)};
}

/// Friction and torque-speed curve of a joint's motor, at the joint, behind the gear. The default
/// is a motor that has neither.
///
/// A motor's torque is that of the joint and what friction takes. In the direction of motion it is
/// at most the joint's limit up to the base speed, and falls from there to zero at the no-load
/// speed, as the back electromotive force takes voltage away. Against the motion it keeps its
/// limit.
struct Motor {
  double viscous_friction_nm_s_per_rad = 0;
  double dry_friction_nm = 0;  ///< See EvaluateDryFriction.
  /// 0 < base speed < no-load speed; infinite, both: there is no curve.
  double base_speed_rad_s = std::numeric_limits<double>::infinity();
  double no_load_speed_rad_s = std::numeric_limits<double>::infinity();

  bool operator==(const Motor&) const = default;

  [[nodiscard]] bool has_curve() const { return std::isfinite(no_load_speed_rad_s); }

  /// The part of the limit that a motor with this torque lacks at this speed, 0 to 1.
  [[nodiscard]] double LackAt(double torque_nm, double velocity_rad_s) const {
    const double speed = std::abs(velocity_rad_s);
    if (!(torque_nm * velocity_rad_s > 0 && speed > base_speed_rad_s && has_curve())) return 0;
    return std::min(1.0, (speed - base_speed_rad_s) / (no_load_speed_rad_s - base_speed_rad_s));
  }

  /// Below the no-load speed, a torque is within the curve where the size of
  ///
  ///   curve_by_torque() torque / limit + curve_by_velocity() velocity
  ///
  /// is at most 1: both falling sides of the curve in one smooth expression.
  /// @pre It has a curve.
  [[nodiscard]] double curve_by_torque() const {
    return 1 - base_speed_rad_s / no_load_speed_rad_s;
  }
  [[nodiscard]] double curve_by_velocity() const { return 1 / no_load_speed_rad_s; }
};

}  // namespace tumbler
