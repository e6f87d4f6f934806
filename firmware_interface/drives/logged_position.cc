#include "firmware_interface/drives/logged_position.h"

#include <numbers>
#include <variant>

namespace tumbler {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

double ToJoint(const JointMap& joint, double shaft_rad) {
  return double{joint.direction} * shaft_rad / double{joint.gear_ratio} +
         double{joint.zero_offset_rad};
}

std::optional<double> Commanded(const MitConfig& config, const CanFrame& frame) {
  MitCommand command;
  if (DecodeMitCommand(config, frame, command) != Status::kOk || command.kp_nm_per_rad <= 0) {
    return std::nullopt;
  }
  return ToJoint(config.joint, double{command.position_rad});
}

std::optional<double> Commanded(const CanSimpleConfig& config, const CanFrame& frame) {
  CanSimpleInputPos command;
  if (DecodeCanSimple(config.node_id, frame, command) != Status::kOk) return std::nullopt;
  return ToJoint(config.joint, double{command.position_rev} * kTwoPi);
}

std::optional<double> Commanded(const Cia402Config& config, const CanFrame& frame) {
  Cia402Command command;
  if (DecodeCia402(config.node_id, frame, command) != Status::kOk ||
      command.controlword != cia402_control::kEnable) {
    return std::nullopt;
  }
  return ToJoint(config.joint, command.position * kTwoPi / double{config.position_units_per_turn});
}

std::optional<double> Reported(const MitConfig& config, const CanFrame& frame) {
  MitReply reply;
  if (DecodeMitReply(config, frame, reply) != Status::kOk) return std::nullopt;
  return ToJoint(config.joint, double{reply.position_rad});
}

std::optional<double> Reported(const CanSimpleConfig& config, const CanFrame& frame) {
  CanSimpleEstimates estimates;
  if (DecodeCanSimple(config.node_id, frame, estimates) != Status::kOk) return std::nullopt;
  return ToJoint(config.joint, double{estimates.position_rev} * kTwoPi);
}

std::optional<double> Reported(const Cia402Config& config, const CanFrame& frame) {
  Cia402Status status;
  if (DecodeCia402(config.node_id, frame, status) != Status::kOk) return std::nullopt;
  return ToJoint(config.joint, status.position * kTwoPi / double{config.position_units_per_turn});
}

}  // namespace

std::optional<double> CommandedPosition(const DriveConfig& drive, const CanFrame& frame) {
  return std::visit([&frame](const auto& config) { return Commanded(config, frame); }, drive);
}

std::optional<double> ReportedPosition(const DriveConfig& drive, const CanFrame& frame) {
  return std::visit([&frame](const auto& config) { return Reported(config, frame); }, drive);
}

}  // namespace tumbler
