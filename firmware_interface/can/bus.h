#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"

namespace tumbler {

/// State of a CAN controller by its error counters (ISO 11898-1).
enum class CanControllerState : std::uint8_t {
  kErrorActive,
  kErrorWarning,  ///< A counter is above 95.
  kErrorPassive,  ///< A counter is above 127: the controller no longer stops others' faulty frames.
  kBusOff,  ///< The transmit counter is above 255: the controller is out until it is restarted.
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

/// A CAN bus that carries frames: the only seam between the runtime and hardware.
///
/// One thread owns a bus. Once it is open no call allocates, locks, throws or blocks. Silence is no
/// error: Receive answers kWouldBlock. A lost link is an error, which every call repeats until the
/// link is back.
class CanBus {
 public:
  CanBus() = default;
  CanBus(const CanBus&) = delete;  // A bus owns its link.
  CanBus& operator=(const CanBus&) = delete;
  virtual ~CanBus() = default;

  /// Queues one frame. kOk means that it was queued, not that another node acknowledged it.
  /// @retval kWouldBlock       the transmit queue is full; the frame was not taken.
  /// @retval kInvalidArgument  identifier or size out of range.
  /// @retval kBusOff, kLinkDown, kLinkGone, kIoError  the link is lost: enter the safe state.
  virtual Status Send(const CanFrame& frame) noexcept = 0;

  /// Queues several frames in their order. A link that can do so takes them with one system call.
  /// @param sent  gets how many were taken: all of them on kOk, otherwise those before the failure.
  ///              The others are dropped, not kept for later.
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

  /// The last known state of the controller. A link without a controller is always error-active.
  [[nodiscard]] virtual CanControllerState controller_state() const noexcept {
    return CanControllerState::kErrorActive;
  }
};

}  // namespace tumbler
