#include "offline/pages/request_gate.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace tumbler {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::size_t kWaitingMax = 64;
constexpr std::size_t kWaitingOfOneMax = 32;
constexpr std::size_t kRequestMax = 16384;  // bytes, with all headers
constexpr std::chrono::milliseconds kPatience(2000);
constexpr int kBacklog = 512;  // Else the kernel has clients try again after a second.

/// A connection whose request has not come whole.
struct Waiting {
  int socket = -1;
  std::string peer;  // bytes of its address
  SteadyClock::time_point since;
  std::string request;
};

std::string AddressOf(const sockaddr_storage& peer) {
  const auto bytes = [](const auto& address) {
    return std::string(reinterpret_cast<const char*>(&address), sizeof address);
  };
  if (peer.ss_family == AF_INET) return bytes(reinterpret_cast<const sockaddr_in&>(peer).sin_addr);
  return bytes(reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr);
}

/// Whether a line of the headers begins with a name, whose letters are small ones.
bool BeginsWith(std::string_view line, std::string_view name) {
  return line.size() >= name.size() &&
         std::equal(name.begin(), name.end(), line.begin(), [](char a, char b) {
           return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
         });
}

}  // namespace

bool IsWhole(std::string_view request) {
  const std::size_t end = request.find("\n\r\n");
  if (end == std::string_view::npos) return false;
  const std::size_t body = end + 3;
  constexpr std::string_view kLength = "content-length:";
  for (std::size_t at = request.find('\n') + 1; at < end;) {
    const std::string_view line = request.substr(at, request.find('\n', at) - at);
    at += line.size() + 1;
    if (!BeginsWith(line, kLength)) continue;
    std::size_t length = 0;
    const std::size_t digits = std::min(line.find_first_not_of(" \t", kLength.size()), line.size());
    const auto read = std::from_chars(line.data() + digits, line.data() + line.size(), length);
    // Who serves it says what is wrong with it.
    if (read.ec != std::errc() || length > kRequestMax - std::min(body, kRequestMax)) return true;
    return request.size() - body >= length;
  }
  return true;
}

struct RequestGate::Implementation {
  Implementation(int listener_in, std::function<void(int, std::string)> hand_on_in)
      : listener(listener_in), hand_on(std::move(hand_on_in)) {
    const int flags = fcntl(listener, F_GETFL);
    if (wake < 0 || flags < 0 || fcntl(listener, F_SETFL, flags | O_NONBLOCK) != 0 ||
        ::listen(listener, kBacklog) != 0)
      throw std::system_error(errno, std::generic_category(), "the page cannot be served");
    thread = std::thread([this] { Watch(); });
  }
  ~Implementation() {
    stop = true;
    const std::uint64_t one = 1;
    static_cast<void>(write(wake, &one, sizeof one));
    thread.join();
    for (const Waiting& client : waiting) close(client.socket);
    close(wake);
  }

  void Watch() {
    std::vector<pollfd> polled;
    while (!stop) {
      polled.assign({{wake, POLLIN, 0}, {listener, POLLIN, 0}});
      for (const Waiting& client : waiting) polled.push_back({client.socket, POLLIN, 0});
      poll(polled.data(), polled.size(), Timeout());
      const auto now = SteadyClock::now();
      // From the back, so that those before keep their places.
      for (std::size_t i = waiting.size(); i-- > 0;) {
        Waiting& client = waiting[i];
        const bool good = polled[i + 2].revents == 0 || Read(client);
        if (client.socket >= 0 && (!good || now - client.since > kPatience)) Cut(i);
      }
      std::erase_if(waiting, [](const Waiting& client) { return client.socket < 0; });
      if (polled[1].revents != 0) Accept(now);
    }
  }

  /// Until the oldest has waited for too long.
  [[nodiscard]] int Timeout() const {
    if (waiting.empty()) return -1;
    const auto left = waiting.front().since + kPatience - SteadyClock::now();
    const auto left_ms = std::chrono::duration_cast<std::chrono::milliseconds>(left).count();
    return static_cast<int>(std::clamp<long>(left_ms + 1, 1, kPatience.count()));
  }

  /// Takes what has come. @returns false when the connection is to be cut. One that was handed on
  /// has no socket any more.
  bool Read(Waiting& client) const {
    std::array<char, 4096> buffer;
    const ssize_t count = recv(client.socket, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (count < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    if (count == 0 || client.request.size() + static_cast<std::size_t>(count) > kRequestMax)
      return false;
    client.request.append(buffer.data(), static_cast<std::size_t>(count));
    if (IsWhole(client.request))
      hand_on(std::exchange(client.socket, -1), std::move(client.request));
    return true;
  }

  void Cut(std::size_t index) {
    close(waiting[index].socket);
    waiting.erase(waiting.begin() + static_cast<std::ptrdiff_t>(index));
  }

  void Accept(SteadyClock::time_point now) {
    for (std::size_t i = 0; i < kWaitingMax; ++i) {  // Others have to be looked at in between.
      sockaddr_storage address{};
      socklen_t size = sizeof address;
      const int socket = accept4(listener, reinterpret_cast<sockaddr*>(&address), &size,
                                 SOCK_NONBLOCK | SOCK_CLOEXEC);
      if (socket < 0) {
        if (errno == EAGAIN || errno == EWOULDBLOCK) return;
        if (errno != EMFILE && errno != ENFILE && errno != ENOBUFS && errno != ENOMEM) continue;
        if (waiting.empty()) {
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
          return;
        }
        Cut(0);
        continue;
      }
      Waiting client{socket, AddressOf(address), now, ""};
      MakeRoom(client.peer);
      // Most requests come with their connection.
      if (!Read(client)) {
        close(client.socket);
      } else if (client.socket >= 0) {
        waiting.push_back(std::move(client));
      }
    }
  }

  /// Cuts the oldest connection of an address that has too many, or the oldest of all.
  void MakeRoom(const std::string& peer) {
    const auto is_his = [&peer](const Waiting& client) { return client.peer == peer; };
    if (std::count_if(waiting.begin(), waiting.end(), is_his) >=
        static_cast<std::ptrdiff_t>(kWaitingOfOneMax)) {
      const auto oldest = std::find_if(waiting.begin(), waiting.end(), is_his);
      Cut(static_cast<std::size_t>(oldest - waiting.begin()));
    } else if (waiting.size() >= kWaitingMax) {
      Cut(0);
    }
  }

  int listener;
  std::function<void(int, std::string)> hand_on;
  int wake = eventfd(0, EFD_CLOEXEC);
  std::vector<Waiting> waiting;  // the oldest first; the thread's
  std::atomic<bool> stop{false};
  std::thread thread;
};

RequestGate::RequestGate(int listener, std::function<void(int, std::string)> hand_on)
    : implementation_(std::make_unique<Implementation>(listener, std::move(hand_on))) {}
RequestGate::~RequestGate() = default;

}  // namespace tumbler
