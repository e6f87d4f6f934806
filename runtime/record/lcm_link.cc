#include "runtime/record/lcm_link.h"

#include <fmt/format.h>
#include <linux/filter.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>

namespace tumbler {
namespace {

/// Lets no datagram through but those that begin with `LC02`, which are whole messages. The filter
/// of a UDP socket sees the UDP header first, of 8 bytes.
void FilterDatagrams(int socket) {
  constexpr std::uint32_t kMagicAt = 8, kWholeMessage = 0x4c433032, kAll = 0xffffffff;
  std::array<sock_filter, 4> program{{BPF_STMT(BPF_LD | BPF_W | BPF_ABS, kMagicAt),
                                      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kWholeMessage, 0, 1),
                                      BPF_STMT(BPF_RET | BPF_K, kAll),
                                      BPF_STMT(BPF_RET | BPF_K, 0)}};
  const sock_fprog filter{program.size(), program.data()};
  setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter);
}

bool IsUdp(int descriptor) {
  int domain = 0, type = 0;
  socklen_t size = sizeof domain;
  if (getsockopt(descriptor, SOL_SOCKET, SO_DOMAIN, &domain, &size) != 0) return false;
  size = sizeof type;
  if (getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &size) != 0) return false;
  return domain == AF_INET && type == SOCK_DGRAM;
}

/// Filters all UDP sockets of this process, which are LCM's.
void FilterSockets() {
  std::error_code gone;  // A descriptor may be closed while they are looked through.
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", gone)) {
    const std::string name = entry.path().filename().string();
    int descriptor = -1;
    std::from_chars(name.data(), name.data() + name.size(), descriptor);
    if (descriptor >= 0 && IsUdp(descriptor)) FilterDatagrams(descriptor);
  }
}

}  // namespace

void SubscribeToWholeMessages(const std::function<void()>& subscribe) {
  std::atomic<bool> done = false;
  std::thread filters([&done] {
    while (!done) {
      FilterSockets();
      std::this_thread::sleep_for(std::chrono::microseconds(50));  // LCM may try for seconds.
    }
  });
  try {
    subscribe();
  } catch (...) {
    done = true;
    filters.join();
    throw;
  }
  done = true;
  filters.join();
  FilterSockets();
}

void RequireUsable(lcm::LCM& lcm, const std::string& url) {
  if (lcm.good()) return;
  throw std::runtime_error(
      fmt::format("{}: LCM cannot use this URL (udpm needs a multicast route: `ip route add "
                  "224.0.0.0/4 dev IFACE`)",
                  url));
}

void RequireListening(lcm::LCM& lcm, const std::string& url) {
  RequireUsable(lcm, url);
  if (lcm.getFileno() < 0)
    throw std::runtime_error(fmt::format("{}: no LCM server answers there", url));
}

int HandleLcm(lcm::LCM& lcm, int timeout_ms) {
  pollfd wait{lcm.getFileno(), POLLIN, 0};  // Asking for the descriptor tries to mend the link.
  const bool broken = wait.fd < 0;
  const int ready = poll(&wait, broken ? 0 : 1, timeout_ms);
  if (broken) return -1;
  if (ready <= 0) return 0;
  return lcm.handle() == 0 ? 1 : -1;
}

}  // namespace tumbler
