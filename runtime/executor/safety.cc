#include "runtime/executor/safety.h"

namespace tumbler {
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

}  // namespace tumbler
