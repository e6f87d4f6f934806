#include "firmware_interface/drives/make_simulated.h"

#include "firmware_interface/drives/simulated_cansimple.h"
#include "firmware_interface/drives/simulated_cia402.h"
#include "firmware_interface/drives/simulated_mit.h"

namespace tumbler {

namespace {

/// A gain of the file, at the joint, as the drive has it at its shaft.
double ToShaft(const JointMap& joint, float gain) {
  return static_cast<double>(joint.ToDriveGain(gain));
}

}  // namespace

std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry,
                                                   const SimulatedMotorConfig& motor) {
  if (const auto* can = std::get_if<CanSimpleConfig>(&entry.config)) {
    SimulatedCanSimpleConfig config;
    static_cast<SimulatedMotorConfig&>(config) = motor;
    config.can = *can;
    config.watchdog_s = entry.watchdog_s;
    config.velocity_gain_nm_s_per_rad = ToShaft(can->joint, entry.kd_nm_s_per_rad);
    config.position_gain_per_s =
        static_cast<double>(entry.kp_nm_per_rad) / static_cast<double>(entry.kd_nm_s_per_rad);
    config.heartbeat_s = entry.messages.heartbeat_s;
    config.estimates_s = entry.messages.estimates_s;
    config.torques_s = entry.messages.torques_s;
    config.temperature_s = entry.messages.temperature_s;
    return std::make_unique<SimulatedCanSimpleDrive>(config);
  }
  if (const auto* cia402 = std::get_if<Cia402Config>(&entry.config)) {
    SimulatedCia402Config config;
    static_cast<SimulatedMotorConfig&>(config) = motor;
    config.node = *cia402;
    config.kp_nm_per_rad = ToShaft(cia402->joint, entry.kp_nm_per_rad);
    config.kd_nm_s_per_rad = ToShaft(cia402->joint, entry.kd_nm_s_per_rad);
    config.sync_timeout_s = entry.watchdog_s;
    return std::make_unique<SimulatedCia402Drive>(config);
  }
  SimulatedMitConfig config;
  static_cast<SimulatedMotorConfig&>(config) = motor;
  config.mit = std::get<MitConfig>(entry.config);
  config.watchdog_s = entry.watchdog_s;
  return std::make_unique<SimulatedMitDrive>(config);
}

}  // namespace tumbler
