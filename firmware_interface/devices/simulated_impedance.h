#pragma once

#include <cstdint>

#include "firmware_interface/devices/impedance.h"

namespace tumbler {

/// The law of a simulated drive whose setpoints carry gains, and its watchdog: after the host's
/// silence gains and feed-forward are zero (the joint is limp) until the next setpoint.
class SimulatedImpedance {
 public:
  /// @param watchdog_s  >= 0; 0: the drive holds its last setpoint for ever.
  explicit SimulatedImpedance(double watchdog_s) noexcept : watchdog_s_(watchdog_s) {}

  /// Takes a setpoint. @param driven  whether the torque was on.
  void Take(const ImpedanceCommand& setpoint, std::int64_t time_ns, bool driven) noexcept;
  /// Lets the watchdog's time begin.
  void Feed(std::int64_t time_ns) noexcept { fed_ns_ = time_ns; }
  /// Looks at the watchdog of a drive whose torque is on. @returns whether it expires now.
  bool Expires(std::int64_t time_ns) noexcept;

  /// The torque at the shaft for what the drive measures.
  [[nodiscard]] double Torque(double measured_rad, double velocity_rad_s) const noexcept;

  /// The last setpoint, without gains and torque after the host's silence.
  [[nodiscard]] const ImpedanceCommand& setpoint() const noexcept { return setpoint_; }
  /// Whether the host's silence has taken the torque away.
  [[nodiscard]] bool expired() const noexcept { return expired_; }
  /// Whether the host takes the stiffness away little by little, or has done so.
  [[nodiscard]] bool softened() const noexcept { return softened_; }

 private:
  double watchdog_s_;
  ImpedanceCommand setpoint_;
  bool expired_ = false;
  bool softened_ = false;
  float stiffest_nm_per_rad_ = 0;  // since the torque came on, or the drive became stiffer
  std::int64_t fed_ns_ = 0;        // when the watchdog's time began
};

}  // namespace tumbler
