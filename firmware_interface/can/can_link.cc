#include "firmware_interface/can/can_link.h"

#include <linux/can/netlink.h>
#include <linux/gen_stats.h>
#include <linux/if.h>
#include <linux/if_arp.h>
#include <linux/pkt_sched.h>
#include <linux/rtnetlink.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

namespace tumbler {

namespace {

/// A netlink socket that is asked one question after the other.
class Netlink {
 public:
  Netlink() : socket_(socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE)) {}
  ~Netlink() {
    if (socket_ >= 0) close(socket_);
  }
  Netlink(const Netlink&) = delete;
  Netlink& operator=(const Netlink&) = delete;

  /// Sends a question and calls `take` for each message of the answer. @returns 0 or an errno.
  template <typename Body, typename Take>
  int Ask(std::uint16_t type, std::uint16_t flags, const Body& body, Take take) {
    if (socket_ < 0) return errno;
    struct {
      nlmsghdr header;
      Body body;
    } question{};
    question.header.nlmsg_len = NLMSG_LENGTH(sizeof body);
    question.header.nlmsg_type = type;
    question.header.nlmsg_flags = static_cast<std::uint16_t>(NLM_F_REQUEST | flags);
    question.body = body;
    if (send(socket_, &question, question.header.nlmsg_len, 0) < 0) return errno;
    const bool many = (flags & NLM_F_DUMP) == NLM_F_DUMP;
    for (;;) {
      alignas(nlmsghdr) std::array<char, 32768> answer;
      const ssize_t size = recv(socket_, answer.data(), answer.size(), 0);
      if (size < 0) return errno;
      auto left = static_cast<unsigned>(size);
      for (auto* message = reinterpret_cast<nlmsghdr*>(answer.data()); NLMSG_OK(message, left);
           message = NLMSG_NEXT(message, left)) {
        if (message->nlmsg_type == NLMSG_DONE) return 0;
        if (message->nlmsg_type == NLMSG_ERROR) {
          return -static_cast<nlmsgerr*>(NLMSG_DATA(message))->error;
        }
        take(*message);
        if (!many) return 0;
      }
    }
  }

 private:
  int socket_;
};

/// Calls `take(type, attribute)` for each attribute of a chain.
template <typename Take>
void ForEachAttribute(rtattr* first, unsigned size, Take take) {
  unsigned left = size;
  for (rtattr* attribute = first; RTA_OK(attribute, left); attribute = RTA_NEXT(attribute, left)) {
    take(attribute->rta_type & NLA_TYPE_MASK, attribute);
  }
}

template <typename Take>
void ForEachNested(rtattr* nest, Take take) {
  ForEachAttribute(static_cast<rtattr*>(RTA_DATA(nest)), static_cast<unsigned>(RTA_PAYLOAD(nest)),
                   take);
}

template <typename Value>
Value ValueOf(rtattr* attribute) {
  Value value{};
  std::memcpy(&value, RTA_DATA(attribute), std::min(sizeof value, RTA_PAYLOAD(attribute)));
  return value;
}

void TakeControllerData(rtattr* data, CanLink& link) {
  ForEachNested(data, [&link](int type, rtattr* attribute) {
    if (type == IFLA_CAN_BITTIMING) {
      const auto timing = ValueOf<can_bittiming>(attribute);
      // All ones mean that the driver is told its rate by other means.
      if (timing.bitrate != 0xffffffffU) link.bit_rate = timing.bitrate;
    } else if (type == IFLA_CAN_CTRLMODE) {
      const std::uint32_t flags = ValueOf<can_ctrlmode>(attribute).flags;
      link.listen_only = (flags & CAN_CTRLMODE_LISTENONLY) != 0;
      link.reports_bus_errors = (flags & CAN_CTRLMODE_BERR_REPORTING) != 0;
    } else if (type == IFLA_CAN_RESTART_MS) {
      link.restart_ms = ValueOf<std::uint32_t>(attribute);
    }
  });
}

void TakeLink(nlmsghdr& message, CanLink& link) {
  const auto* info = static_cast<ifinfomsg*>(NLMSG_DATA(&message));
  link.index = info->ifi_index;
  link.is_can = info->ifi_type == ARPHRD_CAN;
  link.up = (info->ifi_flags & IFF_UP) != 0;
  link.confirms_on_the_wire = (info->ifi_flags & IFF_ECHO) != 0;
  link.has_queue = true;
  auto* first = reinterpret_cast<rtattr*>(static_cast<char*>(NLMSG_DATA(&message)) +
                                          NLMSG_ALIGN(sizeof(ifinfomsg)));
  ForEachAttribute(first, static_cast<unsigned>(NLMSG_PAYLOAD(&message, sizeof(ifinfomsg))),
                   [&link](int type, rtattr* attribute) {
                     if (type == IFLA_TXQLEN) {
                       link.queue_frames_max = ValueOf<std::uint32_t>(attribute);
                     } else if (type == IFLA_QDISC) {
                       link.has_queue =
                           std::string_view(static_cast<char*>(RTA_DATA(attribute))) != "noqueue";
                     } else if (type == IFLA_LINKINFO) {
                       ForEachNested(attribute, [&link](int kind, rtattr* part) {
                         if (kind == IFLA_INFO_DATA) TakeControllerData(part, link);
                       });
                     }
                   });
}

void TakeQueue(nlmsghdr& message, CanLink& link) {
  if (message.nlmsg_type != RTM_NEWQDISC) return;
  const auto* info = static_cast<tcmsg*>(NLMSG_DATA(&message));
  if (info->tcm_ifindex != link.index || info->tcm_parent != TC_H_ROOT) return;
  auto* first = reinterpret_cast<rtattr*>(static_cast<char*>(NLMSG_DATA(&message)) +
                                          NLMSG_ALIGN(sizeof(tcmsg)));
  ForEachAttribute(first, static_cast<unsigned>(NLMSG_PAYLOAD(&message, sizeof(tcmsg))),
                   [&link](int type, rtattr* attribute) {
                     if (type != TCA_STATS2) return;
                     ForEachNested(attribute, [&link](int kind, rtattr* part) {
                       if (kind == TCA_STATS_QUEUE) {
                         link.waiting_frames = ValueOf<gnet_stats_queue>(part).qlen;
                       }
                     });
                   });
}

/// The flags of an interface, read and set by ioctl, for which any socket will do.
class Flags {
 public:
  explicit Flags(const std::string& interface)
      : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    std::copy_n(interface.begin(), std::min<std::size_t>(interface.size(), IFNAMSIZ - 1),
                request_.ifr_name);
  }
  ~Flags() {
    if (socket_ >= 0) close(socket_);
  }
  Flags(const Flags&) = delete;
  Flags& operator=(const Flags&) = delete;

  int Read() noexcept { return ioctl(socket_, SIOCGIFFLAGS, &request_) == 0 ? 0 : errno; }
  int Write(bool up) noexcept {
    request_.ifr_flags = static_cast<short>(up ? request_.ifr_flags | IFF_UP
                                               : request_.ifr_flags & ~static_cast<int>(IFF_UP));
    return ioctl(socket_, SIOCSIFFLAGS, &request_) == 0 ? 0 : errno;
  }
  [[nodiscard]] bool up() const noexcept { return (request_.ifr_flags & IFF_UP) != 0; }

 private:
  int socket_;
  ifreq request_{};
};

}  // namespace

int ReadCanLink(const std::string& interface, CanLink& link) {
  if (interface.empty() || interface.size() >= IFNAMSIZ) return EINVAL;
  struct {
    ifinfomsg info;
    rtattr name;
    std::array<char, IFNAMSIZ> text;
  } which{};
  which.info.ifi_family = AF_UNSPEC;
  which.name.rta_type = IFLA_IFNAME;
  which.name.rta_len = static_cast<unsigned short>(RTA_LENGTH(interface.size() + 1));
  std::copy(interface.begin(), interface.end(), which.text.begin());
  Netlink netlink;
  CanLink found;
  int error =
      netlink.Ask(RTM_GETLINK, 0, which, [&found](nlmsghdr& message) { TakeLink(message, found); });
  if (error != 0) return error;
  tcmsg queues{};
  queues.tcm_ifindex = found.index;
  error = netlink.Ask(RTM_GETQDISC, NLM_F_DUMP, queues,
                      [&found](nlmsghdr& message) { TakeQueue(message, found); });
  if (error != 0) return error;
  link = found;
  return 0;
}

int RestartCanLink(const std::string& interface) noexcept {
  Flags flags(interface);
  int error = flags.Read();
  if (error == 0) error = flags.Write(false);
  if (error == 0) error = flags.Write(true);
  return error;
}

bool MayRestartCanLink(const std::string& interface) noexcept {
  Flags flags(interface);
  return flags.Read() == 0 && flags.Write(flags.up()) == 0;
}

}  // namespace tumbler
