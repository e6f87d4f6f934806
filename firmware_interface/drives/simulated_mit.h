#pragma once

#include <cstdint>
#include <optional>

#include "firmware_interface/drives/mit.h"
#include "firmware_interface/drives/simulated_drive.h"

namespace tumbler {

/// Properties of a simulated MIT drive.
struct SimulatedMitConfig : SimulatedMotorConfig {
  MitConfig mit;
  std::uint8_t reply_size = 8;  ///< 6, 7 or 8; see mit.h.
  double watchdog_s = 0.025;    ///< >= 0, 0 is off. The default of bgkatz firmware.
};

/// The drive side of the MIT protocol, as bgkatz's firmware behaves.
///
/// - Every frame to it, magic ones included, is answered, with the state before the frame is
///   applied. It transmits in one-shot mode, with three mailboxes.
/// - Setpoints are taken also outside motor mode, and acted on as it enters motor mode.
/// - In motor mode, torque = kp (p - q) + kd (v - qdot) + t, limited. After `watchdog_s` without a
///   setpoint gains and feed-forward become zero (the joint is limp) until the next setpoint; time
///   outside motor mode does not count.
/// - kZero makes the present angle the encoder's zero, outside motor mode only.
/// - An error code, once raised, stops the torque until it is cleared by RaiseError(0): no frame
///   does.
class SimulatedMitDrive final : public SimulatedDrive {
 public:
  /// @throws std::invalid_argument  naming the value that is not allowed.
  explicit SimulatedMitDrive(const SimulatedMitConfig& config);

  static SimulatedPortConfig PortConfig() noexcept;

  void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept override;

  [[nodiscard]] bool enabled() const noexcept override { return enabled_; }
  [[nodiscard]] std::optional<double> target_rad() const noexcept override;
  [[nodiscard]] bool limp() const noexcept override { return expired_; }
  [[nodiscard]] const MitCommand& last_setpoint() const noexcept {
    return setpoint_;
  }  ///< at the shaft
  [[nodiscard]] const SimulatedMitConfig& config() const noexcept { return config_; }

  /// Only the low byte of the code fits a reply.
  void RaiseError(std::uint32_t code) noexcept override {
    error_ = static_cast<std::uint8_t>(code);
  }

 private:
  [[nodiscard]] SimulatedPortConfig port_config() const noexcept override { return PortConfig(); }
  double Law(std::int64_t time_ns) noexcept override;
  void CheckWatchdog(std::int64_t time_ns) noexcept;

  SimulatedMitConfig config_;
  MitCommand setpoint_;
  bool enabled_ = false;
  bool expired_ = false;
  std::uint8_t error_ = 0;
  double zero_rad_ = 0;      // true angle at which the encoder reads zero
  std::int64_t fed_ns_ = 0;  // last setpoint, or start of motor mode
};

}  // namespace tumbler
