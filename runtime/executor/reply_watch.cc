#include "runtime/executor/reply_watch.h"

namespace tumbler {

void ReplyWatch::Judge(int elapsed, int stale_ticks_max) noexcept {
  constexpr int kMost = 1000;
  const ReplyStatus before = status_;
  const int replies = replies_;
  ReplyStatus status = ReplyStatus::kOk;
  if (replies == 0) {
    status = ReplyStatus::kNoNewData;
    in_order_ = 0;
    unanswered_ = std::min(unanswered_ + 1, stale_ticks_max);
  } else if (!rhythm_.answers) {
    // One of `per_tick_max` is for drift, which adds up to no more over silent ticks.
    if (replies > rhythm_.per_tick_max * elapsed + (rhythm_.per_tick_max - 1) * unanswered_) {
      status = ReplyStatus::kRepeated;
    } else if (before == ReplyStatus::kNoNewData) {
      status = ReplyStatus::kOkSomeLost;
    }
    unanswered_ = 0;
  } else if (replies == 1) {
    if (before == ReplyStatus::kNoNewData) status = ReplyStatus::kOkSomeLost;
    // Replies that have not come by now are lost.
    if (++in_order_ > stale_ticks_max) unanswered_ = in_order_ = 0;
  } else {
    // Replies keep their order, so the last of them tells of now, whatever came late before it.
    const int surplus = replies - 1;
    status = surplus > unanswered_ ? ReplyStatus::kRepeated : ReplyStatus::kOkSomeLate;
    in_order_ = 0;
    unanswered_ = std::max(unanswered_ - surplus, 0);
  }
  if (status == ReplyStatus::kRepeated) {
    sequence_errors_ = std::min(sequence_errors_ + 2, kMost);
  } else if (replies != 0 && sequence_errors_ > 0) {
    --sequence_errors_;
  }
  status_ = status;
}

}  // namespace tumbler
