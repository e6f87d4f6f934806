#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "common/core/message_ring.h"
#include "runtime/record/tick_feed.h"

namespace tumbler {

/// Writes the messages of a TickFeed, in their order, on one thread. It may allocate and block.
class TickWriter {
 public:
  TickWriter() = default;
  TickWriter(const TickWriter&) = delete;
  TickWriter& operator=(const TickWriter&) = delete;
  virtual ~TickWriter() = default;

  virtual void Take(std::span<const std::uint8_t> message) = 0;
  /// All that had been pushed was taken.
  virtual void Drained() {}
  /// The same, in a thread, some 200 times a second.
  virtual void Idle() {}
  /// Nothing more will come.
  virtual void Finish() {}
  /// Grows as long as what is written to takes something. Any thread may ask.
  [[nodiscard]] virtual std::int64_t progress() const noexcept = 0;
};

/// For how long what is written to may take nothing in the end. It is asked again and again, since
/// whoever waits for the end may lose it.
using Patience = std::function<std::chrono::milliseconds()>;

/// The room between a loop and a writer [bytes] for 8 s of a run with a frame each way of each
/// joint in a tick, and a true state every 5 ms: no stall of a disk was seen that lasted longer. At
/// most 64 MiB, which is for less than 8 s above 21 kHz with two joints, or 4 kHz with 16.
[[nodiscard]] std::size_t RingBytes(std::size_t joints, double rate_hz);

/// Keeps a control loop and one writer apart: a ring between them, and either a thread that empties
/// it (Start), or the caller does between ticks (Drain). In virtual time the latter loses nothing
/// and makes what is written reproducible.
class TickOutlet {
 public:
  TickOutlet(std::shared_ptr<TickWriter> writer, std::size_t ring_bytes);
  /// Without Stop, what is in the ring is written, as far as the writer takes it within a second.
  ~TickOutlet();
  TickOutlet(const TickOutlet&) = delete;
  TickOutlet& operator=(const TickOutlet&) = delete;

  /// From the loop. @returns false when there is no room.
  [[nodiscard]] bool Push(std::span<const std::uint8_t> message) noexcept {
    return work_->ring.Push(message);
  }
  void Drain() { work_->Drain(); }
  /// Starts the thread, unless it is there.
  void Start();
  /// Writes the rest, and ends the thread.
  /// @param patience  empty: 10 s.
  /// @returns false when the thread was left behind, since its writer took nothing for so long.
  [[nodiscard]] bool Stop(const Patience& patience = {});

 private:
  /// What a thread that was left behind still has.
  struct Work {  // NOLINT(clang-analyzer-optin.performance.Padding): the ring has it on purpose
    Work(std::shared_ptr<TickWriter> writer_in, std::size_t ring_bytes)
        : writer(std::move(writer_in)), storage(ring_bytes), ring(storage) {}
    void Drain();
    void Run();

    std::shared_ptr<TickWriter> writer;
    std::vector<std::uint8_t> storage;
    MessageRing ring;
    std::array<std::uint8_t, kTickMessageBytesMax> message{};
    std::atomic<bool> stop{false};
    std::mutex mutex;
    std::condition_variable ended;
    bool done = false;
  };

  std::shared_ptr<Work> work_;
  std::thread thread_;
  bool stopped_ = false;
};

}  // namespace tumbler
