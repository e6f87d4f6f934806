#pragma once

#include <cstdint>
#include <initializer_list>
#include <random>
#include <string>
#include <utility>

#include "common/core/status.h"
#include "firmware_interface/can/frame.h"

namespace tumbler::testing {

/// Frames of random values, written to standard output with the values that the codecs read from
/// them. A line for each frame: `DBC MESSAGE IDENTIFIER HEX signal=value ...`.
/// An x follows an identifier of 29 bits.
class FrameSamples {
 public:
  using Signals = std::initializer_list<std::pair<const char*, double>>;

  /// @param dbc  name of the file that describes the frames from now on, without its ending.
  void Describe(std::string dbc) { dbc_ = std::move(dbc); }
  /// Adds a frame. @param signals  have numbers as the .dbc file shows them.
  void Add(const char* message, const CanFrame& frame, Signals signals);
  /// Ends the program unless the codec has decoded its own frame.
  static void Expect(Status status);

  float Number(float min, float max) {
    return std::uniform_real_distribution<float>(min, max)(random_);
  }
  std::uint32_t Whole(std::uint32_t min, std::uint32_t max) {
    return std::uniform_int_distribution<std::uint32_t>(min, max)(random_);
  }
  std::uint32_t Word() { return Whole(0, 0xffffffff); }
  std::uint8_t Byte() { return static_cast<std::uint8_t>(Whole(0, 255)); }
  std::int32_t Signed() { return static_cast<std::int32_t>(Word()); }

 private:
  std::string dbc_;
  std::mt19937 random_{11};
};

}  // namespace tumbler::testing
