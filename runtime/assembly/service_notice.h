#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

namespace tumbler {

/// What a service manager asked for when it started this program (sd_notify(3),
/// sd_watchdog_enabled(3)).
struct ServiceManager {
  std::string socket;            ///< NOTIFY_SOCKET: where it listens. Empty: nobody does.
  std::int64_t watchdog_us = 0;  ///< WATCHDOG_USEC: ends a program silent for so long. 0: never.

  /// By the environment. A watchdog for another process (WATCHDOG_PID) is none.
  static ServiceManager FromEnvironment();
};

/// Tells the service manager, as systemd with `Type=notify` and `WatchdogSec=`, that a loop runs:
/// READY=1 after its first tick, then WATCHDOG=1 at least four times per watchdog's time as long as
/// there are ticks, STOPPING=1 at the end. A loop that hangs ticks no more, so that the manager
/// ends the program, and the drives' watchdogs take over.
///
/// A thread of its own sends: the loop only counts. Datagrams that nobody takes are dropped.
class ServiceNotice {
 public:
  /// Does nothing without a socket, or with a name that no socket can have.
  explicit ServiceNotice(ServiceManager manager);
  ~ServiceNotice();  ///< Says STOPPING=1, if READY=1 was said.
  ServiceNotice(const ServiceNotice&) = delete;
  ServiceNotice& operator=(const ServiceNotice&) = delete;

  /// To be called after every tick. Never waits.
  void NoteTick() noexcept { ticks_.fetch_add(1, std::memory_order_relaxed); }
  /// Says what is new. Called by the thread; without it, by the caller.
  void Look();
  /// Starts the thread. It inherits the policy of the caller's.
  void Start();

 private:
  void Say(const char* text) const;

  ServiceManager manager_;
  int socket_ = -1;
  std::atomic<std::int64_t> ticks_{0};
  std::int64_t seen_ = 0;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool over_ = false;
  std::thread thread_;
};

}  // namespace tumbler
