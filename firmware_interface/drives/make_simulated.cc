#include "firmware_interface/drives/make_simulated.h"

#include "firmware_interface/drives/simulated_mit.h"

namespace tumbler {

std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry,
                                                   const SimulatedMotorConfig& motor) {
  SimulatedMitConfig config;
  static_cast<SimulatedMotorConfig&>(config) = motor;
  config.mit = std::get<MitConfig>(entry.config);
  config.watchdog_s = entry.watchdog_s;
  return std::make_unique<SimulatedMitDrive>(config);
}

}  // namespace tumbler
