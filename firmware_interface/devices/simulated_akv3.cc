#include "firmware_interface/devices/simulated_akv3.h"

#include <algorithm>
#include <cmath>

#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/make_simulated.h"

namespace tumbler {

namespace {

/// A value in steps, truncated as firmware does, and saturated.
std::int16_t Steps(double value, double limit) {
  return static_cast<std::int16_t>(std::clamp(value, -limit, limit));
}

}  // namespace

SimulatedAkV3Drive::SimulatedAkV3Drive(const SimulatedAkV3Config& config)
    : SimulatedDrive(config, config.akv3.joint),
      config_(config),
      period_ns_(std::llround(config.akv3.status_s * 1e9)),
      due_ns_(config.phase_ns),
      law_(config.watchdog_s) {
  Require(config.akv3.Validate() == Status::kOk, "its protocol configuration is not valid");
  Require(config.watchdog_s >= 0 && config.watchdog_s <= 3600, "watchdog_s must be 0 ... 3600");
  Require(config.phase_ns >= 0, "phase_ns must be 0 or more");
}

SimulatedPortConfig SimulatedAkV3Drive::port_config() const noexcept {
  SimulatedPortConfig config;
  config.transmit_capacity = 3;
  config.restart_ns = 0;  // Firmware lets its controller recover from bus-off by itself.
  return config;
}

bool SimulatedAkV3Drive::enabled() const noexcept {
  const ImpedanceCommand& s = law_.setpoint();
  return error_ == 0 && (s.kp_nm_per_rad > 0 || s.kd_nm_s_per_rad > 0 || s.torque_nm != 0);
}

std::optional<double> SimulatedAkV3Drive::target_rad() const noexcept {
  const ImpedanceCommand& s = law_.setpoint();
  if (!enabled() || s.kp_nm_per_rad <= 0) return std::nullopt;
  return ToJoint(static_cast<double>(s.position_rad));
}

void SimulatedAkV3Drive::CheckWatchdog(std::int64_t time_ns) noexcept {
  if (enabled() && law_.Expires(time_ns)) CountExpiry();
}

CanFrame SimulatedAkV3Drive::Report() const noexcept {
  constexpr double kDegrees = 360 / kTwoPi;
  const AkV3Config& akv3 = config_.akv3;
  AkV3Status status;
  status.position = Steps(Measured(0) * kDegrees / 0.1, 32000);
  const double motor_rad_s = shaft().velocity_rad_s * static_cast<double>(akv3.gear_inside);
  status.speed = Steps(motor_rad_s * 60 / kTwoPi * akv3.pole_pairs / 10, 32000);
  if (akv3.torque_constant_nm_per_a > 0) {
    status.current =
        Steps(torque_nm() / static_cast<double>(akv3.torque_constant_nm_per_a) / 0.01, 6000);
  }
  status.temperature = static_cast<std::int8_t>(std::clamp(temperature_c(), -20.0, 127.0));
  status.error = error_;
  return EncodeAkV3Status(akv3, status);
}

void SimulatedAkV3Drive::Act(std::int64_t time_ns) noexcept {
  CheckWatchdog(time_ns);
  if (time_ns >= due_ns_) {
    while (due_ns_ <= time_ns) due_ns_ += period_ns_;
    Say(Report());
  }
}

double SimulatedAkV3Drive::Law(std::int64_t /*time_ns*/, const Shaft& shaft) const noexcept {
  return enabled() ? law_.Torque(shaft.Measured(0), shaft.velocity_rad_s) : 0;
}

void SimulatedAkV3Drive::OnFrame(const ReceivedFrame& received, SimulatedPort& /*port*/) noexcept {
  ImpedanceCommand command;
  if (DecodeAkV3Command(config_.akv3, received.frame, command) != Status::kOk) return;
  CheckWatchdog(received.time_ns);
  CountFrame();
  CountSetpoint(received.time_ns);
  law_.Take(command, received.time_ns, enabled());
}

OwnedDrive AkV3Protocol::Simulate(const DriveEntry& entry, const AkV3Config& akv3,
                                  const SimulatedMotorConfig& motor) {
  SimulatedAkV3Config config;
  static_cast<SimulatedMotorConfig&>(config) = motor;
  config.akv3 = akv3;
  config.watchdog_s = entry.watchdog_s;
  return {std::make_unique<SimulatedAkV3Drive>(config)};
}

}  // namespace tumbler
