#pragma once

#include <cstdint>
#include <optional>

#include "firmware_interface/drives/akv3.h"
#include "firmware_interface/drives/simulated_drive.h"

namespace tumbler {

/// Properties of a simulated AK drive with V3 firmware.
struct SimulatedAkV3Config : SimulatedMotorConfig {
  AkV3Config akv3;
  double watchdog_s = 0;  ///< >= 0, 0 is off: then the drive holds its last setpoint for ever.
  /// Phase of the drive's own clock against the host's.
  std::int64_t phase_ns = 550'000;
};

/// The drive side of the V3 protocol.
///
/// - The drive takes setpoints of 8 bytes at any time: torque = kp (p - q) + kd (v - qdot) + t,
///   limited. It has no mode to enter.
/// - By its own clock it reports, truncated to whole steps; positions stop at +-3200 degrees.
/// - After `watchdog_s` without a setpoint gains and torque become zero, until the next.
/// - An error stops the torque until RaiseError(0) clears it; no frame clears it.
///
/// What a real drive does after the host's silence is not known: docs/protocols/akv3.md.
class SimulatedAkV3Drive final : public SimulatedDrive {
 public:
  /// @throws std::invalid_argument  naming the value that is not allowed.
  explicit SimulatedAkV3Drive(const SimulatedAkV3Config& config);

  void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept override;

  /// Whether the last setpoint asks for any torque.
  [[nodiscard]] bool enabled() const noexcept override;
  [[nodiscard]] std::optional<double> target_rad() const noexcept override;
  [[nodiscard]] bool limp() const noexcept override { return expired_; }
  [[nodiscard]] bool softened() const noexcept override { return enabled() && softened_; }
  /// The last setpoint, at the shaft.
  [[nodiscard]] const AkV3Command& last_setpoint() const noexcept { return setpoint_; }

  /// A report carries only the low byte of the code.
  void RaiseError(std::uint32_t code) noexcept override {
    error_ = static_cast<std::uint8_t>(code);
  }

 private:
  [[nodiscard]] SimulatedPortConfig port_config() const noexcept override;
  double Law(std::int64_t time_ns) noexcept override;
  void CheckWatchdog(std::int64_t time_ns) noexcept;
  void NoteStiffness(float kp_nm_per_rad) noexcept;
  [[nodiscard]] CanFrame Report() const noexcept;

  SimulatedAkV3Config config_;
  std::int64_t period_ns_;
  std::int64_t due_ns_;  // time of the next report
  AkV3Command setpoint_;
  bool expired_ = false;
  bool softened_ = false;
  float stiffest_nm_per_rad_ = 0;  // since the torque came on, or the drive became stiffer
  std::uint8_t error_ = 0;
  std::int64_t fed_ns_ = 0;  // time of the last setpoint
};

}  // namespace tumbler
