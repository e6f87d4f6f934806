#include "runtime/record/tick_feed.h"

#include <fmt/format.h>

#include <algorithm>

namespace tumbler {

void TickFeed::Push(const TickNotes& notes, const TickInput& input,
                    const TickOutput& output) noexcept {
  const std::int64_t index = index_++;
  if (sinks_.empty()) return;
  PushMessage(BlockKind::kTick,
              EncodeTick(index, notes, input, output, std::span(message_).subspan(1)));
}

void TickFeed::PushTruth(std::span<const std::uint8_t> truth) noexcept {
  if (truth.size() > kTruthBytesMax) ++long_truths_;
  if (truth.empty() || truth.size() > kTruthBytesMax) return;
  std::ranges::copy(truth, message_.begin() + 1);
  PushMessage(BlockKind::kTruth, truth.size());
}

std::string TickFeed::TruthProblem() const {
  if (long_truths_ == 0) return "";
  return fmt::format(
      "true states: {} of more than {} bytes are in no output, for their many contacts",
      long_truths_, kTruthBytesMax);
}

void TickFeed::PushMessage(BlockKind kind, std::size_t size) noexcept {
  message_[0] = static_cast<std::uint8_t>(kind);
  for (TickSink* sink : sinks_) sink->Push(std::span(message_).first(1 + size));
}

}  // namespace tumbler
