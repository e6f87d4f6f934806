#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/can_link.h"

namespace tumbler {

/// How a SocketCAN interface is to be used.
struct SocketCanConfig {
  /// 11-bit identifiers of the frames that are sent and of those that are wanted; the kernel drops
  /// all others. Both empty: every frame is received.
  std::vector<std::uint16_t> send_ids;
  std::vector<std::uint16_t> receive_ids;

  /// Frames sent that may be unconfirmed at once, 1 ... kMaxInFlight; four ticks of two drives.
  /// More would wait to be sent when they are out of date.
  int in_flight_max = 8;
  /// An unconfirmed frame older than this is a stall. Below the 25 ms after which MIT drives let
  /// go, and far above the millisecond that a USB adapter takes.
  std::int64_t confirm_timeout_ns = 20'000'000;

  /// For the one program that drives motors. Open discards what an earlier program left in the
  /// queue and the controller, and a stall discards what waits, by taking the interface down and up
  /// again. Without CAP_NET_ADMIN Open refuses an interface where frames wait, and a stall leaves
  /// what had been sent where it is. Refused, too, is a queue of more than kQueueFramesMax frames.
  bool discard_stale_frames = false;

  /// Restarts of an interface come at least this far apart, so that a bus that stays dead is not
  /// flapped at the rate of the loop. In between, what was sent last may wait.
  static constexpr std::int64_t kRestartPause_ns = 250'000'000;
  static constexpr int kMaxInFlight = 64;
  static constexpr int kQueueFramesMax = 32;
};

/// Counts since Open.
struct SocketCanStatistics {
  std::int64_t sent = 0;       ///< frames given to the kernel
  std::int64_t confirmed = 0;  ///< of these, handed back by it
  std::int64_t discarded = 0;  ///< of these, lost with the link or in a restart of it
  std::int64_t refused = 0;    ///< not taken: stalled, queue full, bus off or down
  std::int64_t stalls = 0;     ///< times that confirmations or room in the queue failed to come
  std::int64_t received = 0;   ///< frames of others
  std::int64_t foreign_commands = 0;  ///< received with an identifier of `send_ids`: another
                                      ///< program or node commands the same drives. Not handed on.
  std::int64_t dropped = 0;           ///< lost by the kernel, the receive buffer being full
  std::int64_t error_frames = 0;
  std::int64_t unacknowledged = 0;  ///< error frames that say that nobody acknowledged
  std::int64_t protocol_errors = 0;
  std::int64_t arbitration_lost = 0;
  std::int64_t bus_offs = 0;
  std::int64_t restarts = 0;             ///< of the controller, reported by the kernel
  std::int64_t confirm_time_max_ns = 0;  ///< from giving a frame to the kernel to its having left
};

/// A Linux raw CAN socket (kernel Documentation/networking/can.rst): `can0`, `vcan0`, ...
///
/// Bit rate, restart delay and queue length belong to the interface and are set with `ip link`.
///
/// - **Nothing waits to be sent later.** Every frame is confirmed by the kernel handing it back
///   (CAN_RAW_RECV_OWN_MSGS, MSG_CONFIRM). While `in_flight_max` are unconfirmed, or one for
///   longer than `confirm_timeout_ns`, or once the kernel's queue was full (ENOBUFS, EAGAIN), the
///   bus is stalled: Send drops the frame and answers kWouldBlock until all were confirmed or
///   discarded. Confirmations are seen by Receive: call it between sending.
/// - Error frames tell the controller's state, of which bus-off is an error of Send and Receive
///   until the kernel reports a restart.
/// - An interface that is down is kLinkDown, and works again once it is up. One that was removed
/// (an
///   adapter unplugged) is kLinkGone and needs a new Open.
/// - Frames carry the kernel's receive time, moved from its real-time clock to CLOCK_MONOTONIC.
///   Frames of other sockets on this machine are received like those of other nodes.
///
/// Receive takes what has come with one system call, SendAll gives all frames with one. Memory is
/// allocated by Open alone. With `discard_stale_frames` Open starts a thread that restarts the
/// interface after a stall, since that can take its time.
class SocketCanBus final : public CanBus {
 public:
  SocketCanBus() noexcept;
  ~SocketCanBus() override;

  /// How Open ended.
  struct OpenResult {
    Status status = Status::kOk;
    int error_number = 0;  ///< errno of the call that failed
    std::string message;   ///< What is wrong and what to do, naming the interface; empty on kOk.
  };

  /// Binds to an interface; replaces the one that was open. The one call that may take its time:
  /// before the loop.
  [[nodiscard]] OpenResult Open(const std::string& interface, const SocketCanConfig& config = {});
  void Close() noexcept;

  /// Before the first successful Open: kLinkDown.
  Status Send(const CanFrame& frame) noexcept override;
  Status SendAll(std::span<const CanFrame> frames, std::size_t& sent) noexcept override;
  Status Receive(ReceivedFrame& received) noexcept override;

  /// Waits for confirmations for up to `confirm_timeout_ns`, and then discards what is in flight,
  /// if that is permitted. For the end of a loop: it blocks, and what was received is lost.
  void DiscardInFlight() noexcept;

  [[nodiscard]] int last_errno() const noexcept {
    return errno_;
  }  ///< Cause of the last kLinkDown, kLinkGone or kIoError.
  [[nodiscard]] const SocketCanStatistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] CanControllerState controller_state() const noexcept override {
    return controller_;
  }
  /// Frames sent that were neither confirmed nor discarded: they may still go out.
  [[nodiscard]] int in_flight() const noexcept { return in_flight_count_; }
  /// The interface as it was at Open.
  [[nodiscard]] const CanLink& link() const noexcept { return link_; }
  /// Whether stale frames can be discarded; false without `discard_stale_frames`.
  [[nodiscard]] bool can_discard() const noexcept { return restarter_ != nullptr; }
  /// For poll(2) by programs that wait for frames; -1 while closed.
  [[nodiscard]] int descriptor() const noexcept { return socket_; }

 private:
  class Restarter;      // the thread that restarts the interface
  struct ReceiveBatch;  // buffers of one system call

  struct InFlight {
    CanFrame frame;
    std::int64_t sent_ns = 0;
  };

  [[nodiscard]] OpenResult TryOpen(const std::string& interface, const SocketCanConfig& config);
  [[nodiscard]] OpenResult DiscardOld(const std::string& interface);
  [[nodiscard]] OpenResult SetUp(const std::string& interface, const SocketCanConfig& config);
  Status LinkStatus() noexcept;
  Status Failed(int error_number) noexcept;
  Status CheckStall(std::int64_t now_ns) noexcept;
  void Stall() noexcept;
  void RequestRestart(std::int64_t now_ns) noexcept;
  void ForgetInFlight() noexcept;
  void Confirm(const CanFrame& frame, std::int64_t time_ns) noexcept;
  void TakeError(std::uint32_t kinds, const std::uint8_t* data) noexcept;
  bool TakeMessage(std::size_t index, ReceivedFrame& received) noexcept;
  [[nodiscard]] Status AskInterface() const noexcept;

  int socket_ = -1;
  std::string interface_;  // set by Open only
  SocketCanConfig config_;
  CanLink link_;
  std::unique_ptr<ReceiveBatch> batch_;
  std::unique_ptr<Restarter> restarter_;  // null where stale frames cannot be discarded
  int errno_ = 0;
  bool link_down_ = false;
  bool gone_ = false;
  bool stalled_ = false;
  std::int64_t restart_ns_ = 0;  // last request; 0: none
  CanControllerState controller_ = CanControllerState::kErrorActive;
  std::array<InFlight, SocketCanConfig::kMaxInFlight> in_flight_;  // a ring, oldest first
  int in_flight_first_ = 0;
  int in_flight_count_ = 0;
  std::uint32_t dropped_before_ = 0;  // the kernel's count when last seen
  SocketCanStatistics statistics_;
};

}  // namespace tumbler
