#pragma once

#include <cstdint>
#include <string>

namespace tumbler {

/// Whether a bus can carry the frames of a control loop, when every frame is as long as frames can
/// be (`WorstCaseFrameBits`).
///
/// Every period has to carry its frames and, since errors happen, one error: the longest frame
/// breaks at its end, an error frame follows, and the frame is sent again. This costs 31 bits
/// (error flags up to 12, delimiter 8, intermission 3, suspension of an error-passive sender 8) and
/// the longest frame [Da07, Section 3.1]. So
///
///   rate (tick bits + 31 + longest frame's bits) <= bit rate                    (1)
///
/// and the load allowed is less than the whole bus. A second error in a tick costs replies of that
/// tick, which the executor bridges.
///
/// [Da07] R. Davis et al., Controller Area Network (CAN) schedulability analysis: refuted,
/// revisited and revised, Real-Time Systems 35, 2007.
struct BusSchedule {
  std::int64_t bit_rate = 1'000'000;  ///< bit/s
  double rate_hz = 1000;              ///< Of the control loop.
  /// Worst-case bits of all frames of a tick, both ways, intermissions included.
  int tick_bits = 0;
  /// Worst-case bits of the longest of these frames.
  int longest_frame_bits = 0;

  /// Bits of an error besides the frame that is sent again.
  static constexpr int kErrorBits = 31;

  /// Bits that one error costs.
  [[nodiscard]] int recovery_bits() const noexcept { return kErrorBits + longest_frame_bits; }
  /// Share of the bus in use without errors; 1 is all of it.
  [[nodiscard]] double load() const noexcept {
    return tick_bits * rate_hz / static_cast<double>(bit_rate);
  }
  /// Largest `load()` that (1) allows.
  [[nodiscard]] double load_allowed() const noexcept {
    return static_cast<double>(tick_bits) / (tick_bits + recovery_bits());
  }
  /// Largest rate that (1) allows.
  [[nodiscard]] double ceiling_hz() const noexcept {
    return static_cast<double>(bit_rate) / (tick_bits + recovery_bits());
  }
  [[nodiscard]] bool feasible() const noexcept { return rate_hz <= ceiling_hz(); }

  /// The arithmetic in two lines, for people.
  [[nodiscard]] std::string Describe() const;
};

}  // namespace tumbler
