#include "firmware_interface/devices/make_simulated.h"

namespace tumbler {

std::unique_ptr<SimulatedDrive> MakeSimulatedDrive(const DriveEntry& entry,
                                                   const SimulatedMotorConfig& motor) {
  return DriveProtocols::With(entry.config, [&](auto protocol, const auto& config) {
    return decltype(protocol)::Simulate(entry, config, motor).drive;
  });
}

}  // namespace tumbler
