#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tumbler {

/// A queue of messages of any length between exactly one producer thread and one consumer thread,
/// without locks, in memory that its owner provides: RingBuffer for what has no fixed size.
///
/// The thread contract is RingBuffer's. A message is stored as its length (4 bytes) and its bytes.
///
/// Real time: no heap, no locks, no exceptions; Push and Pop finish in a time that depends on the
/// message's length only. Freestanding.
class MessageRing {
 public:
  /// @param storage  outlives the ring. Of its size the largest power of two is used.
  explicit MessageRing(std::span<std::uint8_t> storage) noexcept
      : storage_(storage.first(std::bit_floor(storage.size()))) {}
  MessageRing(const MessageRing&) = delete;  // Its threads know it by address.
  MessageRing& operator=(const MessageRing&) = delete;

  /// Producer only. @returns false when there is no room; nothing was taken.
  [[nodiscard]] bool Push(std::span<const std::uint8_t> message) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t head = head_.load(std::memory_order_acquire);
    const std::size_t room = storage_.size() - (tail - head);
    if (room < kLengthBytes || room - kLengthBytes < message.size()) return false;
    for (std::size_t i = 0; i < kLengthBytes; ++i) {
      At(tail + i) = static_cast<std::uint8_t>(message.size() >> (8 * i));
    }
    for (std::size_t i = 0; i < message.size(); ++i) At(tail + kLengthBytes + i) = message[i];
    tail_.store(tail + kLengthBytes + message.size(), std::memory_order_release);
    return true;
  }

  /// Consumer only: takes the oldest message.
  /// @param out  long enough for any message that was pushed.
  /// @param size  of the message. @returns false when the queue is empty; nothing is written then.
  [[nodiscard]] bool Pop(std::span<std::uint8_t> out, std::size_t& size) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    size = 0;
    for (std::size_t i = 0; i < kLengthBytes; ++i) size |= std::size_t{At(head + i)} << (8 * i);
    for (std::size_t i = 0; i < size; ++i) out[i] = At(head + kLengthBytes + i);
    head_.store(head + kLengthBytes + size, std::memory_order_release);
    return true;
  }

 private:
  static constexpr std::size_t kLengthBytes = 4;
  static constexpr std::size_t kSeparation = 128;  // As RingBuffer.

  [[nodiscard]] std::uint8_t& At(std::size_t index) noexcept {
    return storage_[index & (storage_.size() - 1)];
  }

  std::span<std::uint8_t> storage_;
  // Indices grow for ever and are masked on access.
  alignas(kSeparation) std::atomic<std::size_t> tail_{0};  // written by the producer
  alignas(kSeparation) std::atomic<std::size_t> head_{0};  // written by the consumer
};

}  // namespace tumbler
