#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "firmware_interface/can/frame.h"
#include "firmware_interface/devices/drive_range.h"

namespace tumbler {

/// Little-endian fields in the payload of a frame.

/// The whole payload as one number, the first byte lowest.
[[nodiscard]] constexpr std::uint64_t LoadWord(const std::array<std::uint8_t, 8>& data) noexcept {
  if constexpr (std::endian::native == std::endian::little) {
    return std::bit_cast<std::uint64_t>(data);
  }
  std::uint64_t word = 0;
  for (std::size_t i = 8; i-- > 0;) word = word << 8 | data[i];
  return word;
}
[[nodiscard]] constexpr std::array<std::uint8_t, 8> StoreWord(std::uint64_t word) noexcept {
  std::array<std::uint8_t, 8> data{};
  if constexpr (std::endian::native == std::endian::little) {
    data = std::bit_cast<std::array<std::uint8_t, 8>>(word);
  } else {
    for (std::size_t i = 0; i < 8; ++i) data[i] = static_cast<std::uint8_t>(word >> (8 * i));
  }
  return data;
}

/// The number in the 1 ... 4 bytes from `first` on.
[[nodiscard]] constexpr std::uint32_t LoadLittle(const std::array<std::uint8_t, 8>& data,
                                                 std::size_t first, std::size_t bytes) noexcept {
  return static_cast<std::uint32_t>(LoadWord(data) >> (8 * first) &
                                    ((std::uint64_t{1} << (8 * bytes)) - 1));
}
constexpr void StoreLittle(std::array<std::uint8_t, 8>& data, std::size_t first, std::size_t bytes,
                           std::uint32_t value) noexcept {
  const std::uint64_t mask = ((std::uint64_t{1} << (8 * bytes)) - 1) << (8 * first);
  data = StoreWord((LoadWord(data) & ~mask) | (std::uint64_t{value} << (8 * first) & mask));
}

[[nodiscard]] constexpr float LoadFloat(const std::array<std::uint8_t, 8>& data,
                                        std::size_t first) noexcept {
  return std::bit_cast<float>(LoadLittle(data, first, 4));
}
constexpr void StoreFloat(std::array<std::uint8_t, 8>& data, std::size_t first,
                          float value) noexcept {
  StoreLittle(data, first, 4, std::bit_cast<std::uint32_t>(value));
}
[[nodiscard]] constexpr std::int16_t LoadInt16(const std::array<std::uint8_t, 8>& data,
                                               std::size_t first) noexcept {
  return static_cast<std::int16_t>(LoadLittle(data, first, 2));
}
[[nodiscard]] constexpr std::int32_t LoadInt32(const std::array<std::uint8_t, 8>& data,
                                               std::size_t first) noexcept {
  return static_cast<std::int32_t>(LoadLittle(data, first, 4));
}

/// The nearest integer (halves away from zero), saturated at +-(2^15 - 1). It never wraps, and both
/// signs reach equally far. NaN gives 0.
[[nodiscard]] constexpr std::int16_t RoundToInt16(float x) noexcept {
  if (__builtin_fabsf(x) < 32767.0F) {
    return static_cast<std::int16_t>(x + __builtin_copysignf(0.5F, x));
  }
  if (x != x) return 0;
  return x < 0 ? std::int16_t{-32767} : std::int16_t{32767};
}

/// The same at +-(2^31 - 128), the largest float below 2^31.
[[nodiscard]] constexpr std::int32_t RoundToInt32(float x) noexcept {
  constexpr float kLargest = 2147483520.0F;
  // From 2^23 on floats are integers, and adding a half could round to the next one.
  if (__builtin_fabsf(x) < 8388608.0F) {
    return static_cast<std::int32_t>(x + __builtin_copysignf(0.5F, x));
  }
  if (!(x > -kLargest)) return x != x ? 0 : -2147483520;
  return static_cast<std::int32_t>(x < kLargest ? x : kLargest);
}

/// The range in whole steps of the wire, `per_unit` of them in a unit, rounded towards zero.
/// @pre the range contains zero, and its ends are below 2^31 steps.
[[nodiscard]] constexpr DriveRange WholeSteps(const DriveRange& range, float per_unit) noexcept {
  const auto towards_zero = [](float x) {
    return static_cast<float>(static_cast<std::int32_t>(x));
  };
  return {towards_zero(range.min * per_unit), towards_zero(range.max * per_unit)};
}

/// A data frame with an 11-bit identifier.
[[nodiscard]] constexpr CanFrame DataFrame(std::uint32_t id, std::uint8_t size) noexcept {
  CanFrame frame;
  frame.id = id;
  frame.size = size;
  return frame;
}

}  // namespace tumbler
