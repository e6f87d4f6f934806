#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware_interface/devices/cansimple.h"
#include "firmware_interface/devices/simulated_drive.h"

namespace tumbler {

/// Properties of a simulated ODrive.
struct SimulatedCanSimpleConfig : SimulatedMotorConfig {
  CanSimpleConfig can;
  double watchdog_s = 0;  ///< >= 0; 0 is off, which is the factory's setting.
  /// Gains of the drive's cascade, at the shaft: velocity = position_gain (input - q) +
  /// feed-forward, torque = velocity_gain (velocity - qdot) + feed-forward. No integrators.
  double position_gain_per_s = 50;
  double velocity_gain_nm_s_per_rad = 4;
  /// Periods of the messages that the drive sends by itself; 0: never.
  double heartbeat_s = 0.1;
  double estimates_s = 0.001;
  double torques_s = 0;
  double temperature_s = 0.1;
  double errors_s = 0;
  /// Phase of the drive's own clock against the host's.
  std::int64_t phase_ns = 550'000;
};

/// The drive side of CANSimple, as far as a host in closed-loop control sees it.
///
/// - Any frame with the drive's number feeds the watchdog, even a remote frame or an unknown
///   command. The watchdog runs in closed-loop control only. When it expires, the drive disarms and
///   latches an error.
/// - While an error is latched (Estop is one), the drive refuses closed-loop control, until
///   Clear_Errors.
/// - The drive takes inputs and modes in any state, and acts on them when closed-loop control
///   begins. When asked for a state that it is in already, it leaves the state for a moment
///   (`restarts`).
/// - The drive answers a remote frame with the message asked for.
class SimulatedCanSimpleDrive final : public SimulatedDrive {
 public:
  /// @throws std::invalid_argument  naming the value that is not allowed.
  explicit SimulatedCanSimpleDrive(const SimulatedCanSimpleConfig& config);

  void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept override;
  [[nodiscard]] bool Heeds(const CanFrame& frame) const noexcept override {
    return !frame.extended && frame.id >> 5 == config_.can.node_id;
  }

  [[nodiscard]] bool enabled() const noexcept override { return closed_loop_; }
  [[nodiscard]] std::int64_t next_act_ns() const noexcept override;
  [[nodiscard]] bool limp() const noexcept override {
    return (error_ & kCanSimpleWatchdogExpired) != 0;
  }
  [[nodiscard]] std::optional<double> target_rad() const noexcept override;
  /// Raises an error, which disarms the drive.
  void RaiseError(std::uint32_t code) noexcept override;

  [[nodiscard]] const CanSimpleInputPos& last_input() const noexcept { return input_; }
  [[nodiscard]] std::uint32_t error() const noexcept { return error_; }
  [[nodiscard]] int restarts() const noexcept { return restarts_; }
  [[nodiscard]] const SimulatedCanSimpleConfig& config() const noexcept { return config_; }

 private:
  [[nodiscard]] SimulatedPortConfig port_config() const noexcept override;
  void Act(std::int64_t time_ns) noexcept override;
  [[nodiscard]] double Law(std::int64_t time_ns, const Shaft& shaft) const noexcept override;
  void CheckWatchdog(std::int64_t time_ns) noexcept;
  void RequestState(std::uint32_t state, std::int64_t time_ns) noexcept;
  [[nodiscard]] CanFrame Message(CanSimpleCommand command) const noexcept;

  struct Cyclic {
    CanSimpleCommand command;
    std::int64_t period_ns;
    std::int64_t due_ns;
  };

  SimulatedCanSimpleConfig config_;
  std::array<Cyclic, 5> cyclic_;
  CanSimpleControllerMode mode_;
  CanSimpleInputPos input_;
  bool closed_loop_ = false;
  std::uint32_t error_ = 0;
  std::uint32_t disarm_reason_ = 0;
  std::uint8_t procedure_result_ = 0;
  std::int64_t fed_ns_ = 0;
  int restarts_ = 0;
};

}  // namespace tumbler
