#include "runtime/assembly/service_notice.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

namespace tumbler {
namespace {

std::string_view Variable(const char* name) {
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe)
  return value == nullptr ? std::string_view() : std::string_view(value);
}

/// @returns 0 where there is no such number above 0.
std::int64_t NumberOf(std::string_view text) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number > 0 ? number : 0;
}

}  // namespace

ServiceManager ServiceManager::FromEnvironment() {
  ServiceManager manager;
  manager.socket = Variable("NOTIFY_SOCKET");
  const std::string_view process = Variable("WATCHDOG_PID");
  if (process.empty() || NumberOf(process) == getpid()) {
    manager.watchdog_us = NumberOf(Variable("WATCHDOG_USEC"));
  }
  return manager;
}

ServiceNotice::ServiceNotice(ServiceManager manager) : manager_(std::move(manager)) {
  const std::string& name = manager_.socket;
  sockaddr_un address{};
  const bool possible = name.size() > 1 && name.size() < sizeof address.sun_path &&
                        (name.front() == '/' || name.front() == '@');
  if (possible) socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

ServiceNotice::~ServiceNotice() {
  if (thread_.joinable()) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      over_ = true;
    }
    wake_.notify_one();
    thread_.join();
  }
  Look();
  if (seen_ > 0) Say("STOPPING=1");
  if (socket_ >= 0) close(socket_);
}

void ServiceNotice::Look() {
  const std::int64_t ticks = ticks_.load(std::memory_order_relaxed);
  if (ticks == seen_) return;
  if (seen_ == 0) Say("READY=1");
  if (manager_.watchdog_us > 0) Say("WATCHDOG=1");
  seen_ = ticks;
}

void ServiceNotice::Start() {
  if (socket_ < 0) return;
  constexpr std::int64_t kMost_us = 100'000;  // READY=1 comes no later after the first tick.
  const std::chrono::microseconds pause(
      manager_.watchdog_us > 0 ? std::clamp<std::int64_t>(manager_.watchdog_us / 4, 1000, kMost_us)
                               : kMost_us);
  thread_ = std::thread([this, pause] {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!wake_.wait_for(lock, pause, [this] { return over_; })) Look();
  });
}

void ServiceNotice::Say(const char* text) const {
  if (socket_ < 0) return;
  const std::string& name = manager_.socket;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::copy(name.begin(), name.end(), address.sun_path);
  if (name.front() == '@') address.sun_path[0] = '\0';  // a name that is no file's
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size() +
                                           (name.front() == '@' ? 0 : 1));
  static_cast<void>(sendto(socket_, text, std::strlen(text), MSG_NOSIGNAL,
                           reinterpret_cast<const sockaddr*>(&address), size));
}

}  // namespace tumbler
