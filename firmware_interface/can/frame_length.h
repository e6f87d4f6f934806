#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware_interface/can/frame.h"

namespace tumbler {

/// Length of classic CAN frames on the wire (ISO 11898-1), in nominal bit times.
///
/// A frame begins with SOF, arbitration field, control field, data and CRC-15. In this part a
/// complementary stuff bit is inserted after every five equal bits. CRC delimiter, ACK slot, ACK
/// delimiter and 7 bits of end of frame follow without stuffing. Another frame may start after
/// three bits of intermission, which all lengths here include.
///
/// [Da07] R. Davis et al., Controller Area Network (CAN) schedulability analysis: refuted,
/// revisited and revised, Real-Time Systems 35, 2007.

/// Whether an identifier has 11 bits or 29.
enum class CanIdKind : std::uint8_t { kStandard, kExtended };

inline constexpr int kIntermissionBits = 3;
/// CRC delimiter, ACK slot, ACK delimiter, 7 bits of end of frame.
inline constexpr int kFrameTailBits = 10;

/// Whether identifier and size are in range for the frame's format. Nothing else of a frame can be
/// wrong.
[[nodiscard]] bool IsValid(const CanFrame& frame) noexcept;

/// The exact length of a frame, with every stuff bit. @pre IsValid(frame).
[[nodiscard]] int FrameBits(const CanFrame& frame) noexcept;

/// The length of a data frame with `size` = n bytes, 0 ... 8, without stuff bits: 47 + 8n, or 67 +
/// 8n.
[[nodiscard]] constexpr int UnstuffedFrameBits(CanIdKind kind, int size) noexcept {
  return (kind == CanIdKind::kStandard ? 47 : 67) + 8 * size;
}

/// The length of the longest data frame with `size` = n bytes, 0 ... 8, whatever its identifier and
/// data: 55 + 10n, or 80 + 10n. Besides the data g = 34 bits are exposed to stuffing (54 when
/// extended), so there are at most (g + 8n - 1) / 4 stuff bits [Da07, Eq. 1].
[[nodiscard]] constexpr int WorstCaseFrameBits(CanIdKind kind, int size) noexcept {
  const int exposed = (kind == CanIdKind::kStandard ? 34 : 54) + 8 * size;
  return UnstuffedFrameBits(kind, size) + (exposed - 1) / 4;
}

/// The order of arbitration: of frames that start together, the one with the smallest key stays on
/// the bus. The key is the arbitration field in the order of transmission, so that 0 (dominant)
/// beats 1. A standard frame beats an extended one with the same leading 11 bits, and a data frame
/// beats a remote frame with the same identifier.
[[nodiscard]] std::uint32_t ArbitrationKey(const CanFrame& frame) noexcept;

/// A frame's bits from SOF to the end of the CRC, after stuffing. One byte for each bit, 0 is
/// dominant.
struct FrameBitStream {
  /// An extended frame of 8 bytes has 118 bits exposed to stuffing, and at most 29 stuff bits.
  static constexpr int kCapacity = 160;
  std::array<std::uint8_t, kCapacity> bits{};
  int count = 0;          ///< Bits in use, stuff bits included.
  int stuff_bits = 0;     ///< How many of `count` are stuff bits.
  std::uint16_t crc = 0;  ///< CRC-15 of the bits before it, without stuff bits.

  [[nodiscard]] std::span<const std::uint8_t> view() const noexcept {
    return {bits.data(), static_cast<std::size_t>(count)};
  }
};

/// The bits of a frame. @pre IsValid(frame).
[[nodiscard]] FrameBitStream BuildBitStream(const CanFrame& frame) noexcept;

/// The CRC of classic CAN (ISO 11898-1) of bits that are each 0 or 1: polynomial x^15 + x^14 + x^10
/// + x^8 + x^7 + x^4 + x^3 + 1 (0x4599), initial value 0.
[[nodiscard]] std::uint16_t CanCrc15(std::span<const std::uint8_t> bits) noexcept;

}  // namespace tumbler
