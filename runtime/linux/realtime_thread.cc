#include "runtime/linux/realtime_thread.h"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <system_error>

namespace tumbler {
namespace {

/// The loop's stack is touched once, so that its pages are there (and locked) before they are
/// needed.
void TouchStack() {
  std::array<volatile unsigned char, std::size_t{256} * 1024> pages;
  for (std::size_t i = 0; i < pages.size(); i += 1024) pages[i] = 0;
}

}  // namespace

RealtimeReport EnterRealtime(int priority) {
  RealtimeReport report;
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int scheduled = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  report.fifo = scheduled == 0;
  if (!report.fifo) {
    report.problems += fmt::format(
        "SCHED_FIFO priority {} is not in force: {} (run as root, or give the user `rtprio {}` in "
        "/etc/security/limits.conf)",
        priority, std::generic_category().message(scheduled), priority);
  }
  report.memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  if (!report.memory_locked) {
    report.problems += fmt::format(
        "{}memory is not locked: {} (run as root, or give the user `memlock unlimited` in "
        "/etc/security/limits.conf)",
        report.problems.empty() ? "" : "; ", std::generic_category().message(errno));
  }
  TouchStack();
  return report;
}

}  // namespace tumbler
