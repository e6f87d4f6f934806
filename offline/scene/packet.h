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

}  // namespace tumbler
