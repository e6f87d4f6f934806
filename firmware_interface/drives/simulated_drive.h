#pragma once

#include <cstdint>
#include <limits>

#include "firmware_interface/can/simulated_bus.h"
#include "firmware_interface/drives/mit.h"

namespace tumbler {

/// Properties of a simulated MIT drive. Quantities are at the drive's shaft, as in its data sheet.
struct SimulatedDriveConfig {
  MitConfig mit;
  std::uint8_t reply_size = 8;  ///< 6, 7 or 8; see mit.h.
  double watchdog_s = 0.025;    ///< >= 0, 0 is off. The default of bgkatz firmware.
  double torque_max_nm = 18;    ///< > 0: the current limit.
  /// Above this speed the supply voltage limits the torque in the direction of motion, linearly
  /// down to zero at `no_load_speed_rad_s`. Infinite: no such limit.
  double base_speed_rad_s = std::numeric_limits<double>::infinity();
  double no_load_speed_rad_s = std::numeric_limits<double>::infinity();
  double encoder_step_rad = 6.2831853071795864769 / 16384;  ///< >= 0: 14 bits a turn; 0 is exact.
  /// From the end of a frame to its answer being ready in the controller: an interrupt on a
  /// Cortex-M4. Long enough that the host's next frame, which waits behind the intermission, is not
  /// disturbed.
  std::int64_t turnaround_ns = 20'000;
};

/// The drive side of the MIT protocol, as bgkatz's firmware behaves.
///
/// - Every frame to it, magic ones included, is answered, with the state before the frame is
///   applied. It transmits in one-shot mode: attach it with `SimulatedDrive::PortConfig()`.
/// - Setpoints are taken also outside motor mode, and acted on as it enters motor mode.
/// - In motor mode, torque = kp (p - q) + kd (v - qdot) + t, limited. After `watchdog_s` without a
///   setpoint gains and feed-forward become zero (the joint is limp) until the next setpoint; time
///   outside motor mode does not count.
/// - kZero makes the present angle the encoder's zero, outside motor mode only.
/// - An error code, once set, stops the torque until it is cleared.
class SimulatedDrive final : public SimulatedNode {
 public:
  /// @throws std::invalid_argument  naming the value that is not allowed.
  explicit SimulatedDrive(const SimulatedDriveConfig& config);

  /// How such a drive's controller is set up: a queue of three mailboxes, no retransmission.
  static SimulatedPortConfig PortConfig() noexcept;

  void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept override;

  /// One turn of the drive's current loop: measures the joint, and returns the torque that acts on
  /// it [N m] until the next call. Times never decrease.
  double Step(std::int64_t time_ns, double joint_position_rad,
              double joint_velocity_rad_s) noexcept;

  [[nodiscard]] bool enabled() const noexcept { return enabled_; }
  [[nodiscard]] bool limp() const noexcept { return expired_; }  ///< the watchdog has expired
  [[nodiscard]] std::int64_t watchdog_expiries() const noexcept { return watchdog_expiries_; }
  [[nodiscard]] std::int64_t frames_received() const noexcept { return frames_received_; }
  [[nodiscard]] std::int64_t setpoints_received() const noexcept { return setpoints_received_; }
  [[nodiscard]] const MitCommand& last_setpoint() const noexcept {
    return setpoint_;
  }  ///< at the shaft
  [[nodiscard]] std::int64_t last_setpoint_ns() const noexcept { return last_setpoint_ns_; }
  [[nodiscard]] double torque_nm() const noexcept {
    return torque_nm_;
  }  ///< at the shaft, as applied
  [[nodiscard]] const SimulatedDriveConfig& config() const noexcept { return config_; }

  /// Faults. Silent: hears, acknowledges and obeys, but does not answer.
  void set_silent(bool silent) noexcept { silent_ = silent; }
  void set_error(std::uint8_t code) noexcept { error_ = code; }
  void set_temperature(double celsius) noexcept { temperature_c_ = celsius; }

 private:
  void CheckWatchdog(std::int64_t time_ns) noexcept;
  [[nodiscard]] double Limited(double torque_nm) const noexcept;
  [[nodiscard]] double measured_rad() const noexcept;  // what the encoder reads

  SimulatedDriveConfig config_;
  MitCommand setpoint_;
  bool enabled_ = false;
  bool expired_ = false;
  bool silent_ = false;
  std::uint8_t error_ = 0;
  double temperature_c_ = 25;
  double shaft_rad_ = 0;  // true angle
  double zero_rad_ = 0;   // true angle at which the encoder reads zero
  double velocity_rad_s_ = 0;
  double torque_nm_ = 0;
  std::int64_t fed_ns_ = 0;  // last setpoint, or start of motor mode
  std::int64_t last_setpoint_ns_ = 0;
  std::int64_t watchdog_expiries_ = 0;
  std::int64_t frames_received_ = 0;
  std::int64_t setpoints_received_ = 0;
};

}  // namespace tumbler
