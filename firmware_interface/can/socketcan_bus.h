#pragma once

#include <string>

#include "firmware_interface/can/bus.h"

namespace tumbler {

/// A Linux raw CAN socket (kernel Documentation/networking/can.rst): `can0`, `vcan0`, ...
///
/// Bit rate, restart delay and queue length belong to the interface and are set with `ip link`;
/// keep txqueuelen small (10), since frames that nobody acknowledged stay in that queue and go out
/// when the bus comes back.
///
/// - A full transmit queue (ENOBUFS, EAGAIN) is kWouldBlock.
/// - Bus-off is learned from the controller's error frames, in Receive, and holds until the kernel
///   reports a restart.
/// - An interface that is down or gone is kLinkDown. One that comes up again works again; one that
///   was removed (an adapter unplugged) needs a new Open.
/// - Frames carry the kernel's receive time, moved from its real-time clock to CLOCK_MONOTONIC.
///   Frames of this socket are not received back; frames of other sockets on this machine are.
class SocketCanBus final : public CanBus {
 public:
  SocketCanBus() noexcept = default;
  ~SocketCanBus() override;

  /// How Open ended.
  struct OpenResult {
    Status status = Status::kOk;
    int error_number = 0;  ///< errno of the call that failed
    std::string message;   ///< What is wrong and what to do, naming the interface; empty on kOk.
  };

  /// Binds to an interface; replaces the one that was open. The one call that may take its time:
  /// before the loop.
  [[nodiscard]] OpenResult Open(const std::string& interface);
  void Close() noexcept;

  /// Before the first successful Open: kLinkDown.
  Status Send(const CanFrame& frame) noexcept override;
  Status Receive(ReceivedFrame& received) noexcept override;

  [[nodiscard]] int last_errno() const noexcept {
    return errno_;
  }  ///< Cause of the last kLinkDown or kIoError.

 private:
  [[nodiscard]] OpenResult TryOpen(const std::string& interface);
  Status LinkStatus() noexcept;
  Status Failed(int error_number) noexcept;
  [[nodiscard]] bool IsUp() const noexcept;

  int socket_ = -1;
  std::string interface_;  // set by Open only
  int errno_ = 0;
  bool bus_off_ = false;
  bool link_down_ = false;
};

}  // namespace tumbler
