#pragma once

#include <bit>
#include <cstdint>

#include "firmware_interface/can/frame.h"

namespace tumbler {

/// Registers of Damiao's drives, as far as they are read. All drives hear requests on one
/// identifier, and answer on that of their replies.
///
///     request  id_l id_h 0x33 register 0 0 0 0     on 0x7ff
///     answer   id_l id_h 0x33 register value(4)    little-endian: float or unsigned
///
/// An answer looks like a reply of MIT mode with a meaningless position. So registers are read
/// while nobody decodes replies.
///
/// Source: docs/concept/communication-protocol.md of github.com/jia-xie/python-damiao-driver.
inline constexpr std::uint32_t kDamiaoRegistersId = 0x7ff;
inline constexpr std::uint8_t kDamiaoRead = 0x33;

inline constexpr std::uint8_t kDamiaoReplyId = 7;       ///< Unsigned: identifier of replies.
inline constexpr std::uint8_t kDamiaoCommandId = 8;     ///< Unsigned: identifier of commands.
inline constexpr std::uint8_t kDamiaoTimeOut = 9;       ///< Unsigned, in 50 us; 0: none.
inline constexpr std::uint8_t kDamiaoPositionMax = 21;  ///< Float [rad].
inline constexpr std::uint8_t kDamiaoVelocityMax = 22;  ///< Float [rad/s].
inline constexpr std::uint8_t kDamiaoTorqueMax = 23;    ///< Float [N m].

/// A request for a register (value 0), or the answer to it.
struct DamiaoRegister {
  std::uint16_t drive = 0;  ///< Its identifier of commands.
  std::uint8_t number = 0;
  std::uint32_t value = 0;

  [[nodiscard]] float number_value() const noexcept { return std::bit_cast<float>(value); }
};

/// @param id  kDamiaoRegistersId, or that of the drive's replies.
[[nodiscard]] constexpr CanFrame EncodeDamiao(std::uint32_t id, const DamiaoRegister& of) noexcept {
  CanFrame frame;
  frame.id = id;
  frame.size = 8;
  frame.data = {static_cast<std::uint8_t>(of.drive),
                static_cast<std::uint8_t>(of.drive >> 8),
                kDamiaoRead,
                of.number,
                static_cast<std::uint8_t>(of.value),
                static_cast<std::uint8_t>(of.value >> 8),
                static_cast<std::uint8_t>(of.value >> 16),
                static_cast<std::uint8_t>(of.value >> 24)};
  return frame;
}
/// @returns whether the frame is such a request or answer; `of` is written only then.
[[nodiscard]] constexpr bool DecodeDamiao(const CanFrame& frame, DamiaoRegister& of) noexcept {
  const auto& data = frame.data;
  if (frame.extended || frame.remote || frame.size != 8 || data[2] != kDamiaoRead) return false;
  of.drive = static_cast<std::uint16_t>(data[0] | data[1] << 8);
  of.number = data[3];
  of.value = std::uint32_t{data[4]} | std::uint32_t{data[5]} << 8 | std::uint32_t{data[6]} << 16 |
             std::uint32_t{data[7]} << 24;
  return true;
}

}  // namespace tumbler
