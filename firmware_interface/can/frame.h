#pragma once

#include <array>
#include <cstdint>

namespace tumbler {

/// One classic CAN data or remote frame (ISO 11898-1).
struct CanFrame {
  std::uint32_t id = 0;   ///< 11 bits, or 29 when `extended`.
  bool extended = false;  ///< Explicit; never guessed from the value of `id` (0x7ff is a legal
                          ///< 11-bit identifier).
  bool remote =
      false;  ///< Remote transmission request: `size` is the length asked for, there is no payload.
  std::uint8_t size = 0;  ///< Payload bytes, 0 ... 8.
  std::array<std::uint8_t, 8> data{};

  bool operator==(const CanFrame&) const = default;
};

/// A frame as it came from a bus.
struct ReceivedFrame {
  CanFrame frame;
  std::int64_t time_ns = 0;  ///< End of the frame on the wire, on the clock of the bus (monotonic).
};

}  // namespace tumbler
