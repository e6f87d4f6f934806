#include "firmware_interface/devices/logged_position.h"

namespace tumbler {
namespace {

double ToJoint(const JointMap& joint, double shaft_rad) {
  return double{joint.direction} * shaft_rad / double{joint.gear_ratio} +
         double{joint.zero_offset_rad};
}

}  // namespace

std::optional<double> CommandedPosition(const DriveConfig& drive, const CanFrame& frame) {
  return DriveProtocols::With(
      drive, [&frame](auto protocol, const auto& config) -> std::optional<double> {
        double shaft_rad = 0;
        if (!decltype(protocol)::CommandedPosition(config, frame, shaft_rad)) return std::nullopt;
        return ToJoint(config.joint, shaft_rad);
      });
}

std::optional<double> ReportedPosition(const DriveConfig& drive, const CanFrame& frame) {
  return DriveProtocols::With(drive,
                              [&frame](auto protocol, const auto& config) -> std::optional<double> {
                                double shaft_rad = 0;
                                if (!decltype(protocol)::ReportedPosition(config, frame, shaft_rad))
                                  return std::nullopt;
                                return ToJoint(config.joint, shaft_rad);
                              });
}

}  // namespace tumbler
