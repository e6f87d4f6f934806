#include "firmware_interface/devices/simulated_cansimple.h"

#include <cmath>
#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/make_simulated.h"

namespace tumbler {

namespace {

constexpr std::uint8_t kSuccess = 0, kBusy = 1, kDisarmed = 3;

std::int64_t Nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

}  // namespace

SimulatedCanSimpleDrive::SimulatedCanSimpleDrive(const SimulatedCanSimpleConfig& config)
    : SimulatedDrive(config, config.can.joint), config_(config) {
  Require(config.can.Validate() == Status::kOk, "its protocol configuration is not valid");
  Require(config.watchdog_s >= 0 && config.watchdog_s <= 3600, "watchdog_s must be 0 ... 3600");
  Require(config.position_gain_per_s >= 0 && std::isfinite(config.position_gain_per_s),
          "position_gain_per_s must be 0 or more");
  Require(
      config.velocity_gain_nm_s_per_rad >= 0 && std::isfinite(config.velocity_gain_nm_s_per_rad),
      "velocity_gain_nm_s_per_rad must be 0 or more");
  for (const double period : {config.heartbeat_s, config.estimates_s, config.torques_s,
                              config.temperature_s, config.errors_s}) {
    Require(period == 0 || (period >= 0.0001 && period <= 3600),
            "periods must be 0 or 0.0001 ... 3600 s");
  }
  Require(config.phase_ns >= 0, "phase_ns must be 0 or more");
  const auto cyclic = [&](CanSimpleCommand command, double period_s) {
    return Cyclic{command, Nanoseconds(period_s), config.phase_ns};
  };
  cyclic_ = {cyclic(CanSimpleCommand::kGetEncoderEstimates, config.estimates_s),
             cyclic(CanSimpleCommand::kHeartbeat, config.heartbeat_s),
             cyclic(CanSimpleCommand::kGetTorques, config.torques_s),
             cyclic(CanSimpleCommand::kGetTemperature, config.temperature_s),
             cyclic(CanSimpleCommand::kGetError, config.errors_s)};
}

SimulatedPortConfig SimulatedCanSimpleDrive::port_config() const noexcept {
  SimulatedPortConfig config;
  config.transmit_capacity = 8;
  config.restart_ns = 0;  // Firmware lets its controller recover from bus-off by itself.
  return config;
}

std::optional<double> SimulatedCanSimpleDrive::target_rad() const noexcept {
  if (!closed_loop_ || mode_.control != kCanSimplePositionControl) return std::nullopt;
  return ToJoint(static_cast<double>(input_.position_rev) * kTwoPi);
}

void SimulatedCanSimpleDrive::RaiseError(std::uint32_t code) noexcept {
  error_ |= code;
  if (!closed_loop_) return;
  closed_loop_ = false;
  disarm_reason_ = code;
  procedure_result_ = kDisarmed;
}

void SimulatedCanSimpleDrive::CheckWatchdog(std::int64_t time_ns) noexcept {
  if (!closed_loop_ || config_.watchdog_s <= 0) return;
  if (static_cast<double>(time_ns - fed_ns_) <= config_.watchdog_s * 1e9) return;
  CountExpiry();
  RaiseError(kCanSimpleWatchdogExpired);
}

CanFrame SimulatedCanSimpleDrive::Message(CanSimpleCommand command) const noexcept {
  const std::uint8_t node = config_.can.node_id;
  switch (command) {
    case CanSimpleCommand::kHeartbeat: {
      CanSimpleHeartbeat heartbeat;
      heartbeat.error = error_;
      heartbeat.state = closed_loop_ ? kCanSimpleClosedLoop : kCanSimpleIdle;
      heartbeat.procedure_result = procedure_result_;
      return EncodeCanSimple(node, heartbeat);
    }
    case CanSimpleCommand::kGetTorques: {
      const auto torque = static_cast<float>(torque_nm());
      return EncodeCanSimple(node, CanSimpleTorques{torque, torque});
    }
    case CanSimpleCommand::kGetTemperature: {
      const auto temperature = static_cast<float>(temperature_c());
      return EncodeCanSimple(node, CanSimpleTemperature{temperature, temperature});
    }
    case CanSimpleCommand::kGetError:
      return EncodeCanSimple(node, CanSimpleErrors{error_, disarm_reason_});
    default:
      return EncodeCanSimple(
          node, CanSimpleEstimates{static_cast<float>(Measured(0) / kTwoPi),
                                   static_cast<float>(shaft().velocity_rad_s / kTwoPi)});
  }
}

std::int64_t SimulatedCanSimpleDrive::next_act_ns() const noexcept {
  std::int64_t next = kNever;
  for (const Cyclic& cyclic : cyclic_) {
    if (cyclic.period_ns != 0) next = std::min(next, cyclic.due_ns);
  }
  return next;
}

void SimulatedCanSimpleDrive::Act(std::int64_t time_ns) noexcept {
  CheckWatchdog(time_ns);
  for (Cyclic& cyclic : cyclic_) {
    if (cyclic.period_ns == 0 || time_ns < cyclic.due_ns) continue;
    while (cyclic.due_ns <= time_ns) cyclic.due_ns += cyclic.period_ns;
    Say(Message(cyclic.command));
  }
}

double SimulatedCanSimpleDrive::Law(std::int64_t /*time_ns*/, const Shaft& shaft) const noexcept {
  if (!closed_loop_) return 0;
  double velocity = static_cast<double>(input_.velocity_rev_s) * kTwoPi;
  if (mode_.control == kCanSimplePositionControl) {
    velocity += config_.position_gain_per_s *
                (static_cast<double>(input_.position_rev) * kTwoPi - shaft.Measured(0));
  }
  return config_.velocity_gain_nm_s_per_rad * (velocity - shaft.velocity_rad_s) +
         static_cast<double>(input_.torque_nm);
}

void SimulatedCanSimpleDrive::RequestState(std::uint32_t state, std::int64_t time_ns) noexcept {
  if (state != kCanSimpleClosedLoop) {
    closed_loop_ = false;
    procedure_result_ = kSuccess;
    return;
  }
  if (closed_loop_) ++restarts_;
  closed_loop_ = error_ == 0;
  procedure_result_ = closed_loop_ ? kBusy : kDisarmed;
  fed_ns_ = time_ns;
}

void SimulatedCanSimpleDrive::OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept {
  const CanFrame& frame = received.frame;
  const std::uint8_t node = config_.can.node_id;
  if (frame.extended || frame.id >> 5 != node) return;
  CheckWatchdog(received.time_ns);
  CountFrame();
  fed_ns_ = received.time_ns;  // As in the firmware, before looking at what the frame is.
  const auto command = static_cast<CanSimpleCommand>(frame.id & 0x1f);
  if (frame.remote) {
    for (const Cyclic& cyclic : cyclic_) {
      if (cyclic.command == command) Say(port, Message(command));
    }
    return;
  }
  CanSimpleAxisState state;
  CanSimpleInputPos input;
  CanSimpleInputVel velocity;
  if (DecodeCanSimple(node, frame, state) == Status::kOk) {
    RequestState(state.state, received.time_ns);
  } else if (DecodeCanSimple(node, frame, input) == Status::kOk) {
    CountSetpoint(received.time_ns);
    if (std::isfinite(input.position_rev)) input_ = input;
  } else if (DecodeCanSimple(node, frame, velocity) == Status::kOk) {
    CountSetpoint(received.time_ns);
    if (std::isfinite(velocity.velocity_rev_s) && std::isfinite(velocity.torque_nm)) {
      input_.velocity_rev_s = velocity.velocity_rev_s;
      input_.torque_nm = velocity.torque_nm;
    }
  } else if (DecodeCanSimple(node, frame, mode_) == Status::kOk) {
    return;
  } else if (command == CanSimpleCommand::kEstop) {
    RaiseError(kCanSimpleEstopRequested);
  } else if (command == CanSimpleCommand::kClearErrors) {
    error_ = disarm_reason_ = 0;
  }
}

OwnedDrive CanSimpleProtocol::Simulate(const DriveEntry& entry, const CanSimpleConfig& can,
                                       const SimulatedMotorConfig& motor) {
  SimulatedCanSimpleConfig config;
  static_cast<SimulatedMotorConfig&>(config) = motor;
  config.can = can;
  config.watchdog_s = entry.watchdog_s;
  config.velocity_gain_nm_s_per_rad = GainAtShaft(can.joint, entry.kd_nm_s_per_rad);
  config.position_gain_per_s =
      static_cast<double>(entry.kp_nm_per_rad) / static_cast<double>(entry.kd_nm_s_per_rad);
  config.heartbeat_s = can.messages.heartbeat_s;
  config.estimates_s = can.messages.estimates_s;
  config.torques_s = can.messages.torques_s;
  config.temperature_s = can.messages.temperature_s;
  return {std::make_unique<SimulatedCanSimpleDrive>(config)};
}

}  // namespace tumbler
