#include "firmware_interface/devices/error_texts.h"

#include <fmt/format.h>

#include <array>
#include <span>
#include <string>
#include <variant>

namespace tumbler {

namespace {

struct CodeText {
  std::uint32_t code;
  const char* text;
};

// CiA 301, SDO abort codes.
constexpr std::array kAborts = {
    CodeText{0x05030000, "the toggle bit did not alternate"},
    CodeText{0x05040000, "the transfer timed out"},
    CodeText{0x05040001, "the command is not known"},
    CodeText{0x06010000, "such access is not supported"},
    CodeText{0x06010001, "the object can only be written"},
    CodeText{0x06010002, "the object can only be read"},
    CodeText{0x06020000, "the object does not exist"},
    CodeText{0x06040041, "the object cannot be mapped to the PDO"},
    CodeText{0x06040042, "the mapped objects are longer than the PDO"},
    CodeText{0x06040043, "the parameters are not compatible"},
    CodeText{0x06040047, "the device is not compatible with this internally"},
    CodeText{0x06060000, "a hardware error prevents it"},
    CodeText{0x06070010, "the length of the value is wrong"},
    CodeText{0x06070012, "the value is too long"},
    CodeText{0x06070013, "the value is too short"},
    CodeText{0x06090011, "the sub-index does not exist"},
    CodeText{0x06090030, "the value is not allowed"},
    CodeText{0x06090031, "the value is too large"},
    CodeText{0x06090032, "the value is too small"},
    CodeText{0x08000000, "general error"},
    CodeText{0x08000020, "the value cannot be stored"},
    CodeText{0x08000021, "the value cannot be stored under local control"},
    CodeText{0x08000022, "the value cannot be stored in the present state of the device"},
};

// T-Motor AK in MIT mode.
constexpr std::array kAk = {
    CodeText{1, "over-temperature"}, CodeText{2, "over-current"},
    CodeText{3, "over-voltage"},     CodeText{4, "under-voltage"},
    CodeText{5, "encoder"},          CodeText{6, "phase current unbalanced"},
};
constexpr std::array kDamiao = {
    CodeText{8, "over-voltage"},   CodeText{9, "under-voltage"},
    CodeText{10, "over-current"},  CodeText{11, "transistors too hot"},
    CodeText{12, "rotor too hot"}, CodeText{13, "lost communication"},
    CodeText{14, "overload"},
};
// ODrive firmware 0.6; each is one bit.
constexpr std::array kOdrive = {
    CodeText{0x1, "initializing"},
    CodeText{0x2, "system level"},
    CodeText{0x4, "timing error"},
    CodeText{0x8, "missing estimate"},
    CodeText{0x10, "bad config"},
    CodeText{0x20, "drv fault"},
    CodeText{0x40, "missing input"},
    CodeText{0x100, "dc bus over-voltage"},
    CodeText{0x200, "dc bus under-voltage"},
    CodeText{0x400, "dc bus over-current"},
    CodeText{0x800, "dc bus over-regeneration"},
    CodeText{0x1000, "current limit violation"},
    CodeText{0x2000, "motor over-temperature"},
    CodeText{0x4000, "inverter over-temperature"},
    CodeText{0x8000, "velocity limit violation"},
    CodeText{0x10000, "position limit violation"},
    CodeText{0x1000000, "watchdog timer expired"},
    CodeText{0x2000000, "emergency stop requested"},
    CodeText{0x4000000, "spinout detected"},
    CodeText{0x8000000, "brake resistor disarmed"},
    CodeText{0x10000000, "thermistor disconnected"},
    CodeText{0x40000000, "calibration error"},
};
// ODrive firmware 0.6, byte 5 of the heartbeat. Earlier firmware has flags there.
constexpr std::array kOdriveResults = {
    "success",
    "busy",
    "cancelled",
    "disarmed",
    "no response",
    "pole pairs and counts per revolution do not fit",
    "phase resistance out of range",
    "phase inductance out of range",
    "unbalanced phases",
    "invalid motor type",
    "illegal hall state",
    "timeout",
    "homing without endstop",
    "invalid state",
    "not calibrated",
    "not converging",
};
// CiA 301 and 402, emergency codes that many drives have.
constexpr std::array kEmergencies = {
    CodeText{0x1000, "generic error"},
    CodeText{0x2310, "over-current"},
    CodeText{0x3210, "dc link over-voltage"},
    CodeText{0x3220, "dc link under-voltage"},
    CodeText{0x4210, "device too hot"},
    CodeText{0x4310, "drive too hot"},
    CodeText{0x7300, "sensor"},
    CodeText{0x8130, "lost the host's heartbeat"},
    CodeText{0x8611, "following error"},
};

const char* Find(std::span<const CodeText> texts, std::uint32_t code) {
  for (const CodeText& text : texts) {
    if (text.code == code) return text.text;
  }
  return nullptr;
}

std::string Named(const char* format_text, std::uint32_t code, const std::string& name) {
  const std::string number = fmt::format(fmt::runtime(format_text), code);
  return name.empty() ? number : number + ", " + name;
}

std::string TextOf(std::span<const CodeText> texts, std::uint32_t code) {
  const char* const text = Find(texts, code);
  return text == nullptr ? "" : text;
}

}  // namespace

std::string_view ErrorCodesOf(const DriveConfig& drive) {
  if (const auto* mit = std::get_if<MitConfig>(&drive))
    return mit->dialect == MitDialect::kDamiao ? "damiao" : "ak";
  if (std::holds_alternative<CanSimpleConfig>(drive)) return "odrive";
  return DriveProtocols::With(drive, [](auto protocol, const auto& /*config*/) -> std::string_view {
    return decltype(protocol)::kId;
  });
}

std::vector<std::string> ErrorCodesOf(const DrivesConfig& drives) {
  std::vector<std::string> codes;
  for (const DriveEntry& entry : drives.drives) codes.emplace_back(ErrorCodesOf(entry.config));
  return codes;
}

std::string DescribeDriveError(const DriveConfig& drive, std::uint32_t code) {
  return DescribeDriveError(ErrorCodesOf(drive), code);
}

std::string DescribeDriveError(std::string_view codes, std::uint32_t code) {
  if (codes == "ak") return Named("{:#04x}", code, TextOf(kAk, code));
  if (codes == "damiao") return Named("{:#04x}", code, TextOf(kDamiao, code));
  if (codes == "odrive") {
    std::string names;
    for (const CodeText& bit : kOdrive) {
      if ((code & bit.code) != 0) names += (names.empty() ? "" : ", ") + std::string(bit.text);
    }
    return Named("{:#010x}", code, names);
  }
  std::string text;
  DriveProtocols::ForEach([&](auto protocol) {
    using Protocol = decltype(protocol);
    if constexpr (requires { Protocol::ErrorName(code); }) {
      if (codes != Protocol::kId) return;
      const char* const name = Protocol::ErrorName(code);
      text = Named("{:#04x}", code, name == nullptr ? "" : name);
    }
  });
  if (!text.empty()) return text;
  if (codes != "cia402") return Named("{:#x}", code, "");
  return code > 0xffff ? Named("{:#010x}", code, TextOf(kAborts, code))
                       : Named("{:#06x}", code, TextOf(kEmergencies, code));
}

std::string DescribeReport(std::string_view codes, const DriveReport& report) {
  std::string text;
  if (report.procedure_result != 0) {
    const std::size_t index = report.procedure_result;
    text = fmt::format("procedure result {}", report.procedure_result);
    if (codes == "odrive" && index < kOdriveResults.size())
      text += fmt::format(", {}", kOdriveResults[index]);
  }
  if (report.disarm_reason != 0) {
    text += fmt::format("{}disarm reason {}", text.empty() ? "" : "; ",
                        DescribeDriveError(codes, report.disarm_reason));
  }
  return text;
}

std::string DescribeSetUpRefusal(const SetUpRefusal& refusal) {
  if (refusal.code == 0) return "";
  return fmt::format("object {:04x}:{:02x}: {}", refusal.index, refusal.sub,
                     Named("{:#010x}", refusal.code, TextOf(kAborts, refusal.code)));
}

std::string DescribeRemarks(const DriveConfig& config, const Drive& drive) {
  const std::string refusal = DescribeSetUpRefusal(drive.set_up_refusal());
  const std::string report = DescribeReport(ErrorCodesOf(config), drive.report());
  return (refusal.empty() ? "" : "; it refused " + refusal) +
         (report.empty() ? "" : "; its " + report);
}

}  // namespace tumbler
