#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/core/capacity.h"
#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/can_link.h"

namespace tumbler {

/// How a SocketCAN interface is to be used.
struct SocketCanConfig {
  /// Identifiers of the frames that this side sends or that somebody else might send in its place,
  /// and of those that are wanted. The kernel drops all others, and remote frames. If both are
  /// empty, every frame is received.
  std::vector<CanId> send_ids;
  std::vector<CanId> receive_ids;

  /// How many sent frames may be unconfirmed at once, 1 ... kMaxInFlight. The default is four ticks
  /// of two drives: with more, frames would be sent when they are out of date.
  int in_flight_max = 8;
  /// The bus counts as stalled when a frame stays unconfirmed for longer than this. MIT drives let
  /// go after 25 ms, which is longer; a USB adapter takes about a millisecond, which is far
  /// shorter.
  std::int64_t confirm_timeout_ns = 20'000'000;

  /// Whether frames that are out of date are discarded, by taking the interface down and up again.
  /// This is for the one program that drives motors. Open then discards what an earlier program
  /// left in the queue and the controller, and a stall discards what waits. Without CAP_NET_ADMIN,
  /// Open refuses an interface where frames wait, and after a stall the frames sent before it stay
  /// where they are. Open also refuses a queue longer than kQueueFramesMax.
  bool discard_stale_frames = false;

  /// Restarts of an interface are at least this far apart, so that a bus that stays dead is not
  /// restarted at the rate of the loop. In between, the last frames sent may wait.
  static constexpr std::int64_t kRestartPause_ns = 250'000'000;
  /// Of as many drives as a motion has joints, at up to two frames each, four ticks.
  static constexpr int kMaxInFlight = std::max(64, 8 * kMaxJoints);
  /// A tick of as many drives, at up to four frames each.
  static constexpr int kQueueFramesMax = std::max(32, 4 * kMaxJoints);
};

/// Counts since Open.
struct SocketCanStatistics {
  std::int64_t sent = 0;       ///< Frames given to the kernel.
  std::int64_t confirmed = 0;  ///< Of these, frames that the kernel handed back.
  std::int64_t discarded = 0;  ///< Of these, frames lost with the link or in a restart of it.
  std::int64_t refused = 0;    ///< Frames not taken: stalled, queue full, bus off or down.
  std::int64_t stalls = 0;     ///< Times that confirmations, or room in the queue, did not come.
  std::int64_t received = 0;   ///< Frames of others.
  /// Of `received`, frames with an identifier of `send_ids` and not of `receive_ids`, so that
  /// another program or node commands the same drives.
  std::int64_t foreign_commands = 0;
  std::int64_t dropped = 0;    ///< Frames lost by the kernel because the receive buffer was full.
  std::int64_t overflows = 0;  ///< Times that the controller itself lost received frames.
  std::int64_t error_frames = 0;
  std::int64_t unacknowledged = 0;  ///< Error frames that say that nobody acknowledged.
  std::int64_t protocol_errors = 0;
  std::int64_t arbitration_lost = 0;
  std::int64_t bus_offs = 0;
  std::int64_t restarts = 0;             ///< Restarts of the controller that the kernel reported.
  std::int64_t confirm_time_max_ns = 0;  ///< Longest time from Send to the confirmation.
};

/// A Linux raw CAN socket (kernel Documentation/networking/can.rst): `can0`, `vcan0`, ...
///
/// Bit rate, restart delay and queue length belong to the interface and are set with `ip link`.
///
/// - **Nothing waits to be sent later.** The kernel confirms every frame by handing it back
///   (CAN_RAW_RECV_OWN_MSGS, MSG_CONFIRM). The bus is *stalled* while `in_flight_max` frames are
///   unconfirmed, or one is for longer than `confirm_timeout_ns`, or once the kernel's queue was
///   full (ENOBUFS, EAGAIN): Send drops the frame and answers kWouldBlock until all frames were
///   confirmed or discarded. Receive sees the confirmations, so call it between sending.
/// - Error frames tell the controller's state. After bus-off Send and Receive fail until the kernel
///   reports a restart.
/// - An interface that is down is kLinkDown, and works again once it is up. An interface that was
///   removed (an adapter was unplugged) is kLinkGone and needs a new Open.
/// - Frames carry the kernel's receive time, moved from its real-time clock to CLOCK_MONOTONIC.
///   Frames of other sockets on this machine are received like those of other nodes.
///
/// Receive takes all frames that have come with one system call, and SendAll gives all frames with
/// one. Only Open allocates memory. With `discard_stale_frames` Open also starts a thread: after a
/// stall this thread restarts the interface, which can take long.
class SocketCanBus final : public CanBus {
 public:
  SocketCanBus() noexcept;
  ~SocketCanBus() override;

  /// How Open ended.
  struct OpenResult {
    Status status = Status::kOk;
    int error_number = 0;  ///< errno of the call that failed.
    std::string message;   ///< What is wrong and what to do, naming the interface; empty on kOk.
  };

  /// Binds to an interface, in place of the one that was open. This call may take long: use it
  /// before the loop.
  [[nodiscard]] OpenResult Open(const std::string& interface, const SocketCanConfig& config = {});
  void Close() noexcept;

  /// Before the first successful Open, these answer kLinkDown.
  Status Send(const CanFrame& frame) noexcept override;
  Status SendAll(std::span<const CanFrame> frames, std::size_t& sent) noexcept override;
  Status Receive(ReceivedFrame& received) noexcept override;

  /// Waits for confirmations for up to `confirm_timeout_ns`, and then discards what is still in
  /// flight, if that is permitted. This is for the end of a loop: it blocks, and received frames
  /// are lost.
  void DiscardInFlight() noexcept;

  /// The errno behind the last kLinkDown, kLinkGone or kIoError.
  [[nodiscard]] int last_errno() const noexcept { return errno_; }
  [[nodiscard]] const SocketCanStatistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] CanControllerState controller_state() const noexcept override {
    return controller_;
  }
  /// How many sent frames were neither confirmed nor discarded: they may still go out.
  [[nodiscard]] int in_flight() const noexcept { return in_flight_count_; }
  /// The interface as it was at Open.
  [[nodiscard]] const CanLink& link() const noexcept { return link_; }
  /// Whether stale frames can be discarded; false without `discard_stale_frames`.
  [[nodiscard]] bool can_discard() const noexcept { return restarter_ != nullptr; }
  /// The socket, for programs that wait for frames with poll(2); -1 while closed.
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
