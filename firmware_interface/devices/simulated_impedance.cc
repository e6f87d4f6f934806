#include "firmware_interface/devices/simulated_impedance.h"

#include "common/core/drive_law.h"

namespace tumbler {

void SimulatedImpedance::Take(const ImpedanceCommand& setpoint, std::int64_t time_ns,
                              bool driven) noexcept {
  constexpr float kLittle = 0.1F;  // of the largest stiffness
  const float before = setpoint_.kp_nm_per_rad;
  const float after = setpoint.kp_nm_per_rad;
  if (!driven || after > before) {
    softened_ = false;
    stiffest_nm_per_rad_ = after;
  } else if (after < before) {
    softened_ = before - after <= kLittle * stiffest_nm_per_rad_;
  }
  setpoint_ = setpoint;
  expired_ = false;
  Feed(time_ns);
}

bool SimulatedImpedance::Expires(std::int64_t time_ns) noexcept {
  if (expired_ || watchdog_s_ <= 0) return false;
  if (static_cast<double>(time_ns - fed_ns_) <= watchdog_s_ * 1e9) return false;
  expired_ = true;
  setpoint_.kp_nm_per_rad = 0;
  setpoint_.kd_nm_s_per_rad = 0;
  setpoint_.torque_nm = 0;
  return true;
}

double SimulatedImpedance::Torque(double measured_rad, double velocity_rad_s) const noexcept {
  const ImpedanceCommand& s = setpoint_;
  return ImpedanceTorque<double>(s.kp_nm_per_rad, s.position_rad - measured_rad, s.kd_nm_s_per_rad,
                                 s.velocity_rad_s - velocity_rad_s, s.torque_nm);
}

}  // namespace tumbler
