#pragma once

#include <cstdint>
#include <optional>

#include "firmware_interface/devices/akv3.h"
#include "firmware_interface/devices/simulated_drive.h"
#include "firmware_interface/devices/simulated_impedance.h"

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
  [[nodiscard]] bool Heeds(const CanFrame& frame) const noexcept override {
    ImpedanceCommand command;
    return DecodeAkV3Command(config_.akv3, frame, command) == Status::kOk;
  }

  /// Whether the last setpoint asks for any torque.
  [[nodiscard]] bool enabled() const noexcept override;
  [[nodiscard]] std::int64_t next_act_ns() const noexcept override { return due_ns_; }
  [[nodiscard]] std::optional<double> target_rad() const noexcept override;
  [[nodiscard]] bool limp() const noexcept override { return law_.expired(); }
  [[nodiscard]] bool softened() const noexcept override { return enabled() && law_.softened(); }
  /// The last setpoint, at the shaft.
  [[nodiscard]] const ImpedanceCommand& last_setpoint() const noexcept { return law_.setpoint(); }

  /// A report carries only the low byte of the code.
  void RaiseError(std::uint32_t code) noexcept override {
    error_ = static_cast<std::uint8_t>(code);
  }

 private:
  [[nodiscard]] SimulatedPortConfig port_config() const noexcept override;
  void Act(std::int64_t time_ns) noexcept override;
  [[nodiscard]] double Law(std::int64_t time_ns, const Shaft& shaft) const noexcept override;
  void CheckWatchdog(std::int64_t time_ns) noexcept;
  [[nodiscard]] CanFrame Report() const noexcept;

  SimulatedAkV3Config config_;
  std::int64_t period_ns_;
  std::int64_t due_ns_;  // time of the next report
  SimulatedImpedance law_;
  std::uint8_t error_ = 0;
};

}  // namespace tumbler
