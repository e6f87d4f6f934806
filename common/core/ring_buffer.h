#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <type_traits>

namespace tumbler {

/// A queue of fixed capacity between exactly one producer thread and one consumer thread, without
/// locks.
///
/// Thread contract: one thread calls Push, one thread calls Pop. Any thread may call size(), which
/// is a snapshot. What the producer wrote before Push is visible to the consumer after the Pop that
/// returns the element (release and acquire). Push and Pop finish in a bounded number of steps,
/// whatever the other side does.
///
/// The queue does not count the elements that a full queue refuses: the producer sees each refusal
/// and counts it itself.
///
/// Real time: no heap, no locks, no exceptions. Freestanding.
template <typename T, std::size_t kCapacity>
class RingBuffer {
  static_assert(kCapacity >= 2 && (kCapacity & (kCapacity - 1)) == 0,
                "a power of two: indices wrap by masking");
  static_assert(std::is_trivially_copyable_v<T>,
                "elements are copied without running code of their own");
  static_assert(std::atomic<std::size_t>::is_always_lock_free);

 public:
  RingBuffer() = default;
  RingBuffer(const RingBuffer&) = delete;  // Both threads hold its address.
  RingBuffer& operator=(const RingBuffer&) = delete;

  /// Producer only: appends an element. @returns false when the queue is full; it was not taken.
  [[nodiscard]] bool Push(const T& element) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - known_head_ == kCapacity) {
      known_head_ = head_.load(std::memory_order_acquire);
      if (tail - known_head_ == kCapacity) return false;
    }
    elements_[tail & kMask] = element;
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// Consumer only: takes the oldest element. @returns false when the queue is empty; `element` is
  /// unchanged then.
  [[nodiscard]] bool Pop(T& element) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == known_tail_) {
      known_tail_ = tail_.load(std::memory_order_acquire);
      if (head == known_tail_) return false;
    }
    element = elements_[head & kMask];
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

  /// Elements in the queue at some moment during the call.
  [[nodiscard]] std::size_t size() const noexcept {
    // The head is read first: both only grow, so the difference cannot become negative.
    const std::size_t head = head_.load(std::memory_order_acquire);
    const std::size_t size = tail_.load(std::memory_order_acquire) - head;
    return size < kCapacity ? size : kCapacity;
  }
  [[nodiscard]] static constexpr std::size_t capacity() noexcept { return kCapacity; }

 private:
  // Bytes between what the two threads write. Cache lines of x86-64 and ARM have 64 bytes, but
  // x86-64 fetches them in pairs. std::hardware_destructive_interference_size is no use here,
  // because it may differ between translation units.
  static constexpr std::size_t kSeparation = 128;
  static constexpr std::size_t kMask = kCapacity - 1;

  // Indices grow for ever and are masked on access: so a full queue differs from an empty one
  // without a spare slot.
  alignas(kSeparation) std::atomic<std::size_t> tail_{0};  // written by the producer
  std::size_t known_head_ = 0;                             // the producer's last look at head_
  alignas(kSeparation) std::atomic<std::size_t> head_{0};  // written by the consumer
  std::size_t known_tail_ = 0;                             // the consumer's last look at tail_
  alignas(kSeparation) std::array<T, kCapacity> elements_{};
};

}  // namespace tumbler
