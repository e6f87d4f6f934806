#pragma once

#include <cstdint>
#include <functional>

namespace tumbler {

/// The source of the control loop's time. For the loop, a robot and a simulation differ in nothing
/// else.
class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;

  [[nodiscard]] virtual std::int64_t now_ns() const noexcept = 0;
  /// For how long altogether this clock has stood still, because the computer was suspended.
  [[nodiscard]] virtual std::int64_t suspended_ns() const noexcept { return 0; }
  /// Returns at or after this time, at once if it has passed.
  virtual void SleepUntil(std::int64_t time_ns) noexcept = 0;
};

/// CLOCK_MONOTONIC. SleepUntil uses absolute deadlines, so that errors do not add up.
class MonotonicClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t now_ns() const noexcept override;
  /// By CLOCK_BOOTTIME, which goes on; accurate to the time between two readings.
  [[nodiscard]] std::int64_t suspended_ns() const noexcept override;
  void SleepUntil(std::int64_t time_ns) noexcept override;
};

/// Virtual time, starting at 0. SleepUntil lets a simulated world run up to the deadline, and
/// returns at once.
class VirtualClock final : public Clock {
 public:
  /// @param advance_to_ns  moves the world on to a time.
  explicit VirtualClock(std::function<void(std::int64_t)> advance_to_ns);

  [[nodiscard]] std::int64_t now_ns() const noexcept override { return now_ns_; }
  void SleepUntil(std::int64_t time_ns) noexcept override;

 private:
  std::function<void(std::int64_t)> advance_to_ns_;
  std::int64_t now_ns_ = 0;
};

/// A simulated world at the pace of CLOCK_MONOTONIC. Time 0 is when the clock was made. A world
/// that cannot keep this pace makes the loop late, as a busy computer would.
class PacedClock final : public Clock {
 public:
  /// @param advance_to_ns  moves the world on to a time.
  explicit PacedClock(std::function<void(std::int64_t)> advance_to_ns);

  [[nodiscard]] std::int64_t now_ns() const noexcept override;
  void SleepUntil(std::int64_t time_ns) noexcept override;

 private:
  std::function<void(std::int64_t)> advance_to_ns_;
  MonotonicClock monotonic_;
  std::int64_t start_ns_;
};

}  // namespace tumbler
