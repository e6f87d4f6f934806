#include "firmware_interface/can/socketcan_bus.h"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <system_error>
#include <thread>

namespace tumbler {

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr const char* kNoCan = "this kernel has no CAN sockets (module can)";
constexpr const char* kNoRawCan = "this kernel has no raw CAN sockets (module can_raw)";

/// Messages taken with one system call: room for the own frames and the replies of a tick of eight
/// drives.
constexpr std::size_t kBatch = 32;

std::int64_t ToNs(const timespec& time) noexcept {
  return std::int64_t{time.tv_sec} * kNsPerSecond + time.tv_nsec;
}

std::int64_t Now(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return ToNs(time);
}

CanFrame FromKernel(const can_frame& kernel) noexcept {
  CanFrame frame;
  frame.extended = (kernel.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (kernel.can_id & CAN_RTR_FLAG) != 0;
  frame.id = kernel.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.size = std::min<std::uint8_t>(kernel.can_dlc, 8);
  if (!frame.remote) std::copy_n(kernel.data, frame.size, frame.data.begin());
  return frame;
}

can_frame ToKernel(const CanFrame& frame) noexcept {
  can_frame kernel{};
  kernel.can_id =
      frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U);
  kernel.can_dlc = frame.size;
  std::copy_n(frame.data.begin(), frame.size, kernel.data);
  return kernel;
}

bool IsSendable(const CanFrame& frame) noexcept {
  return frame.size <= 8 && frame.id <= (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
}

SocketCanBus::OpenResult Refuse(Status status, int error_number, const std::string& what) {
  return {status, error_number,
          what + (error_number != 0 ? ": " + std::generic_category().message(error_number) : "")};
}

}  // namespace

/// A thread that restarts the interface when asked. The driver may take long, and the loop cannot
/// wait.
class SocketCanBus::Restarter {
 public:
  explicit Restarter(std::string interface)
      : interface_(std::move(interface)), wake_(eventfd(0, EFD_CLOEXEC)) {
    if (wake_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
    thread_ = std::thread([this] { Work(); });
  }
  ~Restarter() {
    ending_.store(true);
    Wake();
    thread_.join();
    close(wake_);
  }
  Restarter(const Restarter&) = delete;
  Restarter& operator=(const Restarter&) = delete;

  void Request() noexcept {
    if (!busy_.exchange(true)) Wake();
  }
  [[nodiscard]] bool busy() const noexcept { return busy_.load(); }

 private:
  void Wake() noexcept {
    const std::uint64_t one = 1;
    // Cannot fail: the counter is far from full.
    static_cast<void>(!write(wake_, &one, sizeof one));
  }
  void Work() noexcept {
    for (;;) {
      std::uint64_t count = 0;
      if (read(wake_, &count, sizeof count) < 0 && errno != EINTR) return;
      if (ending_.load()) return;
      // If this fails, the interface is down or gone, and the loop learns that from its socket.
      static_cast<void>(RestartCanLink(interface_));
      busy_.store(false);
    }
  }

  std::string interface_;
  int wake_;
  std::atomic<bool> busy_{false};
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

struct SocketCanBus::ReceiveBatch {
  // Three time stamps (software, unused, hardware) and the count of dropped frames.
  static constexpr std::size_t kControlSize =
      CMSG_SPACE(3 * sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t));

  ReceiveBatch() noexcept {
    for (std::size_t i = 0; i < kBatch; ++i) parts[i] = {&frames[i], sizeof frames[i]};
  }

  /// Takes what has come. @returns 0, or the errno of the first message.
  int Fill(int socket) noexcept {
    next = 0;
    count = 0;
    for (std::size_t i = 0; i < kBatch; ++i) {
      messages[i] = {};
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = controls[i].bytes.data();
      messages[i].msg_hdr.msg_controllen = kControlSize;
    }
    oldest_ns = emptied_ns;
    const std::int64_t before_ns = Now(CLOCK_MONOTONIC);
    const int taken = recvmmsg(socket, messages.data(), kBatch, MSG_DONTWAIT, nullptr);
    if (taken < static_cast<int>(kBatch)) emptied_ns = before_ns;
    if (taken < 0) return errno;
    count = static_cast<std::size_t>(taken);
    monotonic_ns = Now(CLOCK_MONOTONIC);
    realtime_ns = Now(CLOCK_REALTIME);
    return 0;
  }
  /// The kernel's time stamps are those of the real-time clock. The age of a frame is the same on
  /// every clock, unless the real-time clock was set in between: then the frame counts as old as it
  /// can be, which is as the time since the socket had no more frames.
  [[nodiscard]] std::int64_t ToMonotonic(std::int64_t stamp_ns) const noexcept {
    const std::int64_t age_ns = realtime_ns - stamp_ns;
    const std::int64_t most_ns = monotonic_ns - oldest_ns;
    return monotonic_ns - (age_ns >= 0 && age_ns < most_ns ? age_ns : most_ns);
  }

  struct Control {
    alignas(cmsghdr) std::array<char, kControlSize> bytes;
  };
  std::array<can_frame, kBatch> frames{};
  std::array<iovec, kBatch> parts{};
  std::array<Control, kBatch> controls{};
  std::array<mmsghdr, kBatch> messages{};
  std::size_t next = 0;
  std::size_t count = 0;
  std::int64_t monotonic_ns = 0;
  std::int64_t realtime_ns = 0;
  std::int64_t emptied_ns = 0;  // when the socket was last known to have no more frames
  std::int64_t oldest_ns = 0;   // the same before this batch
};

SocketCanBus::SocketCanBus() noexcept = default;

SocketCanBus::~SocketCanBus() { Close(); }

void SocketCanBus::Close() noexcept {
  restarter_.reset();
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
  link_ = {};
  link_down_ = false;
  gone_ = false;
  stalled_ = false;
  restart_ns_ = 0;
  controller_ = CanControllerState::kErrorActive;
  in_flight_first_ = 0;
  in_flight_count_ = 0;
  dropped_before_ = 0;
  statistics_ = {};
}

SocketCanBus::OpenResult SocketCanBus::Open(const std::string& interface,
                                            const SocketCanConfig& config) {
  Close();
  OpenResult result = TryOpen(interface, config);
  if (result.status != Status::kOk) Close();
  errno_ = result.error_number;
  return result;
}

SocketCanBus::OpenResult SocketCanBus::TryOpen(const std::string& interface,
                                               const SocketCanConfig& config) {
  if (interface.empty() || interface.size() >= IFNAMSIZ) {
    return Refuse(
        Status::kInvalidArgument, 0,
        "'" + interface + "' is not the name of an interface: allowed are 1 to 15 characters");
  }
  if (config.in_flight_max < 1 || config.in_flight_max > SocketCanConfig::kMaxInFlight ||
      config.confirm_timeout_ns <= 0 ||
      config.send_ids.size() + config.receive_ids.size() > CAN_RAW_FILTER_MAX) {
    return Refuse(
        Status::kInvalidArgument, 0,
        fmt::format("in_flight_max is {}, allowed: from 1 ... {}; confirm_timeout_ns is "
                    "{}, allowed: above 0; identifiers are {}, allowed: up to {}",
                    config.in_flight_max, SocketCanConfig::kMaxInFlight, config.confirm_timeout_ns,
                    config.send_ids.size() + config.receive_ids.size(), CAN_RAW_FILTER_MAX));
  }
  const int error = ReadCanLink(interface, link_);
  socket_ = socket(AF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  const int no_socket = socket_ < 0 ? errno : 0;
  if (error == ENODEV) {
    return Refuse(Status::kLinkDown, error,
                  "interface '" + interface + "' cannot be found" +
                      (no_socket == EAFNOSUPPORT ? ", and " + std::string(kNoCan) : "") +
                      "; `ip link` lists the interfaces there are");
  }
  if (error != 0)
    return Refuse(Status::kIoError, error, "interface '" + interface + "' cannot be examined");
  if (!link_.is_can) {
    return Refuse(Status::kInvalidArgument, 0,
                  "interface '" + interface + "' is not a CAN interface");
  }
  if (!link_.up) {
    return Refuse(Status::kLinkDown, ENETDOWN,
                  "interface '" + interface +
                      "' is down; set its bit rate and bring it up with `ip link set " + interface +
                      " up type can bitrate 1000000`");
  }
  if (no_socket == EAFNOSUPPORT) return Refuse(Status::kIoError, no_socket, kNoCan);
  if (no_socket == EPROTONOSUPPORT) return Refuse(Status::kIoError, no_socket, kNoRawCan);
  if (no_socket != 0) {
    return Refuse(Status::kIoError, no_socket, "no CAN socket can be made for '" + interface + "'");
  }
  if (config.discard_stale_frames) {
    OpenResult result = DiscardOld(interface);
    if (result.status != Status::kOk) return result;
  }
  OpenResult result = SetUp(interface, config);
  if (result.status != Status::kOk) return result;
  if (config.discard_stale_frames && link_.has_queue && MayRestartCanLink(interface)) {
    restarter_ = std::make_unique<Restarter>(interface);
  }
  config_ = config;
  std::ranges::sort(config_.send_ids);
  std::ranges::sort(config_.receive_ids);
  interface_ = interface;
  if (batch_ == nullptr) batch_ = std::make_unique<ReceiveBatch>();
  batch_->next = batch_->count = 0;
  batch_->emptied_ns = Now(CLOCK_MONOTONIC);
  return {};
}

// Called before the socket is bound, so that the socket does not see the interface go down.
SocketCanBus::OpenResult SocketCanBus::DiscardOld(const std::string& interface) {
  if (!link_.has_queue) return {};
  if (link_.queue_frames_max > SocketCanConfig::kQueueFramesMax) {
    return Refuse(Status::kInvalidArgument, 0,
                  fmt::format("interface '{}' has a transmit queue of {} frames, allowed: up to "
                              "{}; set it with `ip link set {} txqueuelen 10`",
                              interface, link_.queue_frames_max, SocketCanConfig::kQueueFramesMax,
                              interface));
  }
  if (MayRestartCanLink(interface)) {
    const int error = RestartCanLink(interface);
    if (error == 0) return {};
    return Refuse(Status::kLinkDown, error,
                  "interface '" + interface +
                      "' did not come up again after it was taken down to discard old frames");
  }
  if (link_.waiting_frames > 0) {
    return Refuse(
        Status::kWouldBlock, 0,
        fmt::format("{} frames of an earlier program wait to be sent on '{}'; discard them with "
                    "`ip link set {} down` and `ip link set {} up`, or run with CAP_NET_ADMIN",
                    link_.waiting_frames, interface, interface, interface));
  }
  return {};
}

SocketCanBus::OpenResult SocketCanBus::SetUp(const std::string& interface,
                                             const SocketCanConfig& config) {
  const can_err_mask_t errors = CAN_ERR_MASK;
  const int on = 1;
  const int stamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  // One filter for each identifier: those the kernel finds in a table, while it would compare every
  // frame with every filter that covers several.
  std::vector<can_filter> filters;
  for (const auto* ids :
       {&config.send_ids, &config.receive_ids}) {  // Own frames come back through filters, too.
    for (const CanId& id : *ids) {
      filters.push_back(
          {id.value | (id.extended ? CAN_EFF_FLAG : 0U),
           (id.extended ? CAN_EFF_MASK : CAN_SFF_MASK) | CAN_EFF_FLAG | CAN_RTR_FLAG});
    }
  }
  const auto set = [this](int level, int option, const void* value, std::size_t size) {
    return setsockopt(socket_, level, option, value, static_cast<socklen_t>(size)) == 0;
  };
  const bool set_up = set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) &&
                      set(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on) &&
                      set(SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps) &&
                      set(SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) &&
                      (filters.empty() || set(SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                                              filters.size() * sizeof(can_filter)));
  if (!set_up) {
    return Refuse(Status::kIoError, errno,
                  "the CAN socket for '" + interface + "' cannot be set up");
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = link_.index;
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return Refuse(Status::kIoError, errno, "the CAN socket cannot be bound to '" + interface + "'");
  }
  return {};
}

// Whether the interface is up (kOk), down or gone.
Status SocketCanBus::AskInterface() const noexcept {
  ifreq request{};
  std::copy_n(interface_.begin(), std::min<std::size_t>(interface_.size(), IFNAMSIZ - 1),
              request.ifr_name);
  if (ioctl(socket_, SIOCGIFFLAGS, &request) != 0) {
    return errno == ENODEV ? Status::kLinkGone : Status::kLinkDown;
  }
  return (request.ifr_flags & IFF_UP) != 0 ? Status::kOk : Status::kLinkDown;
}

Status SocketCanBus::Failed(int error_number) noexcept {
  switch (error_number) {
    case EAGAIN:
    case ENOBUFS:
      return Status::kWouldBlock;
    case ENODEV:
    case ENXIO:
      errno_ = error_number;
      gone_ = true;
      ForgetInFlight();
      return Status::kLinkGone;
    case ENETDOWN:
      errno_ = error_number;
      link_down_ = true;
      ForgetInFlight();  // The kernel empties the queue of an interface that goes down.
      return Status::kLinkDown;
    default:
      errno_ = error_number;
      return Status::kIoError;
  }
}

Status SocketCanBus::LinkStatus() noexcept {
  if (socket_ < 0) return Status::kLinkDown;
  if (gone_) return Status::kLinkGone;
  if (link_down_) {
    const Status status = AskInterface();
    if (status == Status::kLinkGone) {
      gone_ = true;
      errno_ = ENODEV;
    }
    if (status != Status::kOk) return status;
    link_down_ = false;
    controller_ = CanControllerState::kErrorActive;  // A controller that was brought up starts so.
  }
  return Status::kOk;
}

void SocketCanBus::ForgetInFlight() noexcept {
  statistics_.discarded += in_flight_count_;
  in_flight_count_ = 0;
  stalled_ = false;
}

void SocketCanBus::Stall() noexcept {
  if (!stalled_) ++statistics_.stalls;
  stalled_ = true;
  RequestRestart(Now(CLOCK_MONOTONIC));
}

void SocketCanBus::RequestRestart(std::int64_t now_ns) noexcept {
  if (restarter_ == nullptr) return;
  if (restart_ns_ != 0 && now_ns - restart_ns_ < SocketCanConfig::kRestartPause_ns) return;
  restart_ns_ = now_ns;
  restarter_->Request();
}

void SocketCanBus::DiscardInFlight() noexcept {
  // Frames on their way are confirmed soon, and need no discarding.
  const std::int64_t until_ns = Now(CLOCK_MONOTONIC) + config_.confirm_timeout_ns;
  do {
    ReceivedFrame ignored;
    while (Receive(ignored) == Status::kOk) {
    }
    if (in_flight_count_ == 0) return;
    pollfd wait{socket_, POLLIN, 0};
    poll(&wait, 1, 1);
  } while (Now(CLOCK_MONOTONIC) < until_ns);
  if (restarter_ != nullptr && RestartCanLink(interface_) == 0) ForgetInFlight();
}

Status SocketCanBus::CheckStall(std::int64_t now_ns) noexcept {
  if (restarter_ != nullptr && restarter_->busy()) return Status::kWouldBlock;
  if (stalled_ && in_flight_count_ == 0) stalled_ = false;
  if (!stalled_ && in_flight_count_ > 0) {
    const InFlight& oldest = in_flight_[static_cast<std::size_t>(in_flight_first_)];
    if (in_flight_count_ >= config_.in_flight_max ||
        now_ns - oldest.sent_ns > config_.confirm_timeout_ns) {
      Stall();
    }
  } else if (stalled_) {
    RequestRestart(now_ns);
  }
  return stalled_ ? Status::kWouldBlock : Status::kOk;
}

void SocketCanBus::Confirm(const CanFrame& frame, std::int64_t time_ns) noexcept {
  // Confirmations come in the order of sending. What was sent before this frame and is not
  // confirmed never will be.
  while (in_flight_count_ > 0) {
    const InFlight oldest = in_flight_[static_cast<std::size_t>(in_flight_first_)];
    in_flight_first_ = (in_flight_first_ + 1) % SocketCanConfig::kMaxInFlight;
    --in_flight_count_;
    if (oldest.frame == frame) {
      ++statistics_.confirmed;
      statistics_.confirm_time_max_ns =
          std::max(statistics_.confirm_time_max_ns, time_ns - oldest.sent_ns);
      return;
    }
    ++statistics_.discarded;
  }
}

Status SocketCanBus::Send(const CanFrame& frame) noexcept {
  std::size_t sent = 0;
  return SendAll({&frame, 1}, sent);
}

Status SocketCanBus::SendAll(std::span<const CanFrame> frames, std::size_t& sent) noexcept {
  sent = 0;
  const auto stop = [this, &frames, &sent](Status status) {
    statistics_.refused += static_cast<std::int64_t>(frames.size() - sent);
    return status;
  };
  for (const CanFrame& frame : frames) {
    if (!IsSendable(frame)) return stop(Status::kInvalidArgument);
  }
  const Status link = LinkStatus();
  if (link != Status::kOk) return stop(link);
  if (controller_ == CanControllerState::kBusOff) return stop(Status::kBusOff);
  std::array<can_frame, SocketCanConfig::kMaxInFlight> kernel;
  std::array<iovec, SocketCanConfig::kMaxInFlight> parts;
  std::array<mmsghdr, SocketCanConfig::kMaxInFlight> messages{};
  while (sent < frames.size()) {
    const std::int64_t now_ns = Now(CLOCK_MONOTONIC);
    const Status stalled = CheckStall(now_ns);
    if (stalled != Status::kOk) return stop(stalled);
    const auto room = static_cast<std::size_t>(config_.in_flight_max - in_flight_count_);
    const std::size_t count = std::min(room, frames.size() - sent);
    for (std::size_t i = 0; i < count; ++i) {
      kernel[i] = ToKernel(frames[sent + i]);
      parts[i] = {&kernel[i], sizeof kernel[i]};
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
    const int taken =
        sendmmsg(socket_, messages.data(), static_cast<unsigned>(count), MSG_DONTWAIT);
    if (taken < 0) {
      const Status status = Failed(errno);
      if (status == Status::kWouldBlock) Stall();
      return stop(status);
    }
    // If the kernel took fewer than given, the next turn asks again, and learns why.
    for (int i = 0; i < taken; ++i, ++sent, ++in_flight_count_) {
      const auto last = static_cast<std::size_t>((in_flight_first_ + in_flight_count_) %
                                                 SocketCanConfig::kMaxInFlight);
      in_flight_[last] = {frames[sent], now_ns};
    }
    statistics_.sent += taken;
  }
  return Status::kOk;
}

void SocketCanBus::TakeError(std::uint32_t kinds, const std::uint8_t* data) noexcept {
  ++statistics_.error_frames;
  if ((kinds & CAN_ERR_ACK) != 0) ++statistics_.unacknowledged;
  if ((kinds & (CAN_ERR_PROT | CAN_ERR_BUSERROR)) != 0) ++statistics_.protocol_errors;
  if ((kinds & CAN_ERR_LOSTARB) != 0) ++statistics_.arbitration_lost;
  if ((kinds & CAN_ERR_CRTL) != 0) {
    const std::uint8_t what = data[1];
    if ((what & CAN_ERR_CRTL_RX_OVERFLOW) != 0) ++statistics_.overflows;
    if ((what & CAN_ERR_CRTL_ACTIVE) != 0) controller_ = CanControllerState::kErrorActive;
    if ((what & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
      controller_ = CanControllerState::kErrorWarning;
    }
    if ((what & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
      controller_ = CanControllerState::kErrorPassive;
    }
  }
  if ((kinds & CAN_ERR_RESTARTED) != 0) {
    ++statistics_.restarts;
    controller_ = CanControllerState::kErrorActive;
    ForgetInFlight();  // The driver dropped what its controller held.
  }
  if ((kinds & CAN_ERR_BUSOFF) != 0) {
    ++statistics_.bus_offs;
    controller_ = CanControllerState::kBusOff;
    ForgetInFlight();  // The kernel stops and empties the queue.
  }
}

bool SocketCanBus::TakeMessage(std::size_t index, ReceivedFrame& received) noexcept {
  const can_frame& kernel = batch_->frames[index];
  msghdr& message = batch_->messages[index].msg_hdr;
  std::int64_t time_ns = batch_->monotonic_ns;
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr;
       part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level != SOL_SOCKET) continue;
    if (part->cmsg_type == SCM_TIMESTAMPING) {
      scm_timestamping stamps{};
      std::memcpy(&stamps, CMSG_DATA(part), sizeof stamps);
      const std::int64_t stamp_ns = ToNs({stamps.ts[0].tv_sec, stamps.ts[0].tv_nsec});
      if (stamp_ns != 0) time_ns = batch_->ToMonotonic(stamp_ns);
    } else if (part->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t dropped = 0;
      std::memcpy(&dropped, CMSG_DATA(part), sizeof dropped);
      statistics_.dropped += dropped - dropped_before_;
      dropped_before_ = dropped;
    }
  }
  if (batch_->messages[index].msg_len != sizeof kernel) return false;  // No classic frame.
  if ((kernel.can_id & CAN_ERR_FLAG) != 0) {
    TakeError(kernel.can_id, kernel.data);
    return false;
  }
  const CanFrame frame = FromKernel(kernel);
  if ((message.msg_flags & MSG_CONFIRM) != 0) {
    Confirm(frame, time_ns);
    return false;
  }
  const auto has = [&frame](const std::vector<CanId>& ids) {
    return std::ranges::binary_search(ids, IdOf(frame));
  };
  if (!has(config_.receive_ids) && has(config_.send_ids)) {
    ++statistics_.foreign_commands;
  }
  ++statistics_.received;
  received = {frame, time_ns};
  return true;
}

Status SocketCanBus::Receive(ReceivedFrame& received) noexcept {
  const Status link = LinkStatus();
  if (link != Status::kOk) return link;
  // This ends, because a call that finds less than a batch has taken all there was.
  for (;;) {
    while (batch_->next < batch_->count) {
      if (TakeMessage(batch_->next++, received)) return Status::kOk;
    }
    const bool had_some = batch_->count > 0;
    const bool had_all = had_some && batch_->count < kBatch;
    batch_->next = batch_->count = 0;
    const Status status = had_all ? Status::kWouldBlock : [this] {
      const int error = batch_->Fill(socket_);
      return error == 0 ? Status::kOk : Failed(error);
    }();
    if (status == Status::kOk) continue;
    const bool off = controller_ == CanControllerState::kBusOff;
    return status == Status::kWouldBlock && off ? Status::kBusOff : status;
  }
}

}  // namespace tumbler
