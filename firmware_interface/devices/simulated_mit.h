#pragma once

#include <cstdint>
#include <optional>

#include "firmware_interface/devices/damiao_registers.h"
#include "firmware_interface/devices/mit.h"
#include "firmware_interface/devices/simulated_drive.h"
#include "firmware_interface/devices/simulated_impedance.h"

namespace tumbler {

/// Properties of a simulated MIT drive.
struct SimulatedMitConfig : SimulatedMotorConfig {
  MitConfig mit;
  std::uint8_t reply_size = 8;  ///< 6, 7 or 8; see mit.h.
  double watchdog_s = 0.025;    ///< >= 0, 0 is off. The default of bgkatz firmware.
};

/// The drive side of the MIT protocol, as bgkatz's firmware behaves.
///
/// - The drive answers every frame to it, magic ones included, with the state before the frame is
///   applied. It transmits in one-shot mode, with three mailboxes: a frame that meets an error is
///   lost, one that loses arbitration waits.
/// - The drive takes setpoints outside motor mode too, and acts on the last one when it enters
///   motor mode.
/// - In motor mode, torque = kp (p - q) + kd (v - qdot) + t, limited. After `watchdog_s` without a
///   setpoint gains and feed-forward become zero (the joint is limp) until the next setpoint. Time
///   outside motor mode does not count.
/// - kZero makes the present angle the encoder's zero, outside motor mode only.
/// - A Damiao drive answers requests for the registers that damiao_registers.h names.
/// - An error code stops the torque until RaiseError(0) clears it; no frame clears it.
class SimulatedMitDrive final : public SimulatedDrive {
 public:
  /// @throws std::invalid_argument  naming the value that is not allowed.
  explicit SimulatedMitDrive(const SimulatedMitConfig& config);

  static SimulatedPortConfig PortConfig() noexcept;

  void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept override;
  [[nodiscard]] bool Heeds(const CanFrame& frame) const noexcept override {
    return frame.id == config_.mit.command_id || frame.id == kDamiaoRegistersId;
  }

  [[nodiscard]] bool enabled() const noexcept override { return enabled_; }
  [[nodiscard]] std::optional<double> target_rad() const noexcept override;
  [[nodiscard]] bool limp() const noexcept override { return law_.expired(); }
  [[nodiscard]] bool softened() const noexcept override {
    return enabled_ && !law_.expired() && law_.softened();
  }
  /// The last setpoint, at the shaft.
  [[nodiscard]] const ImpedanceCommand& last_setpoint() const noexcept { return law_.setpoint(); }
  [[nodiscard]] const SimulatedMitConfig& config() const noexcept { return config_; }

  /// A reply carries only the low byte of the code.
  void RaiseError(std::uint32_t code) noexcept override {
    error_ = static_cast<std::uint8_t>(code);
  }

 private:
  [[nodiscard]] SimulatedPortConfig port_config() const noexcept override { return PortConfig(); }
  void Act(std::int64_t time_ns) noexcept override { CheckWatchdog(time_ns); }
  [[nodiscard]] double Law(std::int64_t time_ns, const Shaft& shaft) const noexcept override;
  void CheckWatchdog(std::int64_t time_ns) noexcept;
  void AnswerRegister(const CanFrame& frame, SimulatedPort& port) const noexcept;

  SimulatedMitConfig config_;
  SimulatedImpedance law_;
  bool enabled_ = false;
  std::uint8_t error_ = 0;
  double zero_rad_ = 0;  // true angle at which the encoder reads zero
};

}  // namespace tumbler
