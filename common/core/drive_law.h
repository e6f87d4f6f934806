#pragma once

namespace tumbler {

/// The law of drives with a stiffness and a damping, such as MIT's: the torque that they ask for,
/// before the motor's limits. S is a double, or the lanes of vectors; always inline, so that
/// sources that are compiled for other vectors do not share a copy.
/// @param position_error, velocity_error  setpoint less measurement.
template <class S>
[[gnu::always_inline]] inline S ImpedanceTorque(const S& kp, const S& position_error, const S& kd,
                                                const S& velocity_error, const S& feed_forward) {
  return kp * position_error + kd * velocity_error + feed_forward;
}

}  // namespace tumbler
