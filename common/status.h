#pragma once

#include <cstdint>

namespace tumbler {

/// Outcome of an operation of `common`, `firmware_interface` and the real-time core, none of which
/// throw.
enum class [[nodiscard]] Status : std::uint8_t{
    kOk,
    kInvalidArgument,  ///< An argument is outside what the function documents; nothing was changed.
    kCapacityExceeded,  ///< The fixed capacity of the receiver does not hold the argument; nothing
                        ///< was changed.
    kWouldBlock,        ///< Nothing there now (receive), or no room now (send); try again later.
    kBusOff,    ///< The controller has left the bus (ISO 11898-1); no frame is sent until it
                ///< recovers.
    kLinkDown,  ///< The interface is down.
    kIoError,   ///< The operating system reports another error.
    kLinkGone,  ///< The interface does not exist any more; it has to be opened anew.
};

/// Text of a status for messages; a string literal.
constexpr const char* ToString(Status status) noexcept {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kInvalidArgument:
      return "invalid argument";
    case Status::kCapacityExceeded:
      return "capacity exceeded";
    case Status::kWouldBlock:
      return "would block";
    case Status::kBusOff:
      return "bus off";
    case Status::kLinkDown:
      return "link down";
    case Status::kIoError:
      return "input/output error";
    case Status::kLinkGone:
      return "link gone";
  }
  return "unknown status";
}

}  // namespace tumbler
