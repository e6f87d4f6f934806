#include "firmware_interface/drives/simulated_drive.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace tumbler {

namespace {

void Require(bool condition, const char* what) {
  if (!condition) throw std::invalid_argument(std::string("simulated drive: ") + what);
}

}  // namespace

SimulatedDrive::SimulatedDrive(const SimulatedDriveConfig& config) : config_(config) {
  Require(config.mit.Validate() == Status::kOk, "its protocol configuration is not valid");
  Require(config.reply_size >= 6 && config.reply_size <= 8, "reply_size must be 6, 7 or 8");
  Require(config.watchdog_s >= 0 && config.watchdog_s <= 3600, "watchdog_s must be 0 ... 3600");
  Require(config.torque_max_nm > 0, "torque_max_nm must be above 0");
  Require(config.base_speed_rad_s > 0, "base_speed_rad_s must be above 0");
  Require(config.no_load_speed_rad_s > config.base_speed_rad_s ||
              config.no_load_speed_rad_s == std::numeric_limits<double>::infinity(),
          "no_load_speed_rad_s must be above base_speed_rad_s");
  Require(config.encoder_step_rad >= 0 && std::isfinite(config.encoder_step_rad),
          "encoder_step_rad must be 0 or more");
  Require(config.turnaround_ns >= 0, "turnaround_ns must be 0 or more");
}

SimulatedPortConfig SimulatedDrive::PortConfig() noexcept {
  SimulatedPortConfig config;
  config.transmit_capacity = 3;
  config.auto_retransmit = false;
  return config;
}

void SimulatedDrive::CheckWatchdog(std::int64_t time_ns) noexcept {
  if (!enabled_ || expired_ || config_.watchdog_s <= 0) return;
  if (static_cast<double>(time_ns - fed_ns_) <= config_.watchdog_s * 1e9) return;
  expired_ = true;
  ++watchdog_expiries_;
  setpoint_.kp_nm_per_rad = 0;
  setpoint_.kd_nm_s_per_rad = 0;
  setpoint_.torque_nm = 0;
}

double SimulatedDrive::measured_rad() const noexcept {
  const double angle = shaft_rad_ - zero_rad_;
  if (config_.encoder_step_rad <= 0) return angle;
  return std::floor(angle / config_.encoder_step_rad) * config_.encoder_step_rad;
}

double SimulatedDrive::Limited(double torque_nm) const noexcept {
  double limit = config_.torque_max_nm;
  const double speed = std::abs(velocity_rad_s_);
  // The back electromotive force only takes voltage away from a motor that drives in the direction
  // of its motion.
  if (torque_nm * velocity_rad_s_ > 0 && speed > config_.base_speed_rad_s &&
      std::isfinite(config_.no_load_speed_rad_s)) {
    const double range = config_.no_load_speed_rad_s - config_.base_speed_rad_s;
    limit *= std::max(0.0, (config_.no_load_speed_rad_s - speed) / range);
  }
  return std::clamp(torque_nm, -limit, limit);
}

double SimulatedDrive::Step(std::int64_t time_ns, double joint_position_rad,
                            double joint_velocity_rad_s) noexcept {
  const JointMap& joint = config_.mit.joint;
  const double ratio = static_cast<double>(joint.direction) * static_cast<double>(joint.gear_ratio);
  shaft_rad_ = ratio * (joint_position_rad - static_cast<double>(joint.zero_offset_rad));
  velocity_rad_s_ = ratio * joint_velocity_rad_s;
  CheckWatchdog(time_ns);
  torque_nm_ = 0;
  if (enabled_ && error_ == 0) {
    const auto& s = setpoint_;
    torque_nm_ = Limited(static_cast<double>(s.kp_nm_per_rad) *
                             (static_cast<double>(s.position_rad) - measured_rad()) +
                         static_cast<double>(s.kd_nm_s_per_rad) *
                             (static_cast<double>(s.velocity_rad_s) - velocity_rad_s_) +
                         static_cast<double>(s.torque_nm));
  }
  return ratio * torque_nm_;
}

void SimulatedDrive::OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept {
  const std::int64_t now_ns = received.time_ns;
  MitMagic magic{};
  MitCommand command;
  const bool is_magic = DecodeMitMagic(config_.mit, received.frame, magic);
  if (!is_magic && DecodeMitCommand(config_.mit, received.frame, command) != Status::kOk) return;
  ++frames_received_;
  CheckWatchdog(now_ns);
  if (!silent_) {
    MitReply reply;
    reply.sender = static_cast<std::uint8_t>(config_.mit.command_id);
    reply.position_rad = static_cast<float>(measured_rad());
    reply.velocity_rad_s = static_cast<float>(velocity_rad_s_);
    reply.torque_nm = static_cast<float>(torque_nm_);
    reply.size = config_.reply_size;
    reply.temperature_c = static_cast<float>(temperature_c_);
    reply.error = error_;
    // With every mailbox taken the firmware loses its answer, too; the port counts it.
    static_cast<void>(port.SendAfter(config_.turnaround_ns, EncodeMitReply(config_.mit, reply)));
  }
  if (!is_magic) {
    setpoint_ = command;
    last_setpoint_ns_ = fed_ns_ = now_ns;
    expired_ = false;
    ++setpoints_received_;
  } else if (magic == MitMagic::kEnter) {
    if (!enabled_) fed_ns_ = now_ns;
    enabled_ = true;
  } else if (magic == MitMagic::kExit) {
    enabled_ = false;
  } else if (!enabled_) {
    zero_rad_ = shaft_rad_;
  }
}

}  // namespace tumbler
