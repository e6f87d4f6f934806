#pragma once

#include <array>
#include <compare>
#include <cstdint>

namespace tumbler {

/// One classic CAN data or remote frame (ISO 11898-1).
struct CanFrame {
  /// Identifier of 11 bits, or of 29 when `extended`.
  std::uint32_t id = 0;
  /// Whether the identifier has 29 bits. Its value does not tell.
  bool extended = false;
  /// Whether this is a remote transmission request: it asks for `size` bytes and has no payload.
  bool remote = false;
  /// Bytes of payload, 0 ... 8.
  std::uint8_t size = 0;
  std::array<std::uint8_t, 8> data{};

  bool operator==(const CanFrame&) const = default;
};

/// What frames are told apart by: an identifier of 11 bits and one of 29 with the same value are
/// two.
struct CanId {
  CanId() = default;
  constexpr CanId(std::uint32_t id, bool is_extended = false) noexcept  // A number has 11 bits.
      : value(id), extended(is_extended) {}

  std::uint32_t value = 0;
  bool extended = false;  ///< Whether it has 29 bits.

  auto operator<=>(const CanId&) const = default;
};
[[nodiscard]] constexpr CanId IdOf(const CanFrame& frame) noexcept {
  return {frame.id, frame.extended};
}

/// A frame as it came from a bus.
struct ReceivedFrame {
  CanFrame frame;
  std::int64_t time_ns = 0;  ///< End of the frame on the wire, by the bus's monotonic clock.
};

}  // namespace tumbler
