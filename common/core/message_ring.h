#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace tumbler {

/// A queue of messages of any length between exactly one producer thread and one consumer thread,
/// without locks, in memory that its owner provides. `RingBuffer` does the same for elements of a
/// fixed size, and the thread contract is written there.
///
/// A message is stored as its length (4 bytes) and its bytes.
///
/// Real time: no heap, no locks, no exceptions; Push and Pop finish in a time that depends on the
/// message's length only. Freestanding.
// The padding keeps what the two threads write in different cache lines.
class MessageRing {  // NOLINT(clang-analyzer-optin.performance.Padding)
 public:
  /// @param storage  must outlive the ring. The largest power of two of its size is used.
  explicit MessageRing(std::span<std::uint8_t> storage) noexcept
      : storage_(storage.first(std::bit_floor(storage.size()))) {}
  MessageRing(const MessageRing&) = delete;  // Both threads hold its address.
  MessageRing& operator=(const MessageRing&) = delete;

  /// Producer only: appends a message. @returns false when there is no room; nothing was taken.
  [[nodiscard]] bool Push(std::span<const std::uint8_t> message) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t head = head_.load(std::memory_order_acquire);
    const std::size_t room = storage_.size() - (tail - head);
    if (room < kLengthBytes || room - kLengthBytes < message.size()) return false;
    const auto length = static_cast<std::uint32_t>(message.size());
    std::array<std::uint8_t, kLengthBytes> length_bytes;
    std::memcpy(length_bytes.data(), &length, kLengthBytes);
    CopyIn(tail, length_bytes);
    CopyIn(tail + kLengthBytes, message);
    tail_.store(tail + kLengthBytes + message.size(), std::memory_order_release);
    return true;
  }

  /// Consumer only: takes the oldest message.
  /// @param out   gets the message; must be long enough for any message that was pushed.
  /// @param size  gets the message's length [bytes].
  /// @returns false when the queue is empty; nothing is written then.
  [[nodiscard]] bool Pop(std::span<std::uint8_t> out, std::size_t& size) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    std::array<std::uint8_t, kLengthBytes> length_bytes;
    CopyOut(head, length_bytes);
    std::uint32_t length = 0;
    std::memcpy(&length, length_bytes.data(), kLengthBytes);
    CopyOut(head + kLengthBytes, out.first(length));
    size = length;
    head_.store(head + kLengthBytes + size, std::memory_order_release);
    return true;
  }

 private:
  static constexpr std::size_t kLengthBytes = 4;
  static constexpr std::size_t kSeparation = 128;  // Bytes, as in RingBuffer.

  /// How many of `size` bytes, counted from `index`, lie before the end of the storage. The others
  /// are at its beginning.
  [[nodiscard]] std::size_t BeforeEnd(std::size_t index, std::size_t size) const noexcept {
    return std::min(size, storage_.size() - (index & (storage_.size() - 1)));
  }
  void CopyIn(std::size_t index, std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.empty()) return;
    const std::size_t first = BeforeEnd(index, bytes.size());
    std::memcpy(&storage_[index & (storage_.size() - 1)], bytes.data(), first);
    std::memcpy(storage_.data(), bytes.data() + first, bytes.size() - first);
  }
  void CopyOut(std::size_t index, std::span<std::uint8_t> bytes) const noexcept {
    if (bytes.empty()) return;
    const std::size_t first = BeforeEnd(index, bytes.size());
    std::memcpy(bytes.data(), &storage_[index & (storage_.size() - 1)], first);
    std::memcpy(bytes.data() + first, storage_.data(), bytes.size() - first);
  }

  std::span<std::uint8_t> storage_;
  // Indices count bytes, grow for ever and are masked on access.
  alignas(kSeparation) std::atomic<std::size_t> tail_{0};  // written by the producer
  alignas(kSeparation) std::atomic<std::size_t> head_{0};  // written by the consumer
};

}  // namespace tumbler
