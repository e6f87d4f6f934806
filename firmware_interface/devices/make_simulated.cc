#include "firmware_interface/devices/make_simulated.h"

namespace tumbler {

SimulatedMotorConfig MotorOf(const DriveEntry& entry) {
  SimulatedMotorConfig motor;
  motor.torque_factor = entry.motor.torque_factor;
  motor.torque_time_constant_s = entry.motor.torque_time_constant_s;
  motor.velocity_filter_s = entry.motor.velocity_filter_s;
  return motor;
}

std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry) {
  return MakeSimulatedDrive(entry, MotorOf(entry));
}

std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry,
                                                   const SimulatedMotorConfig& motor) {
  return DriveProtocols::With(entry.config, [&](auto protocol, const auto& config) {
    return decltype(protocol)::Simulate(entry, config, motor).drive;
  });
}

}  // namespace tumbler
