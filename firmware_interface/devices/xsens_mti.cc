#include "firmware_interface/devices/xsens_mti.h"

#include <bit>
#include <cstddef>

namespace tumbler {
namespace {

constexpr std::uint16_t kLargestId = 0x7ff;

/// The payload as one number, the first byte highest.
std::uint64_t BigWord(const std::array<std::uint8_t, 8>& data) noexcept {
  if constexpr (std::endian::native == std::endian::little) {
    return __builtin_bswap64(std::bit_cast<std::uint64_t>(data));
  }
  return std::bit_cast<std::uint64_t>(data);
}

/// Its 16-bit number i.
float Int16Of(std::uint64_t word, unsigned i) noexcept {
  return static_cast<float>(
      static_cast<std::int16_t>(static_cast<std::uint16_t>(word >> (48U - 16U * i))));
}

/// Rounds halves away from zero; a number beyond the wire's becomes its largest.
void StoreBigInt16(std::array<std::uint8_t, 8>& data, std::size_t first, double value) noexcept {
  constexpr double kLargest = 32767;
  double rounded = value + (value < 0 ? -0.5 : 0.5);
  if (!(rounded > -kLargest)) rounded = -kLargest;
  if (rounded > kLargest) rounded = kLargest;
  const auto bits = static_cast<std::uint16_t>(static_cast<std::int16_t>(rounded));
  data[first] = static_cast<std::uint8_t>(bits >> 8U);
  data[first + 1] = static_cast<std::uint8_t>(bits);
}

}  // namespace

Status XsensMtiConfig::Validate() const noexcept {
  const bool valid = quaternion_id <= kLargestId && rate_id <= kLargestId &&
                     time_id <= kLargestId && quaternion_id != rate_id &&
                     quaternion_id != time_id && rate_id != time_id;
  return valid ? Status::kOk : Status::kInvalidArgument;
}

void XsensMti::Configure(const XsensMtiConfig& config) noexcept {
  ids_ = {config.quaternion_id, config.rate_id, config.time_id};
  reading_ = {};
  quaternion_ = 0;
  rate_ = 0;
  same_quaternion_ = false;
}

InertialPart XsensMti::Decode(const CanFrame& frame) noexcept {
  if (frame.extended || frame.remote) return InertialPart::kNone;
  if (frame.id == ids_[kQuaternion]) {
    if (frame.size != kQuaternionBytes) return InertialPart::kOther;
    const std::uint64_t word = BigWord(frame.data);
    for (unsigned i = 0; i < 4; ++i) reading_.attitude[i] = Int16Of(word, i) * kQuaternionStep;
    same_quaternion_ = word == quaternion_;
    quaternion_ = word;
    return InertialPart::kAttitude;
  }
  if (frame.id == ids_[kRate]) {
    if (frame.size != kRateBytes) return InertialPart::kOther;
    const std::uint64_t word = BigWord(frame.data) >> 16U << 16U;  // What follows is not sent.
    for (unsigned i = 0; i < 3; ++i) reading_.rate_rad_s[i] = Int16Of(word, i) * kRateStep_rad_s;
    reading_.repeats = same_quaternion_ && word == rate_ ? reading_.repeats + 1 : 0;
    rate_ = word;
    return InertialPart::kRate;
  }
  if (frame.id != ids_[kTime]) return InertialPart::kNone;
  if (frame.size != kTimeBytes) return InertialPart::kOther;
  reading_.time = static_cast<std::uint32_t>(BigWord(frame.data) >> 32U);
  return InertialPart::kTime;
}

namespace {

CanFrame DataFrameOf(std::uint32_t id, std::uint8_t size) noexcept {
  CanFrame frame;
  frame.id = id;
  frame.size = size;
  return frame;
}

}  // namespace

CanFrame XsensQuaternionFrame(const XsensMtiConfig& config,
                              const std::array<double, 4>& attitude) noexcept {
  CanFrame frame = DataFrameOf(config.quaternion_id, XsensMti::kQuaternionBytes);
  for (std::size_t i = 0; i < 4; ++i) StoreBigInt16(frame.data, 2 * i, attitude[i] * 32767);
  return frame;
}

CanFrame XsensRateFrame(const XsensMtiConfig& config,
                        const std::array<double, 3>& rate_rad_s) noexcept {
  CanFrame frame = DataFrameOf(config.rate_id, XsensMti::kRateBytes);
  for (std::size_t i = 0; i < 3; ++i) StoreBigInt16(frame.data, 2 * i, rate_rad_s[i] * 512);
  return frame;
}

CanFrame XsensTimeFrame(const XsensMtiConfig& config, std::uint32_t time) noexcept {
  CanFrame frame = DataFrameOf(config.time_id, XsensMti::kTimeBytes);
  for (std::size_t i = 0; i < 4; ++i)
    frame.data[i] = static_cast<std::uint8_t>(time >> (8 * (3 - i)));
  return frame;
}

std::array<SensorMessage, 3> XsensMtiProtocol::Messages(const Config& config) noexcept {
  return {{{"quaternion_id", "attitudes", config.quaternion_id, XsensMti::kQuaternionBytes},
           {"rate_id", "rates of turn", config.rate_id, XsensMti::kRateBytes},
           {"time_id", "sample times", config.time_id, XsensMti::kTimeBytes, true}}};
}

std::array<CanFrame, 3> XsensMtiProtocol::Frames(const Config& config,
                                                 const SensorReport& report) noexcept {
  return {XsensQuaternionFrame(config, report.attitude), XsensRateFrame(config, report.rate_rad_s),
          XsensTimeFrame(config, report.time)};
}

}  // namespace tumbler
