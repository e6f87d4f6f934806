#pragma once

#include <cstdint>
#include <vector>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/devices/simulated_drive.h"

namespace tumbler {

/// Rotors with friction, each turned by a simulated drive: inertia * qddot = torque - damping *
/// qdot
/// - friction * sign(qdot), in joint coordinates, where dry friction holds what rests. Nothing
/// couples the rotors. They are integrated by semi-implicit Euler with the drives' step.
class RotorPlant {
 public:
  struct Rotor {
    SimulatedDrive* drive = nullptr;
    double position_rad = 0;
    double velocity_rad_s = 0;
    double inertia_kg_m2 = 0.02;
    double damping_nm_s_per_rad = 0.02;
    double friction_nm = 0;  ///< >= 0: dry friction.
  };

  RotorPlant(SimulatedBus& bus, std::vector<Rotor> rotors, std::int64_t step_ns = 50'000);

  /// Moves bus, drives and rotors on to this time.
  void AdvanceTo(std::int64_t time_ns) noexcept;
  [[nodiscard]] std::vector<Rotor>& rotors() noexcept { return rotors_; }

 private:
  SimulatedBus& bus_;
  std::vector<Rotor> rotors_;
  std::int64_t step_ns_;
  std::int64_t now_ns_ = 0;
};

}  // namespace tumbler
