#pragma once

#include "common/core/primitive.h"
#include "common/core/realtime.h"
#include "runtime/executor/numbers.h"

namespace tumbler {

/// Position, velocity and feed-forward torque of one joint at one tick.
struct JointSetpoint {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;

  bool operator==(const JointSetpoint&) const = default;
};

/// The limits that the last gate enforces for one joint.
struct SafetyLimits {
  float position_min_rad = 0;
  float position_max_rad = 0;
  float velocity_max_rad_s = 0;  ///< Of |velocity|.
  float torque_max_nm = 0;       ///< Of |feed-forward torque|.
  float position_step_rad = 0;   ///< Largest change of the position in one tick.
  float torque_step_nm = 0;      ///< Largest change of the feed-forward torque in one tick.
};

/// The limits of a joint at a control rate. A position that keeps the velocity limit moves by at
/// most v_max * period in a tick. 0.1 % is added, because the difference of two rounded times is
/// not exactly one period.
/// @param torque_rise_s  time in which the feed-forward may go from zero to its largest value.
[[nodiscard]] SafetyLimits MakeSafetyLimits(const JointLimits<float>& joint, float period_s,
                                            float torque_rise_s) noexcept;

/// Outcome of the last gate.
struct LimitedSetpoint {
  JointSetpoint setpoint;
  /// Whether the plan was outside a limit.
  bool changed = false;
  /// Whether the plan was not finite. The previous position is held then, and the torque fades.
  bool non_finite = false;
};

/// The last gate before a frame. Whatever `planned` is, the result is finite, at most
/// `elapsed_ticks` steps of position and torque from `previous`, and its velocity is within the
/// limit. Position and torque are within their limits if those of `previous` are; else they are no
/// farther outside, and go back inside step by step. Freestanding; never allocates. Proved for all
/// floats (docs/assurance.md).
/// @pre `limits` are MakeSafetyLimits' of what an executor plays, `previous` is finite, and
///      `elapsed_ticks` >= 1.
[[nodiscard]] inline LimitedSetpoint LimitSetpoint(const SafetyLimits& limits,
                                                   const JointSetpoint& planned,
                                                   const JointSetpoint& previous,
                                                   int elapsed_ticks) noexcept TUMBLER_NONBLOCKING {
  const auto ticks = static_cast<float>(elapsed_ticks);
  const float position_step = limits.position_step_rad * ticks;
  const float torque_step = limits.torque_step_nm * ticks;
  LimitedSetpoint result;
  JointSetpoint& limited = result.setpoint;
  // The steps come after the limits: where a limit has just become narrower, the setpoint goes
  // there step by step. From inside the limits no step leads out of them.
  limited.position_rad =
      ClampOrLow(planned.position_rad, limits.position_min_rad, limits.position_max_rad);
  limited.position_rad = ClampOrLow(limited.position_rad, previous.position_rad - position_step,
                                    previous.position_rad + position_step);
  limited.velocity_rad_s =
      ClampOrLow(planned.velocity_rad_s, -limits.velocity_max_rad_s, limits.velocity_max_rad_s);
  limited.torque_nm = ClampOrLow(planned.torque_nm, -limits.torque_max_nm, limits.torque_max_nm);
  limited.torque_nm = ClampOrLow(limited.torque_nm, previous.torque_nm - torque_step,
                                 previous.torque_nm + torque_step);
  result.changed = !(limited == planned);
  // This check comes last, so that nothing above can let a value through. It looks at the plan too,
  // because a clamp turns infinity into a legal-looking number.
  if (!AreFinite(planned.position_rad, planned.velocity_rad_s, planned.torque_nm,
                 limited.position_rad, limited.velocity_rad_s, limited.torque_nm)) {
    limited = {
        previous.position_rad, 0.0F,
        ClampOrLow(0.0F, previous.torque_nm - torque_step, previous.torque_nm + torque_step)};
    result.non_finite = true;
  }
  return result;
}

}  // namespace tumbler
