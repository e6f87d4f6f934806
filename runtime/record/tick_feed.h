#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "runtime/executor/tick_entry.h"
#include "runtime/record/record_blocks.h"

namespace tumbler {

/// Takes the ticks of a run while it goes on, as its flight record has them.
///
/// A message is the kind of a block of a record (one byte), and its content. A tick without content
/// is one that could not be encoded.
class TickSink {
 public:
  TickSink() = default;
  TickSink(const TickSink&) = delete;
  TickSink& operator=(const TickSink&) = delete;
  virtual ~TickSink() = default;
  /// From the loop: it never allocates, locks or blocks, and leaves out what it has no room for.
  virtual void Push(std::span<const std::uint8_t> message) noexcept = 0;
  /// Writes what was pushed. Must not be called once Start was.
  virtual void Drain() = 0;
  /// From now on threads write what is pushed.
  virtual void Start() = 0;
};

/// The kind of a message, and what is in it.
[[nodiscard]] inline BlockKind KindOf(std::span<const std::uint8_t> message) noexcept {
  return static_cast<BlockKind>(message[0]);
}
[[nodiscard]] inline std::span<const std::uint8_t> ContentOf(
    std::span<const std::uint8_t> message) noexcept {
  return message.subspan(1);
}

/// The most bytes that a true state takes: of twelve joints with 200 contacts, and more.
inline constexpr std::size_t kTruthBytesMax = std::size_t{16} << 10U;
/// The most bytes that a message takes.
inline constexpr std::size_t kTickMessageBytesMax =
    1 + std::max(kTickEntryBytesMax, kTruthBytesMax);

/// What a control loop hands its ticks to: each is encoded once, as the flight record has it, and
/// everything that a run puts out is made of that.
class TickFeed {
 public:
  /// Null leaves a sink out. They must outlive the feed.
  TickFeed(std::initializer_list<TickSink*> sinks = {}) {
    for (TickSink* sink : sinks) Add(sink);
  }
  /// Not once ticks are pushed.
  void Add(TickSink* sink) {
    if (sink != nullptr) sinks_.push_back(sink);
  }

  /// Hands a tick to every sink. The loop calls it in every tick; it does not allocate, lock or
  /// block. Parameters are those of EncodeTick.
  void Push(const TickNotes& notes, const TickInput& input, const TickOutput& output) noexcept;
  /// The same for the true state of a simulated robot after the last tick, an LCM message truth_t
  /// of at most kTruthBytesMax bytes. A longer one is left out, and counted.
  void PushTruth(std::span<const std::uint8_t> truth) noexcept;
  /// Says how many true states were too long; empty: none was.
  [[nodiscard]] std::string TruthProblem() const;

  // Of all sinks:
  void Drain() {
    for (TickSink* sink : sinks_) sink->Drain();
  }
  void Start() {
    for (TickSink* sink : sinks_) sink->Start();
  }

 private:
  void PushMessage(BlockKind kind, std::size_t size) noexcept;

  std::vector<TickSink*> sinks_;
  std::int64_t index_ = 0;  ///< Of the next tick.
  std::int64_t long_truths_ = 0;
  std::array<std::uint8_t, kTickMessageBytesMax> message_;
};

}  // namespace tumbler
