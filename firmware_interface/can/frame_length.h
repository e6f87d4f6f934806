#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware_interface/can/frame.h"

namespace tumbler {

/// Length of classic CAN frames on the wire (ISO 11898-1), in nominal bit times.
///
/// A frame is SOF, arbitration field, control field, data and CRC-15, in which after every five
/// equal bits one complementary stuff bit is inserted, then the unstuffed CRC delimiter, ACK slot,
/// ACK delimiter and 7 bits of end of frame. Three bits of intermission follow before another frame
/// may start; all lengths here include them.
///
/// [Da07] R. Davis et al., Controller Area Network (CAN) schedulability analysis: refuted,
/// revisited and revised,
///        Real-Time Systems 35, 2007.

enum class CanIdKind : std::uint8_t { kStandard, kExtended };  ///< 11 or 29 bits

inline constexpr int kIntermissionBits = 3;
/// CRC delimiter, ACK slot, ACK delimiter, 7 bits of end of frame.
inline constexpr int kFrameTailBits = 10;

/// Whether identifier and size are in range for the frame's format; nothing else of a frame can be
/// wrong.
[[nodiscard]] bool IsValid(const CanFrame& frame) noexcept;

/// The exact length of a frame: every stuff bit counted. @pre IsValid(frame).
[[nodiscard]] int FrameBits(const CanFrame& frame) noexcept;

/// Length without any stuff bit of a data frame with `size` bytes, 0 ... 8: 47 + 8n, or 67 + 8n.
[[nodiscard]] constexpr int UnstuffedFrameBits(CanIdKind kind, int size) noexcept {
  return (kind == CanIdKind::kStandard ? 47 : 67) + 8 * size;
}

/// Length of the longest data frame with `size` bytes, 0 ... 8, whatever identifier and data: with
/// g bits exposed to stuffing besides data (34, or 54 extended) at most (g + 8n - 1) / 4 stuff
/// bits: 55 + 10n, or 80 + 10n [Da07, Eq. 1].
[[nodiscard]] constexpr int WorstCaseFrameBits(CanIdKind kind, int size) noexcept {
  const int exposed = (kind == CanIdKind::kStandard ? 34 : 54) + 8 * size;
  return UnstuffedFrameBits(kind, size) + (exposed - 1) / 4;
}

/// Order of arbitration: of frames that start together the one with the smallest key stays on the
/// bus. The key is the arbitration field in transmission order, so that 0 (dominant) beats 1: a
/// standard frame beats an extended one with the same leading 11 bits, a data frame beats a remote
/// frame with the same identifier.
[[nodiscard]] std::uint32_t ArbitrationKey(const CanFrame& frame) noexcept;

/// A frame's bits from SOF to the end of the CRC, after stuffing. One byte a bit, 0 dominant.
struct FrameBitStream {
  static constexpr int kCapacity =
      160;  ///< 118 bits exposed to stuffing (extended, 8 bytes) and 29 stuff bits fit.
  std::array<std::uint8_t, kCapacity> bits{};
  int count = 0;
  int stuff_bits = 0;     ///< how many of `count` were stuffed
  std::uint16_t crc = 0;  ///< CRC-15 of the unstuffed bits before it

  [[nodiscard]] std::span<const std::uint8_t> view() const noexcept {
    return {bits.data(), static_cast<std::size_t>(count)};
  }
};

/// @pre IsValid(frame).
[[nodiscard]] FrameBitStream BuildBitStream(const CanFrame& frame) noexcept;

/// CRC of classic CAN, x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 (0x4599), initial value 0, of
/// bits that are each 0 or 1 (ISO 11898-1).
[[nodiscard]] std::uint16_t CanCrc15(std::span<const std::uint8_t> bits) noexcept;

}  // namespace tumbler
