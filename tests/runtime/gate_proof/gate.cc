// The last gate and its limits as functions of their own, for the compiler to make code of that can
// be looked at.

#include "runtime/executor/safety.cc"

#include "runtime/executor/safety.h"

namespace tumbler {

extern "C" void Gate(const SafetyLimits& limits, const JointSetpoint& planned,
                     const JointSetpoint& previous, int elapsed_ticks,
                     LimitedSetpoint& result) noexcept {
  result = LimitSetpoint(limits, planned, previous, elapsed_ticks);
}

extern "C" void Limits(const JointLimits<float>& joint, float period_s, float torque_rise_s,
                       SafetyLimits& result) noexcept {
  result = MakeSafetyLimits(joint, period_s, torque_rise_s);
}

}  // namespace tumbler
