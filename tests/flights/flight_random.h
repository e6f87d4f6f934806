#pragma once

#include <cmath>
#include <cstdint>

namespace tumbler::testing {

/// Random numbers that are the same on every machine: splitmix64. Numbers of two streams of a seed
/// have nothing to do with each other.
class FlightRandom {
 public:
  explicit FlightRandom(std::uint64_t seed, std::uint64_t stream = 0)
      : state_(seed * 0x9e37'79b9'7f4a'7c15U ^ (stream + 1) * 0xd134'2543'de82'ef95U) {}

  std::uint64_t Bits() {
    state_ += 0x9e37'79b9'7f4a'7c15U;
    std::uint64_t x = state_;
    x = (x ^ x >> 30) * 0xbf58'476d'1ce4'e5b9U;
    x = (x ^ x >> 27) * 0x94d0'49bb'1331'11ebU;
    return x ^ x >> 31;
  }
  /// 0 ... below - 1. @pre below > 0
  int Below(int below) { return static_cast<int>(Bits() % static_cast<std::uint64_t>(below)); }
  /// low ... high, both included.
  int Within(int low, int high) { return low + Below(high - low + 1); }
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(Bits() >> 11) * 0x1p-53;
  }
  float Real(double low, double high) { return static_cast<float>(Uniform(low, high)); }
  /// A number of any order of magnitude between two. @pre 0 < low <= high
  double Logarithmic(double low, double high) {
    return std::exp(Uniform(std::log(low), std::log(high)));
  }
  bool Chance(double probability) { return Uniform(0, 1) < probability; }

 private:
  std::uint64_t state_;
};

}  // namespace tumbler::testing
