#include "firmware_interface/devices/protocols.h"

namespace tumbler {

Status Validate(const DriveConfig& config) noexcept {
  return DriveProtocols::With(config,
                              [](auto /*protocol*/, const auto& own) { return own.Validate(); });
}

const JointMap& JointOf(const DriveConfig& config) noexcept {
  return DriveProtocols::With(
      config, [](auto /*protocol*/, const auto& own) -> const JointMap& { return own.joint; });
}

ShaftRanges CommandRanges(const DriveConfig& config) noexcept {
  return DriveProtocols::With(config, [](auto protocol, const auto& own) {
    return decltype(protocol)::CommandRanges(own);
  });
}

DriveRange ReportedPositions(const DriveConfig& config) noexcept {
  return DriveProtocols::With(config, [](auto protocol, const auto& own) {
    return decltype(protocol)::ReportedPositions(own);
  });
}

int FirstReply_ms(const DriveConfig& config) noexcept {
  return DriveProtocols::With(config, [](auto protocol, const auto& /*own*/) -> int {
    return decltype(protocol)::kFirstReply_ms;
  });
}

bool CarriesGains(const DriveConfig& config) noexcept {
  return DriveProtocols::With(config, [](auto protocol, const auto& /*own*/) -> bool {
    return decltype(protocol)::kCarriesGains;
  });
}

}  // namespace tumbler
