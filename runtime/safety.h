#pragma once

#include <limits>

#include "common/primitive.h"
#include "common/realtime.h"

namespace tumbler {

/// Position, velocity and feed-forward torque of one joint at one tick.
struct JointSetpoint {
  float position_rad = 0;
  float velocity_rad_s = 0;
  float torque_nm = 0;

  bool operator==(const JointSetpoint&) const = default;
};

/// What the last gate enforces for one joint.
struct SafetyLimits {
  float position_min_rad = 0;
  float position_max_rad = 0;
  float velocity_max_rad_s = 0;  ///< of |velocity|
  float torque_max_nm = 0;       ///< of |feed-forward torque|
  float position_step_rad = 0;   ///< Largest change of the position in one tick.
  float torque_step_nm = 0;      ///< Largest change of the feed-forward torque in one tick.
};

/// The limits of a joint at a control rate. A position that obeys the velocity limit moves at most
/// v_max * period in a tick; 0.1 % is added because the difference of two rounded times is not
/// exactly one period.
/// @param torque_rise_s  time in which the feed-forward may go from zero to its largest value.
[[nodiscard]] SafetyLimits MakeSafetyLimits(const JointLimits<float>& joint, float period_s,
                                            float torque_rise_s) noexcept;

/// Outcome of the last gate.
struct LimitedSetpoint {
  JointSetpoint setpoint;
  bool changed = false;  ///< The plan was outside a limit.
  bool non_finite =
      false;  ///< The plan was not finite: the previous position is held and the torque fades.
};

/// The last gate before a frame: whatever `planned` is, the result is finite, within position,
/// velocity and torque limits, and at most `elapsed_ticks` steps from `previous`. Position limits
/// win over the step. Freestanding; never allocates.
/// @pre `previous` is a result of this function, or was measured inside the position limits.
[[nodiscard]] LimitedSetpoint LimitSetpoint(const SafetyLimits& limits,
                                            const JointSetpoint& planned,
                                            const JointSetpoint& previous,
                                            int elapsed_ticks) noexcept TUMBLER_NONBLOCKING;

/// False for NaN and infinities.
[[nodiscard]] constexpr bool IsFinite(float x) noexcept {
  return x >= std::numeric_limits<float>::lowest() && x <= std::numeric_limits<float>::max();
}

}  // namespace tumbler
