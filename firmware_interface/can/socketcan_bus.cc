#include "firmware_interface/can/socketcan_bus.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <system_error>

namespace tumbler {

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr const char* kNoCan = "this kernel has no CAN sockets (module can)";
constexpr const char* kNoRawCan = "this kernel has no raw CAN sockets (module can_raw)";

std::int64_t ToNs(const timespec& time) noexcept {
  return std::int64_t{time.tv_sec} * kNsPerSecond + time.tv_nsec;
}

std::int64_t Now(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return ToNs(time);
}

// The kernel stamps with the real-time clock. The age of a frame is the same on every clock, unless
// the real-time clock was set in between: then the frame counts as having come just now.
std::int64_t ToMonotonic(std::int64_t realtime_ns) noexcept {
  const std::int64_t age_ns = Now(CLOCK_REALTIME) - realtime_ns;
  const bool plausible = age_ns >= 0 && age_ns < kNsPerSecond;
  return Now(CLOCK_MONOTONIC) - (plausible ? age_ns : 0);
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

SocketCanBus::OpenResult Refuse(Status status, int error_number, const std::string& what) {
  return {status, error_number,
          what + (error_number != 0 ? ": " + std::generic_category().message(error_number) : "")};
}

ifreq RequestFor(const std::string& interface) noexcept {
  ifreq request{};
  std::copy_n(interface.begin(), std::min<std::size_t>(interface.size(), IFNAMSIZ - 1),
              request.ifr_name);
  return request;
}

}  // namespace

SocketCanBus::~SocketCanBus() { Close(); }

void SocketCanBus::Close() noexcept {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
  bus_off_ = false;
  link_down_ = false;
}

SocketCanBus::OpenResult SocketCanBus::Open(const std::string& interface) {
  Close();
  OpenResult result = TryOpen(interface);
  if (result.status != Status::kOk) {
    Close();
    errno_ = result.error_number;
  }
  return result;
}

SocketCanBus::OpenResult SocketCanBus::TryOpen(const std::string& interface) {
  if (interface.empty() || interface.size() >= IFNAMSIZ) {
    return Refuse(
        Status::kInvalidArgument, 0,
        "'" + interface + "' is not the name of an interface: allowed are 1 to 15 characters");
  }
  // An ordinary socket answers questions about interfaces even where the kernel has no CAN.
  const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ifreq index = RequestFor(interface);
  ifreq hardware = RequestFor(interface);
  ifreq flags = RequestFor(interface);
  const bool exists = probe >= 0 && ioctl(probe, SIOCGIFINDEX, &index) == 0;
  const int missing = errno;
  const bool known = exists && ioctl(probe, SIOCGIFHWADDR, &hardware) == 0 &&
                     ioctl(probe, SIOCGIFFLAGS, &flags) == 0;
  const int unknown = errno;
  if (probe >= 0) close(probe);
  socket_ = socket(AF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  const int no_socket = socket_ < 0 ? errno : 0;
  if (!exists) {
    return Refuse(Status::kLinkDown, missing,
                  "interface '" + interface + "' cannot be found" +
                      (no_socket == EAFNOSUPPORT ? ", and " + std::string(kNoCan) : "") +
                      "; `ip link` lists the interfaces there are");
  }
  if (!known)
    return Refuse(Status::kIoError, unknown, "interface '" + interface + "' cannot be examined");
  if (hardware.ifr_hwaddr.sa_family != ARPHRD_CAN) {
    return Refuse(Status::kInvalidArgument, 0,
                  "interface '" + interface + "' is not a CAN interface");
  }
  if ((flags.ifr_flags & IFF_UP) == 0) {
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
  const can_err_mask_t errors = CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;
  const int on = 1;
  if (setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0 ||
      setsockopt(socket_, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0) {
    return Refuse(Status::kIoError, errno,
                  "the CAN socket for '" + interface + "' cannot be set up");
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index.ifr_ifindex;
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return Refuse(Status::kIoError, errno, "the CAN socket cannot be bound to '" + interface + "'");
  }
  interface_ = interface;
  return {};
}

bool SocketCanBus::IsUp() const noexcept {
  ifreq request = RequestFor(interface_);
  return ioctl(socket_, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP) != 0;
}

Status SocketCanBus::Failed(int error_number) noexcept {
  switch (error_number) {
    case EAGAIN:
    case ENOBUFS:
      return Status::kWouldBlock;
    case ENETDOWN:
    case ENODEV:
    case ENXIO:
      errno_ = error_number;
      link_down_ = true;
      return Status::kLinkDown;
    default:
      errno_ = error_number;
      return Status::kIoError;
  }
}

Status SocketCanBus::LinkStatus() noexcept {
  if (socket_ < 0) return Status::kLinkDown;
  if (link_down_) {
    if (!IsUp()) return Status::kLinkDown;
    link_down_ = false;
    bus_off_ = false;  // An interface that was brought up again starts error active.
  }
  return Status::kOk;
}

Status SocketCanBus::Send(const CanFrame& frame) noexcept {
  if (frame.size > 8 || frame.id > (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK)) {
    return Status::kInvalidArgument;
  }
  const Status link = LinkStatus();
  if (link != Status::kOk) return link;
  if (bus_off_) return Status::kBusOff;
  const can_frame kernel = ToKernel(frame);
  const ssize_t sent = send(socket_, &kernel, sizeof kernel, MSG_DONTWAIT);
  if (sent == static_cast<ssize_t>(sizeof kernel)) return Status::kOk;
  return Failed(sent < 0 ? errno : EIO);
}

Status SocketCanBus::Receive(ReceivedFrame& received) noexcept {
  const Status link = LinkStatus();
  if (link != Status::kOk) return link;
  // Error frames are few (bus-off and restart only), so that this ends.
  for (;;) {
    can_frame kernel{};
    iovec part{&kernel, sizeof kernel};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(timespec))> control{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = recvmsg(socket_, &message, MSG_DONTWAIT);
    if (size != static_cast<ssize_t>(sizeof kernel)) {
      const Status status = Failed(size < 0 ? errno : EIO);
      return status == Status::kWouldBlock && bus_off_ ? Status::kBusOff : status;
    }
    if ((kernel.can_id & CAN_ERR_FLAG) != 0) {
      if ((kernel.can_id & CAN_ERR_BUSOFF) != 0) bus_off_ = true;
      if ((kernel.can_id & CAN_ERR_RESTARTED) != 0) bus_off_ = false;
      continue;
    }
    received.frame = FromKernel(kernel);
    received.time_ns = 0;
    for (cmsghdr* part_of = CMSG_FIRSTHDR(&message); part_of != nullptr;
         part_of = CMSG_NXTHDR(&message, part_of)) {
      if (part_of->cmsg_level == SOL_SOCKET && part_of->cmsg_type == SO_TIMESTAMPNS) {
        timespec stamp{};
        std::memcpy(&stamp, CMSG_DATA(part_of), sizeof stamp);
        received.time_ns = ToMonotonic(ToNs(stamp));
      }
    }
    if (received.time_ns == 0) received.time_ns = Now(CLOCK_MONOTONIC);
    return Status::kOk;
  }
}

}  // namespace tumbler
