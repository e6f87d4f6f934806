#pragma once

#include <array>
#include <cstddef>

namespace tumbler {

/// Eight numbers, one for each lane of a simulation in lanes.
struct alignas(64) Packet {
  static constexpr std::size_t kLanes = 8;
  std::array<double, kLanes> lanes{};

  [[nodiscard]] double lane(std::size_t i) const { return lanes[i]; }
  void set_lane(std::size_t i, double value) { lanes[i] = value; }

  /// The same number in all lanes.
  static Packet Of(double all) {
    Packet packet;
    packet.lanes.fill(all);
    return packet;
  }
};

/// Sixteen numbers of single precision, for lanes that only rank.
struct alignas(64) WidePacket {
  static constexpr std::size_t kLanes = 2 * Packet::kLanes;
  std::array<float, kLanes> lanes{};

  [[nodiscard]] double lane(std::size_t i) const { return static_cast<double>(lanes[i]); }
  void set_lane(std::size_t i, double value) { lanes[i] = static_cast<float>(value); }

  /// The numbers of two packets, rounded.
  static WidePacket Of(const Packet& low, const Packet& high) {
    WidePacket packet;
    for (std::size_t i = 0; i < Packet::kLanes; ++i) {
      packet.set_lane(i, low.lane(i));
      packet.set_lane(i + Packet::kLanes, high.lane(i));
    }
    return packet;
  }
};

}  // namespace tumbler
