#pragma once

#include <cstdint>

namespace tumbler {

/// Outcome of an operation of `common`, `firmware_interface` or the real-time core, which do not
/// throw.
enum class [[nodiscard]] Status : std::uint8_t{
    kOk,
    /// An argument is outside what the function documents; nothing was changed.
    kInvalidArgument,
    /// The receiver's fixed capacity is too small for the argument; nothing was changed.
    kCapacityExceeded,
    /// Nothing there now (receive), or no room now (send); try again later.
    kWouldBlock,
    /// The controller has left the bus (ISO 11898-1). It sends no frame until it recovers.
    kBusOff,
    /// The interface is down.
    kLinkDown,
    /// The operating system reports another error.
    kIoError,
    /// The interface does not exist any more; it has to be opened anew.
    kLinkGone,
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
