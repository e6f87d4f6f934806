#include "runtime/assembly/realtime_thread.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <system_error>
#include <thread>

namespace tumbler {
namespace {

/// Touches the loop's stack once, so that its pages are there (and locked) before they are needed.
void TouchStack() {
  std::array<volatile unsigned char, std::size_t{256} * 1024> pages;
  for (std::size_t i = 0; i < pages.size(); i += 1024) pages[i] = 0;
}

/// The first version of the kernel's `struct sched_attr`, which the C library does not declare.
struct SchedulingAttributes {
  std::uint32_t size = sizeof(SchedulingAttributes);
  std::uint32_t policy = 0;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime = 0;
  std::uint64_t deadline = 0;
  std::uint64_t period = 0;
};

/// @returns errno, or 0.
int SetScheduling(const RealtimeConfig& config) {
  SchedulingAttributes attributes;
  if (config.scheduling == Scheduling::kFifo) {
    attributes.policy = SCHED_FIFO;
    attributes.priority = static_cast<std::uint32_t>(config.priority);
  } else {
    constexpr std::uint32_t kSchedDeadline = 6;
    attributes.policy = kSchedDeadline;
    attributes.period = static_cast<std::uint64_t>(config.period_ns);
    attributes.deadline = attributes.period;
    attributes.runtime = static_cast<std::uint64_t>(
        std::llround(static_cast<double>(config.period_ns) * config.share));
  }
  return syscall(SYS_sched_setattr, 0, &attributes, 0) == 0 ? 0 : errno;
}

int Pin(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  return sched_setaffinity(0, sizeof(set), &set) == 0 ? 0 : errno;
}

std::string Text(int error) { return std::generic_category().message(error); }

}  // namespace

RealtimeGrant EnterRealtime(const RealtimeConfig& config) {
  RealtimeGrant grant;
  const auto problem = [&grant](const std::string& text) {
    if (!grant.problems.empty()) grant.problems += "; ";
    grant.problems += text;
  };
  const std::string name =
      config.scheduling == Scheduling::kFifo
          ? fmt::format("SCHED_FIFO {}", config.priority)
          : fmt::format("SCHED_DEADLINE {:.0f} of {:.0f} us",
                        static_cast<double>(config.period_ns) * config.share / 1e3,
                        static_cast<double>(config.period_ns) / 1e3);
  const int pinned = config.cpu < 0 ? 0 : Pin(config.cpu);
  if (pinned != 0) {
    problem(
        fmt::format("the loop does not run on processor {}: {} (`lscpu` lists those that are "
                    "online)",
                    config.cpu, Text(pinned)));
  }
  const int scheduled = SetScheduling(config);
  if (scheduled != 0) {
    problem(fmt::format(
        "{} is not in force: {} ({})", name, Text(scheduled),
        config.scheduling == Scheduling::kDeadline
            ? "run as root, on all processors, with no more than 95 % of them given away"
            : fmt::format("run as root, or give the user `rtprio {}` in /etc/security/limits.conf",
                          config.priority)));
  }
  grant.scheduled = scheduled == 0 && pinned == 0;
  grant.memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  if (!grant.memory_locked) {
    problem(
        fmt::format("memory is not locked: {} (run as root, or give the user `memlock "
                    "unlimited` in /etc/security/limits.conf)",
                    Text(errno)));
  }
  grant.scheduling = fmt::format(
      "{}{}{}", scheduled == 0 ? name : "time-shared", grant.memory_locked ? ", memory locked" : "",
      config.cpu >= 0 && pinned == 0 ? fmt::format(", processor {}", config.cpu) : "");
  TouchStack();
  return grant;
}

CpuAwake::CpuAwake(const char* device) : descriptor_(open(device, O_WRONLY | O_CLOEXEC)) {
  constexpr std::int32_t kLatency_us = 0;
  if (descriptor_ < 0 || write(descriptor_, &kLatency_us, sizeof kLatency_us) == sizeof kLatency_us)
    return;
  close(descriptor_);
  descriptor_ = -1;
}

CpuAwake::~CpuAwake() {
  if (descriptor_ >= 0) close(descriptor_);
}

RealtimeGrant TryRealtime(const RealtimeConfig& config) {
  RealtimeGrant grant;
  std::thread([&grant, &config] { grant = EnterRealtime(config); }).join();
  return grant;
}

}  // namespace tumbler
