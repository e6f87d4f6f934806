#include "runtime/telemetry/sentences.h"

#include <fmt/format.h>

#include <cstdint>

#include "common/status.h"

namespace tumbler {
namespace {

std::string JointName(int joint, const std::vector<std::string>& names) {
  const auto index = static_cast<std::size_t>(joint);
  return index < names.size() ? fmt::format("joint {}", names[index])
                              : fmt::format("joint {}", joint);
}

const char* UnitOf(Fault fault) {
  switch (fault) {
    case Fault::kStaleReply:
    case Fault::kHeartbeatLost:
    case Fault::kLateTick:
    case Fault::kArmingTimeout:
      return " ticks";
    case Fault::kFollowingError:
    case Fault::kEntryMissed:
      return " rad";
    case Fault::kOverTemperature:
      return " C";
    default:
      return "";
  }
}

const char* UnitOf(Refusal refusal) {
  switch (refusal) {
    case Refusal::kNoReply:
    case Refusal::kNoHeartbeat:
      return " ticks";
    case Refusal::kTooHot:
      return " C";
    case Refusal::kOutsideLimits:
    case Refusal::kNotAtStart:
    case Refusal::kOutsideStartSet:
    case Refusal::kTurnsLost:
    case Refusal::kMoved:
    case Refusal::kFarFromStart:
      return " rad";
    default:
      return "";
  }
}

/// A drive's code, unless it has more digits than a float.
std::string CodeOf(float value) {
  constexpr float kExact = 16'777'216;
  return value >= 0 && value < kExact
             ? fmt::format(": code {:#x}", static_cast<std::uint32_t>(value))
             : "";
}

}  // namespace

std::string Describe(const FaultDetail& detail, const std::vector<std::string>& joint_names) {
  std::string text = ToString(detail.fault);
  if (detail.joint >= 0) text += fmt::format(" of {}", JointName(detail.joint, joint_names));
  switch (detail.fault) {
    case Fault::kNone:
      return text;
    case Fault::kOperatorStop:
    case Fault::kNonFinite:
    case Fault::kErrorPassive:
      break;
    case Fault::kBusOff:
    case Fault::kInterfaceDown:
    case Fault::kInterfaceGone:
    case Fault::kLinkFailed:
    case Fault::kTransmitQueueFull:
      text += fmt::format(": {}", ToString(static_cast<Status>(detail.value)));
      break;
    case Fault::kDriveError:
      text += detail.value == 0 ? ": it is not enabled any more" : CodeOf(detail.value);
      break;
    case Fault::kForeignCommand:
      text += fmt::format(": a frame of somebody else with identifier {:#05x}",
                          static_cast<std::uint32_t>(detail.value));
      break;
    default:
      text +=
          fmt::format(": {:.4g}{}, limit {:.4g}", detail.value, UnitOf(detail.fault), detail.limit);
  }
  return text + fmt::format(" at tick {} ({}); reaction: {}", detail.tick, ToString(detail.state),
                            ToString(detail.reaction));
}

std::string Describe(const RefusalDetail& detail, const std::vector<std::string>& joint_names) {
  std::string text = ToString(detail.refusal);
  if (detail.refusal == Refusal::kNoSuchBranch)
    return text + fmt::format(" (number {})", detail.value);
  if (detail.joint < 0) return text;
  text += fmt::format(" ({}", JointName(detail.joint, joint_names));
  if (detail.refusal == Refusal::kNoReply && detail.value < 0) return text + ": never)";
  if (detail.refusal == Refusal::kDriveError) return text + CodeOf(detail.value) + ")";
  return text + fmt::format(": {:.4g}{}, limit {:.4g})", detail.value, UnitOf(detail.refusal),
                            detail.limit);
}

}  // namespace tumbler
