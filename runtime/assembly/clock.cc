#include "runtime/assembly/clock.h"

#include <cerrno>
#include <ctime>
#include <utility>

namespace tumbler {

std::int64_t MonotonicClock::now_ns() const noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

std::int64_t MonotonicClock::suspended_ns() const noexcept {
  timespec boot{};
  clock_gettime(CLOCK_BOOTTIME, &boot);
  return static_cast<std::int64_t>(boot.tv_sec) * 1'000'000'000 + boot.tv_nsec - now_ns();
}

void MonotonicClock::SleepUntil(std::int64_t time_ns) noexcept {
  timespec until{};
  until.tv_sec = static_cast<time_t>(time_ns / 1'000'000'000);
  until.tv_nsec = static_cast<decltype(until.tv_nsec)>(time_ns % 1'000'000'000);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

VirtualClock::VirtualClock(std::function<void(std::int64_t)> advance_to_ns)
    : advance_to_ns_(std::move(advance_to_ns)) {}

void VirtualClock::SleepUntil(std::int64_t time_ns) noexcept {
  if (time_ns <= now_ns_) return;
  now_ns_ = time_ns;
  advance_to_ns_(now_ns_);
}

PacedClock::PacedClock(std::function<void(std::int64_t)> advance_to_ns)
    : advance_to_ns_(std::move(advance_to_ns)), start_ns_(monotonic_.now_ns()) {}

std::int64_t PacedClock::now_ns() const noexcept { return monotonic_.now_ns() - start_ns_; }

void PacedClock::SleepUntil(std::int64_t time_ns) noexcept {
  monotonic_.SleepUntil(start_ns_ + time_ns);
  advance_to_ns_(now_ns());
}

}  // namespace tumbler
