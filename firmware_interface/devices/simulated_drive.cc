#include "firmware_interface/devices/simulated_drive.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "common/core/functions.h"

namespace tumbler {

void SimulatedDrive::Require(bool condition, const char* what) {
  if (!condition) throw std::invalid_argument(std::string("simulated drive: ") + what);
}

SimulatedDrive::SimulatedDrive(const SimulatedMotorConfig& motor, const JointMap& joint)
    : motor_(motor),
      ratio_(static_cast<double>(joint.direction) * static_cast<double>(joint.gear_ratio)),
      zero_offset_rad_(static_cast<double>(joint.zero_offset_rad)),
      temperature_c_(motor.ambient_c) {
  Require(motor.torque_max_nm > 0, "torque_max_nm must be above 0");
  Require(motor.base_speed_rad_s > 0, "base_speed_rad_s must be above 0");
  Require(motor.no_load_speed_rad_s > motor.base_speed_rad_s ||
              motor.no_load_speed_rad_s == std::numeric_limits<double>::infinity(),
          "no_load_speed_rad_s must be above base_speed_rad_s");
  Require(motor.encoder_step_rad >= 0 && std::isfinite(motor.encoder_step_rad),
          "encoder_step_rad must be 0 or more");
  Require(motor.turnaround_ns >= 0, "turnaround_ns must be 0 or more");
  Require(motor.torque_time_constant_s >= 0 && std::isfinite(motor.torque_time_constant_s),
          "torque_time_constant_s must be 0 or more");
  Require(motor.torque_factor > 0 && std::isfinite(motor.torque_factor),
          "torque_factor must be above 0");
  Require(motor.velocity_filter_s >= 0 && std::isfinite(motor.velocity_filter_s),
          "velocity_filter_s must be 0 or more");
  Require(std::isfinite(motor.ambient_c), "ambient_c must be finite");
  Require(motor.heating_k_per_nm2 >= 0 && std::isfinite(motor.heating_k_per_nm2),
          "heating_k_per_nm2 must be 0 or more");
  Require(motor.thermal_time_constant_s > 0, "thermal_time_constant_s must be above 0");
}

void SimulatedDrive::AttachTo(SimulatedBus& bus) { port_ = &bus.Attach(*this, port_config()); }

void SimulatedDrive::Say(SimulatedPort& port, const CanFrame& frame) const noexcept {
  if (!silent_) static_cast<void>(port.SendAfter(motor_.turnaround_ns, frame));
}

double SimulatedDrive::ToJoint(double shaft_angle_rad) const noexcept {
  return shaft_angle_rad / ratio_ + zero_offset_rad_;
}

Shaft SimulatedDrive::ShaftAt(std::int64_t time_ns, double joint_position_rad,
                              double joint_velocity_rad_s) const noexcept {
  Shaft shaft;
  shaft.angle_rad = ratio_ * (joint_position_rad - zero_offset_rad_);
  shaft.velocity_rad_s = shaft.true_velocity_rad_s = ratio_ * joint_velocity_rad_s;
  const double passed_s = static_cast<double>(time_ns - stepped_ns_) * 1e-9;
  if (motor_.velocity_filter_s <= 0 || stepped_ns_ < 0) return shaft;
  if (passed_s <= 0) {
    shaft.velocity_rad_s = shaft_.velocity_rad_s;
    return shaft;
  }
  // What the filter makes of a velocity that changes linearly since the last step.
  const double x = passed_s / motor_.velocity_filter_s, share = -portable::Expm1(-x);
  const double before = shaft_.true_velocity_rad_s;
  shaft.velocity_rad_s = shaft_.velocity_rad_s + share * (before - shaft_.velocity_rad_s) +
                         (1 - share / x) * (shaft.true_velocity_rad_s - before);
  return shaft;
}

double SimulatedDrive::LimitedLaw(std::int64_t time_ns, const Shaft& shaft) const noexcept {
  const double torque_nm = Law(time_ns, shaft);
  double limit = motor_.torque_max_nm;
  const double speed = std::abs(shaft.true_velocity_rad_s);
  // The back electromotive force takes voltage away only while the motor drives in the direction of
  // its motion.
  if (torque_nm * shaft.true_velocity_rad_s > 0 && speed > motor_.base_speed_rad_s &&
      std::isfinite(motor_.no_load_speed_rad_s)) {
    const double range = motor_.no_load_speed_rad_s - motor_.base_speed_rad_s;
    limit *= std::max(0.0, (motor_.no_load_speed_rad_s - speed) / range);
  }
  return std::clamp(torque_nm, -limit, limit);
}

double SimulatedDrive::Step(std::int64_t time_ns, double joint_position_rad,
                            double joint_velocity_rad_s) noexcept {
  shaft_ = ShaftAt(time_ns, joint_position_rad, joint_velocity_rad_s);
  shaft_.encoder_step_rad = motor_.encoder_step_rad;
  const double passed_s = stepped_ns_ < 0 ? 0.0 : static_cast<double>(time_ns - stepped_ns_) * 1e-9;
  stepped_ns_ = time_ns;
  if (std::isfinite(motor_.thermal_time_constant_s)) {
    const double end = motor_.ambient_c + motor_.heating_k_per_nm2 * torque_nm_ * torque_nm_;
    temperature_c_ +=
        (end - temperature_c_) * -portable::Expm1(-passed_s / motor_.thermal_time_constant_s);
  }
  Act(time_ns);
  wanted_nm_ = LimitedLaw(time_ns, shaft_);
  if (motor_.torque_time_constant_s > 0) {
    torque_nm_ +=
        (wanted_nm_ - torque_nm_) * -portable::Expm1(-passed_s / motor_.torque_time_constant_s);
  } else {
    torque_nm_ = wanted_nm_;
  }
  return ratio_ * torque_nm_ * motor_.torque_factor;
}

double SimulatedDrive::TorqueAt(std::int64_t time_ns, double joint_position_rad,
                                double joint_velocity_rad_s) const noexcept {
  Shaft exact = shaft_;
  exact.encoder_step_rad = 0;
  const double since =
      LimitedLaw(time_ns, ShaftAt(time_ns, joint_position_rad, joint_velocity_rad_s)) -
      LimitedLaw(stepped_ns_, exact);
  double torque_nm = torque_nm_ + since;
  if (motor_.torque_time_constant_s > 0) {
    const double passed_s = static_cast<double>(time_ns - stepped_ns_) * 1e-9;
    torque_nm = torque_nm_ + (wanted_nm_ + since - torque_nm_) *
                                 -portable::Expm1(-passed_s / motor_.torque_time_constant_s);
  }
  return ratio_ * torque_nm * motor_.torque_factor;
}

}  // namespace tumbler
