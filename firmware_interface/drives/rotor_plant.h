#pragma once

#include <cstdint>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/drives/simulated_drive.h"

namespace tumbler {

/// A rotor with viscous friction behind each of several simulated drives: inertia * qddot = torque
/// - damping * qdot. Nothing couples them and nothing touches the ground; semi-implicit Euler at
/// the drives' step.
class RotorPlant {
 public:
  struct Rotor {
    SimulatedDrive* drive = nullptr;
    double position_rad = 0;
    double velocity_rad_s = 0;
    double inertia_kg_m2 = 0.02;
    double damping_nm_s_per_rad = 0.02;
  };

  RotorPlant(SimulatedBus& bus, std::vector<Rotor> rotors, std::int64_t step_ns = 50'000);

  void AdvanceTo(std::int64_t time_ns) noexcept;
  [[nodiscard]] std::vector<Rotor>& rotors() noexcept { return rotors_; }

 private:
  SimulatedBus& bus_;
  std::vector<Rotor> rotors_;
  std::int64_t step_ns_;
  std::int64_t now_ns_ = 0;
};

}  // namespace tumbler
