#include "firmware_interface/devices/simulated_mit.h"

#include <bit>
#include <cmath>

#include "firmware_interface/devices/damiao_registers.h"
#include "firmware_interface/devices/drive_entry.h"
#include "firmware_interface/devices/make_simulated.h"

namespace tumbler {

SimulatedMitDrive::SimulatedMitDrive(const SimulatedMitConfig& config)
    : SimulatedDrive(config, config.mit.joint), config_(config), law_(config.watchdog_s) {
  Require(config.mit.Validate() == Status::kOk, "its protocol configuration is not valid");
  Require(config.reply_size >= 6 && config.reply_size <= 8, "reply_size must be 6, 7 or 8");
  Require(config.watchdog_s >= 0 && config.watchdog_s <= 3600, "watchdog_s must be 0 ... 3600");
}

SimulatedPortConfig SimulatedMitDrive::PortConfig() noexcept {
  SimulatedPortConfig config;
  config.transmit_capacity = 3;
  config.restart_ns = 0;  // Firmware lets its controller recover from bus-off by itself.
  config.auto_retransmit = false;
  config.waits_for_bus = true;
  return config;
}

std::optional<double> SimulatedMitDrive::target_rad() const noexcept {
  const ImpedanceCommand& setpoint = law_.setpoint();
  if (!enabled_ || error_ != 0 || setpoint.kp_nm_per_rad <= 0) return std::nullopt;
  return ToJoint(static_cast<double>(setpoint.position_rad) + zero_rad_);
}

void SimulatedMitDrive::CheckWatchdog(std::int64_t time_ns) noexcept {
  if (enabled_ && law_.Expires(time_ns)) CountExpiry();
}

double SimulatedMitDrive::Law(std::int64_t /*time_ns*/, const Shaft& shaft) const noexcept {
  if (!enabled_ || error_ != 0) return 0;
  return law_.Torque(shaft.Measured(zero_rad_), shaft.velocity_rad_s);
}

void SimulatedMitDrive::AnswerRegister(const CanFrame& frame, SimulatedPort& port) const noexcept {
  DamiaoRegister of;
  if (!DecodeDamiao(frame, of) || of.drive != config_.mit.command_id) return;
  switch (of.number) {
    case kDamiaoReplyId:
      of.value = config_.mit.reply_id;
      break;
    case kDamiaoCommandId:
      of.value = config_.mit.command_id;
      break;
    case kDamiaoTimeOut:
      of.value = static_cast<std::uint32_t>(std::lround(config_.watchdog_s / 50e-6));
      break;
    case kDamiaoPositionMax:
      of.value = std::bit_cast<std::uint32_t>(config_.mit.command.position_rad.max);
      break;
    case kDamiaoVelocityMax:
      of.value = std::bit_cast<std::uint32_t>(config_.mit.command.velocity_rad_s.max);
      break;
    case kDamiaoTorqueMax:
      of.value = std::bit_cast<std::uint32_t>(config_.mit.command.torque_nm.max);
      break;
    default:
      return;
  }
  Say(port, EncodeDamiao(config_.mit.reply_id, of));
}

void SimulatedMitDrive::OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept {
  if (received.frame.id == kDamiaoRegistersId && config_.mit.dialect == MitDialect::kDamiao)
    return AnswerRegister(received.frame, port);
  const std::int64_t now_ns = received.time_ns;
  MitMagic magic{};
  ImpedanceCommand command;
  const bool is_magic = DecodeMitMagic(config_.mit, received.frame, magic);
  if (!is_magic && DecodeMitCommand(config_.mit, received.frame, command) != Status::kOk) return;
  CountFrame();
  CheckWatchdog(now_ns);
  MitReply reply;
  reply.sender = static_cast<std::uint8_t>(config_.mit.command_id);
  reply.position_rad = static_cast<float>(Measured(zero_rad_));
  reply.velocity_rad_s = static_cast<float>(shaft().velocity_rad_s);
  reply.torque_nm = static_cast<float>(torque_nm());
  reply.size = config_.reply_size;
  reply.temperature_c = static_cast<float>(temperature_c());
  reply.enabled = enabled_;
  reply.error = error_;
  Say(port, EncodeMitReply(config_.mit, reply));
  if (!is_magic) {
    law_.Take(command, now_ns, enabled_);
    CountSetpoint(now_ns);
  } else if (magic == MitMagic::kEnter) {
    if (!enabled_) law_.Feed(now_ns);
    enabled_ = true;
  } else if (magic == MitMagic::kClear) {
    enabled_ = false;
    error_ = 0;
  } else if (magic == MitMagic::kExit) {
    enabled_ = false;
  } else if (!enabled_) {
    zero_rad_ = shaft().angle_rad;
  }
}

OwnedDrive MitProtocol::Simulate(const DriveEntry& entry, const MitConfig& mit,
                                 const SimulatedMotorConfig& motor) {
  SimulatedMitConfig config;
  static_cast<SimulatedMotorConfig&>(config) = motor;
  config.mit = mit;
  config.watchdog_s = entry.watchdog_s;
  return {std::make_unique<SimulatedMitDrive>(config)};
}

}  // namespace tumbler
