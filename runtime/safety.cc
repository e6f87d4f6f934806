#include "runtime/safety.h"

namespace tumbler {
namespace {

/// Unlike std::clamp, at NaN the result is `low`.
constexpr float Clamp(float x, float low, float high) noexcept {
  const float y = x < high ? x : high;
  return y > low ? y : low;
}

}  // namespace

SafetyLimits MakeSafetyLimits(const JointLimits<float>& joint, float period_s,
                              float torque_rise_s) noexcept {
  constexpr float kRoundingShare = 1.001F;
  SafetyLimits limits;
  limits.position_min_rad = joint.position_min_rad;
  limits.position_max_rad = joint.position_max_rad;
  limits.velocity_max_rad_s = joint.velocity_max_rad_s;
  limits.torque_max_nm = joint.torque_max_nm;
  limits.position_step_rad = joint.velocity_max_rad_s * period_s * kRoundingShare;
  limits.torque_step_nm = joint.torque_max_nm * (period_s / torque_rise_s);
  return limits;
}

LimitedSetpoint LimitSetpoint(const SafetyLimits& limits, const JointSetpoint& planned,
                              const JointSetpoint& previous,
                              int elapsed_ticks) noexcept TUMBLER_NONBLOCKING {
  const auto ticks = static_cast<float>(elapsed_ticks);
  const float position_step = limits.position_step_rad * ticks;
  const float torque_step = limits.torque_step_nm * ticks;
  LimitedSetpoint result;
  JointSetpoint& limited = result.setpoint;
  limited.position_rad = Clamp(planned.position_rad, previous.position_rad - position_step,
                               previous.position_rad + position_step);
  limited.position_rad =
      Clamp(limited.position_rad, limits.position_min_rad, limits.position_max_rad);
  limited.velocity_rad_s =
      Clamp(planned.velocity_rad_s, -limits.velocity_max_rad_s, limits.velocity_max_rad_s);
  limited.torque_nm =
      Clamp(planned.torque_nm, previous.torque_nm - torque_step, previous.torque_nm + torque_step);
  limited.torque_nm = Clamp(limited.torque_nm, -limits.torque_max_nm, limits.torque_max_nm);
  result.changed = !(limited == planned);
  // Last, so that nothing above can let a value through: a clamp turns infinity into a
  // legal-looking number.
  if (!(IsFinite(planned.position_rad) && IsFinite(planned.velocity_rad_s) &&
        IsFinite(planned.torque_nm) && IsFinite(limited.position_rad) &&
        IsFinite(limited.velocity_rad_s) && IsFinite(limited.torque_nm))) {
    limited = {previous.position_rad, 0.0F,
               Clamp(0.0F, previous.torque_nm - torque_step, previous.torque_nm + torque_step)};
    result.non_finite = true;
  }
  return result;
}

}  // namespace tumbler
