#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "common/status.h"
#include "firmware_interface/can/frame.h"

namespace tumbler {

/// State of a CAN controller by its error counters (ISO 11898-1).
enum class CanControllerState : std::uint8_t {
  kErrorActive,
  kErrorWarning,  ///< A counter is above 95.
  kErrorPassive,  ///< A counter is above 127: it no longer stops others' faulty frames.
  kBusOff,        ///< The transmit counter is above 255: it takes no part until it is restarted.
};
[[nodiscard]] constexpr const char* ToString(CanControllerState state) noexcept {
  switch (state) {
    case CanControllerState::kErrorActive:
      return "error-active";
    case CanControllerState::kErrorWarning:
      return "error-warning";
    case CanControllerState::kErrorPassive:
      return "error-passive";
    case CanControllerState::kBusOff:
      return "bus-off";
  }
  return "unknown state";
}

/// Carries frames; the only seam between the runtime and hardware.
///
/// One thread owns a bus. Once it is open no call allocates, locks, throws or blocks. Silence is
/// not an error: it is kWouldBlock. A lost bus is one, and every call repeats it until the link is
/// back.
class CanBus {
 public:
  CanBus() = default;
  CanBus(const CanBus&) = delete;  // A bus owns its link.
  CanBus& operator=(const CanBus&) = delete;
  virtual ~CanBus() = default;

  /// Queues one frame. kOk says that it was queued, not that another node acknowledged it.
  /// @retval kWouldBlock       the transmit queue is full; the frame was not taken.
  /// @retval kInvalidArgument  identifier or size out of range.
  /// @retval kBusOff, kLinkDown, kLinkGone, kIoError  the link is lost: enter the safe state.
  virtual Status Send(const CanFrame& frame) noexcept = 0;

  /// Queues several frames in their order, at the price of one call where the link has one.
  /// @param sent  how many were taken: all of them on kOk, otherwise those before the failure; the
  ///              others are dropped, not kept for later.
  /// @returns     as Send, of the first frame that was not taken.
  virtual Status SendAll(std::span<const CanFrame> frames, std::size_t& sent) noexcept {
    sent = 0;
    for (const CanFrame& frame : frames) {
      const Status status = Send(frame);
      if (status != Status::kOk) return status;
      ++sent;
    }
    return Status::kOk;
  }

  /// Takes the oldest frame received; `received` is written only on kOk.
  /// @retval kWouldBlock  nothing has arrived.
  /// @retval kBusOff, kLinkDown, kLinkGone, kIoError  as for Send.
  virtual Status Receive(ReceivedFrame& received) noexcept = 0;

  /// As last heard of; links without a controller are always error-active.
  [[nodiscard]] virtual CanControllerState controller_state() const noexcept {
    return CanControllerState::kErrorActive;
  }
};

}  // namespace tumbler
