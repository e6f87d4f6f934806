#include "runtime/record/sentences.h"

#include <fmt/format.h>

#include <cstdint>
#include <limits>

#include "common/core/status.h"
#include "firmware_interface/devices/error_texts.h"

namespace tumbler {
namespace {

std::string JointName(int joint, const std::vector<std::string>& names) {
  const auto index = static_cast<std::size_t>(joint);
  return index < names.size() ? fmt::format("joint {}", names[index])
                              : fmt::format("joint {}", joint);
}

std::string NumberOf(DetailNumber number, DetailUnit unit) {
  return IsInteger(unit) ? fmt::format("{}", number.integer())
                         : fmt::format("{:.4g}", number.real());
}

/// `12 ticks, limit 10`
std::string ValueAndLimit(DetailNumber value, DetailNumber limit, DetailUnit unit) {
  const char* name = "";
  if (unit == DetailUnit::kTicks) name = " ticks";
  if (unit == DetailUnit::kRadians) name = " rad";
  if (unit == DetailUnit::kRadiansPerSecond) name = " rad/s";
  if (unit == DetailUnit::kCelsius) name = " C";
  return fmt::format("{}{}, limit {}", NumberOf(value, unit), name, NumberOf(limit, unit));
}

std::string CodeOf(DetailNumber number, int joint, std::span<const std::string> error_codes) {
  const auto index = static_cast<std::size_t>(joint);
  return ": code " +
         DescribeDriveError(index < error_codes.size() ? error_codes[index] : "", number.code());
}

}  // namespace

std::string Describe(const FaultDetail& detail, const std::vector<std::string>& joint_names,
                     std::span<const std::string> error_codes) {
  std::string text = DescribeFault(detail, joint_names, error_codes);
  if (detail.fault == Fault::kNone) return text;
  return text + fmt::format("; reaction: {}", ToString(detail.reaction));
}

std::string DescribeFault(const FaultDetail& detail, const std::vector<std::string>& joint_names,
                          std::span<const std::string> error_codes) {
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
      text += fmt::format(": {}", ToString(static_cast<Status>(detail.value.integer())));
      break;
    case Fault::kDriveError:
      text += detail.value.code() == 0 ? ": it is not enabled any more"
                                       : CodeOf(detail.value, detail.joint, error_codes);
      break;
    case Fault::kSensorLost:
      text += fmt::format(": {}", ToString(static_cast<SensorStatus>(detail.value.integer())));
      break;
    case Fault::kForeignCommand:
      text +=
          fmt::format(": a frame of somebody else with identifier {:#05x}", detail.value.code());
      break;
    default:
      text += ": " + ValueAndLimit(detail.value, detail.limit, UnitOf(detail.fault));
  }
  return text + fmt::format(" at tick {} ({})", detail.tick, ToString(detail.state));
}

std::string Describe(const RefusalDetail& detail, const std::vector<std::string>& joint_names,
                     std::span<const std::string> error_codes) {
  std::string text = ToString(detail.refusal);
  if (detail.refusal == Refusal::kNoSuchBranch)
    return text + fmt::format(" (number {})", detail.value.integer());
  if (detail.joint < 0) return text;
  text += fmt::format(" ({}", JointName(detail.joint, joint_names));
  if (detail.refusal == Refusal::kNoReply && detail.value.integer() < 0) return text + ": never)";
  if (detail.refusal == Refusal::kDriveError)
    return text + CodeOf(detail.value, detail.joint, error_codes) + ")";
  return text + ": " + ValueAndLimit(detail.value, detail.limit, UnitOf(detail.refusal)) + ")";
}

double ToDouble(DetailNumber number, DetailUnit unit) {
  if (!IsInteger(unit)) return double{number.real()};
  const bool has_sign = unit != DetailUnit::kCode && unit != DetailUnit::kIdentifier;
  return has_sign ? static_cast<double>(number.integer()) : static_cast<double>(number.code());
}

DetailNumber FromDouble(double number, DetailUnit unit) {
  if (!IsInteger(unit)) return DetailNumber::Real(static_cast<float>(number));
  constexpr double kLeast = std::numeric_limits<std::int32_t>::min();
  constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
  if (!(number >= kLeast && number <= kMost)) return {};
  return {static_cast<std::uint32_t>(static_cast<std::int64_t>(number))};
}

}  // namespace tumbler
