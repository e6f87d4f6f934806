#pragma once

#include <algorithm>
#include <cstdint>

#include "firmware_interface/devices/drive.h"
#include "runtime/executor/tick.h"

namespace tumbler {

/// Counts the replies of one drive against the setpoints that it was sent, tick by tick.
class ReplyWatch {
 public:
  ReplyWatch() = default;
  explicit ReplyWatch(const ReplyRhythm& rhythm) noexcept : rhythm_(rhythm) {}

  /// Takes note of one reply.
  /// @param age_ticks  0: it came since the tick before.
  void Count(std::int32_t age_ticks) noexcept {
    ++replies_;
    newest_age_ticks_ = age_ticks;  // Replies keep their order.
  }

  /// Ends a tick.
  /// @param elapsed          ticks since the last one ended, at least 1.
  /// @param stale_ticks_max  after more ticks in a row with one reply each, replies that are still
  ///                         missing count as lost.
  /// @returns whether there was a reply in the tick.
  bool EndTick(int elapsed, int stale_ticks_max) noexcept {
    const int replies = replies_;
    ++silent_ticks_;
    if (replies != 0) {
      if (newest_age_ticks_ == 0) silent_ticks_ = 0;
      age_ticks_ = newest_age_ticks_;
    } else if (age_ticks_ >= 0) {
      age_ticks_ = std::min<std::int32_t>(age_ticks_ + elapsed, 1 << 30);
    }
    if (replies != 1 || (unanswered_ | sequence_errors_) != 0) {
      Judge(elapsed, stale_ticks_max);
    } else {
      status_ = ReplyStatus::kOk;
    }
    replies_ = 0;
    return replies != 0;
  }

  /// Ticks since the last reply came, by its time stamp. 0: since the tick before; -1: there never
  /// was one.
  [[nodiscard]] std::int32_t age_ticks() const noexcept { return age_ticks_; }
  /// Executed ticks in a row without a new reply. While the loop paused, no drive was asked, and
  /// none of them owes more than one.
  [[nodiscard]] std::int32_t silent_ticks() const noexcept { return silent_ticks_; }
  /// The judgement of the replies of the last tick.
  [[nodiscard]] ReplyStatus status() const noexcept { return status_; }
  /// See `ExecutorConfig::sequence_errors_max`.
  [[nodiscard]] int sequence_errors() const noexcept { return sequence_errors_; }
  void ForgetSequenceErrors() noexcept { sequence_errors_ = 0; }

 private:
  void Judge(int elapsed, int stale_ticks_max) noexcept;

  ReplyRhythm rhythm_;
  ReplyStatus status_ = ReplyStatus::kOk;
  std::int32_t age_ticks_ = -1;
  std::int32_t newest_age_ticks_ = 0;
  std::int32_t silent_ticks_ = 0;
  int replies_ = 0;     ///< Replies in this tick.
  int unanswered_ = 0;  ///< Setpoints without a reply.
  int in_order_ = 0;    ///< Ticks in a row with one reply.
  int sequence_errors_ = 0;
};

}  // namespace tumbler
