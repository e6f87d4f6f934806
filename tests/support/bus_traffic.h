#pragma once

#include <cstdint>
#include <vector>

#include "firmware_interface/can/bus.h"
#include "firmware_interface/can/simulated_bus.h"

namespace tumbler::testing {

/// The time of a bit at 1 Mbit/s [ns].
inline constexpr std::int64_t kBit = 1000;

/// A frame of eight bytes.
inline CanFrame LongFrame(std::uint32_t id, std::uint8_t first_byte = 0) {
  CanFrame frame;
  frame.id = id;
  frame.size = 8;
  frame.data[0] = first_byte;
  return frame;
}

/// All frames that a port has received.
inline std::vector<ReceivedFrame> Drain(CanBus& port) {
  std::vector<ReceivedFrame> frames;
  ReceivedFrame received;
  while (port.Receive(received) == Status::kOk) frames.push_back(received);
  return frames;
}

inline std::vector<std::uint32_t> Ids(const std::vector<ReceivedFrame>& frames) {
  std::vector<std::uint32_t> ids;
  ids.reserve(frames.size());
  for (const auto& received : frames) ids.push_back(received.frame.id);
  return ids;
}

using List = std::vector<std::uint32_t>;

/// Answers every frame with its own identifier plus 0x100.
class Echo final : public SimulatedNode {
 public:
  explicit Echo(std::int64_t delay_ns) : delay_ns_(delay_ns) {}
  void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept override {
    CanFrame answer = received.frame;
    answer.id += 0x100;
    if (received.frame.id < 0x100) static_cast<void>(port.SendAfter(delay_ns_, answer));
  }

 private:
  std::int64_t delay_ns_;
};

}  // namespace tumbler::testing
