#include "firmware_interface/devices/rotor_plant.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tumbler {

RotorPlant::RotorPlant(SimulatedBus& bus, std::vector<Rotor> rotors, std::int64_t step_ns)
    : bus_(bus), rotors_(std::move(rotors)), step_ns_(step_ns) {}

void RotorPlant::AdvanceTo(std::int64_t time_ns) noexcept {
  while (now_ns_ + step_ns_ <= time_ns) {
    now_ns_ += step_ns_;
    bus_.AdvanceTo(now_ns_);
    const double step_s = static_cast<double>(step_ns_) * 1e-9;
    for (Rotor& rotor : rotors_) {
      const double torque = rotor.drive->Step(now_ns_, rotor.position_rad, rotor.velocity_rad_s);
      const double acceleration =
          (torque - rotor.damping_nm_s_per_rad * rotor.velocity_rad_s) / rotor.inertia_kg_m2;
      rotor.velocity_rad_s += step_s * acceleration;
      const double braked_rad_s = step_s * rotor.friction_nm / rotor.inertia_kg_m2;
      rotor.velocity_rad_s = std::copysign(
          std::max(std::abs(rotor.velocity_rad_s) - braked_rad_s, 0.0), rotor.velocity_rad_s);
      rotor.position_rad += step_s * rotor.velocity_rad_s;
    }
  }
  bus_.AdvanceTo(time_ns);
}

}  // namespace tumbler
