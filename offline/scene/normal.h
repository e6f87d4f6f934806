#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "common/core/functions.h"

namespace tumbler {

/// Independent normal numbers of mean 0 and standard deviation 1. Seed and index determine them;
/// those of the standard library differ between libraries.
class Normal {
 public:
  Normal(std::uint64_t seed, std::uint64_t index) : random_(Mixed(seed, index)) {}

  /// A number that is uniform between 0 and 1, of the same random numbers.
  double DrawUniform() { return Unit(); }

  /// By Marsaglia's polar method.
  double Draw() {
    while (true) {
      const double u = 2 * Unit() - 1, v = 2 * Unit() - 1;
      const double s = u * u + v * v;
      if (s < 1 && s > 0) return u * std::sqrt(-2 * portable::Log(s) / s);
    }
  }

 private:
  /// SplitMix64 of both, so that neighbours in seed or index have nothing in common.
  static std::uint64_t Mixed(std::uint64_t seed, std::uint64_t index) {
    std::uint64_t z = seed * 0x9e3779b97f4a7c15U + index + 1;
    for (int i = 0; i < 2; ++i) {
      z += 0x9e3779b97f4a7c15U;
      z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
      z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
      z ^= z >> 31U;
    }
    return z;
  }
  double Unit() { return static_cast<double>(random_() >> 11U) * 0x1p-53; }

  std::mt19937_64 random_;
};

}  // namespace tumbler
