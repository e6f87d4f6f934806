#pragma once

#include <linux/sockios.h>
#include <net/if.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler::testing {

/// Fails with a hint where the kernel has no CAN. These tests need `scripts/guest`, or root on a
/// machine with vcan.
inline void RequireCan() {
  const int probe = socket(AF_CAN, SOCK_RAW, 1);
  if (probe < 0) throw std::runtime_error("this kernel has no CAN: run this with scripts/guest");
  close(probe);
}

/// Runs a command of the shell. Its output is shown only if it fails.
inline void Shell(const std::string& command) {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): no other thread changes the environment.
  if (std::system(("PATH=$PATH:/usr/sbin:/sbin; " + command).c_str()) != 0) {
    throw std::runtime_error("failed: " + command);
  }
}

/// A virtual CAN interface with a transmit queue of 10 frames, which is up until the end of its
/// scope. Each has another name, so that tests can run side by side.
class VirtualCan {
 public:
  VirtualCan() : name_("vc" + std::to_string(getpid()) + NextLetter()) {
    RequireCan();
    Create();
  }
  ~VirtualCan() {
    // NOLINTNEXTLINE(concurrency-mt-unsafe)
    static_cast<void>(!std::system(("ip link del " + name_ + " 2>/dev/null").c_str()));
  }
  VirtualCan(const VirtualCan&) = delete;
  VirtualCan& operator=(const VirtualCan&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  void Create() const { Shell("ip link add " + name_ + " up txqueuelen 10 type vcan"); }
  void Up() const { Shell("ip link set " + name_ + " up"); }
  void Down() const { Shell("ip link set " + name_ + " down"); }
  void Delete() const { Shell("ip link del " + name_); }
  /// Lets this many bits pass in a second, counted in the kernel's structures of 16 bytes for each
  /// frame: 1000 is 8 frames a second. Two frames pass at once, and 10 have room to wait.
  void Throttle(int bits_per_s) {
    Shell("tc qdisc " + std::string(throttled_ ? "change" : "add") + " dev " + name_ +
          " root tbf rate " + std::to_string(bits_per_s) + "bit burst 32 limit 160");
    throttled_ = true;
  }

 private:
  static char NextLetter() {
    static char next = 'a';
    return next++;
  }

  std::string name_;
  bool throttled_ = false;
};

/// A serial CAN adapter (LAWICEL protocol), played by a thread at the other end of a pseudo
/// terminal, with the kernel's slcan interface in front of it. So a test can have any state or
/// error of a CAN controller, and a full queue.
class SerialCan {
 public:
  SerialCan() {
    RequireCan();
    termios raw{};
    cfmakeraw(&raw);
    if (openpty(&adapter_, &terminal_, nullptr, &raw, nullptr) != 0) {
      throw std::runtime_error("openpty");
    }
    const int slcan = 17;  // N_SLCAN
    ifreq request{};
    if (ioctl(terminal_, TIOCSETD, &slcan) != 0 || ioctl(terminal_, SIOCGIFNAME, &request) != 0) {
      throw std::runtime_error("slcan");
    }
    name_ = request.ifr_name;
    reader_ = std::thread([this] { Read(); });  // Bringing the interface up waits for the adapter.
    Shell("ip link set " + name_ + " txqueuelen 10 && ip link set " + name_ +
          " type can bitrate 500000 && ip link set " + name_ + " up");
  }
  ~SerialCan() {
    draining_ = true;
    // NOLINTNEXTLINE(concurrency-mt-unsafe)
    static_cast<void>(!std::system(("ip link set " + name_ + " down").c_str()));
    close(terminal_);
    ending_ = true;
    reader_.join();
    close(adapter_);
  }
  SerialCan(const SerialCan&) = delete;
  SerialCan& operator=(const SerialCan&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  void Up() const { Shell("ip link set " + name_ + " up"); }
  void Down() const { Shell("ip link set " + name_ + " down"); }
  /// Makes the adapter say something, e.g. `sb000255\r`: bus-off, with error counters.
  void Say(const std::string& text) const {
    if (write(adapter_, text.data(), text.size()) != static_cast<ssize_t>(text.size())) {
      throw std::runtime_error("write to the pseudo terminal");
    }
  }
  /// Sets whether the adapter takes frames. When it does not, its bus is stuck.
  void set_draining(bool draining) { draining_ = draining; }
  /// Everything that the adapter was told.
  [[nodiscard]] std::string heard() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return heard_;
  }

 private:
  void Read() {
    std::array<char, 256> buffer;
    while (!ending_) {
      timeval wait{0, 20'000};
      fd_set set;
      FD_ZERO(&set);
      FD_SET(adapter_, &set);
      if (!draining_) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        continue;
      }
      if (select(adapter_ + 1, &set, nullptr, nullptr, &wait) <= 0) continue;
      const ssize_t count = read(adapter_, buffer.data(), buffer.size());
      if (count <= 0) {
        if (count < 0 && errno == EIO) return;  // the terminal was closed
        continue;
      }
      const std::lock_guard<std::mutex> lock(mutex_);
      heard_.append(buffer.data(), static_cast<std::size_t>(count));
    }
  }

  int adapter_ = -1;
  int terminal_ = -1;
  std::string name_;
  std::atomic<bool> draining_{true};
  std::atomic<bool> ending_{false};
  std::mutex mutex_;
  std::string heard_;
  std::thread reader_;
};

/// Makes one bus of two interfaces, as if they were wired together. Other tests have wires, too.
class CanWire {
 public:
  CanWire(const std::string& a, const std::string& b)
      : there_("-s " + a + " -d " + b + " -e"), back_("-s " + b + " -d " + a + " -e") {
    Shell("cangw -A " + there_ + " && cangw -A " + back_);
  }
  ~CanWire() {
    // NOLINTNEXTLINE(concurrency-mt-unsafe)
    static_cast<void>(!std::system(("cangw -D " + there_ + " && cangw -D " + back_).c_str()));
  }
  CanWire(const CanWire&) = delete;
  CanWire& operator=(const CanWire&) = delete;

 private:
  std::string there_, back_;
};

/// The number of receivers that take every frame of an interface: programs such as candump, and
/// routes of cangw.
inline int ReceiversOn(const std::string& interface) {
  std::istringstream lines(ReadFile("/proc/net/can/rcvlist_all"));
  int receivers = 0;
  for (std::string word; lines >> word;) receivers += word == interface ? 1 : 0;
  return receivers;
}

/// Starts candump on an interface, writing to a file. It listens when this returns.
/// @throws std::runtime_error  when it does not listen within 20 s.
inline std::unique_ptr<Program> StartCandump(const std::string& interface, const std::string& log) {
  const int before = ReceiversOn(interface);
  auto candump = std::make_unique<Program>(std::vector<std::string>{
      "/bin/sh", "-c", "exec candump -r 4000000 -L -D " + interface + " >" + log});
  if (!Eventually([&] { return ReceiversOn(interface) > before; })) {
    throw std::runtime_error("candump does not listen on " + interface);
  }
  return candump;
}

}  // namespace tumbler::testing
