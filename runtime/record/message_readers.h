#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/space_truth_t.hpp>
#include <tumbler/state_t.hpp>
#include <tumbler/truth_t.hpp>

namespace tumbler {

/// Readers of messages that anybody may have sent or edited, in datagrams, logs and records. LCM's
/// own readers make room for as many elements as a message claims to have, before they look whether
/// it has them.
///
/// @returns false, having changed nothing, unless the bytes are exactly one message of at most 64
/// KiB, with at most 64 elements in each list and, in a state, at most 32 joints and numbers of
/// states and faults that there are.
[[nodiscard]] bool ReadMessage(std::span<const std::uint8_t> bytes, state_t& message);
[[nodiscard]] bool ReadMessage(std::span<const std::uint8_t> bytes, event_t& message);
[[nodiscard]] bool ReadMessage(std::span<const std::uint8_t> bytes, run_t& message);
[[nodiscard]] bool ReadMessage(std::span<const std::uint8_t> bytes, truth_t& message);
/// A true state of either kind: one in the plane (truth_t) is read as one whose quaternion is all
/// zeros.
[[nodiscard]] bool ReadMessage(std::span<const std::uint8_t> bytes, space_truth_t& message);
/// Whether it was one in space.
[[nodiscard]] inline bool IsInSpace(const space_truth_t& message) {
  return std::ranges::any_of(message.root_quaternion, [](double part) { return part != 0; });
}

/// The same, of bytes of any kind. @returns nothing where that returns false.
template <typename Message>
[[nodiscard]] std::optional<Message> ReadMessage(const void* data, std::size_t size) {
  std::optional<Message> message(std::in_place);
  if (!ReadMessage({static_cast<const std::uint8_t*>(data), size}, *message)) message.reset();
  return message;
}

}  // namespace tumbler
