#pragma once

#include <bit>
#include <cstdint>
#include <random>

#include "common/core/functions.h"

namespace tumbler::portable {

/// FNV-1a of the bits of all functions at a million arguments, of all sizes that occur.
inline std::uint64_t HashOfFunctions() {
  std::mt19937_64 random(20);
  std::uint64_t hash = 0xcbf29ce484222325U;
  const auto take = [&hash](double value) {
    auto bits = std::bit_cast<std::uint64_t>(value);
    for (int i = 0; i < 8; ++i, bits >>= 8U) hash = (hash ^ (bits & 0xffU)) * 0x100000001b3U;
  };
  // A number between -1 and 1, times a power of ten.
  double scale = 1e-8;
  for (int i = 0; i < 100'000; ++i) {
    const auto draw = [&] { return (static_cast<double>(random() >> 11U) * 0x1p-52 - 1) * scale; };
    const double x = draw(), y = draw();
    const auto [sine, cosine] = SinCos(x);
    take(sine);
    take(cosine);
    take(SinCos(100 * y).sine);
    take(Atan2(y, x));
    take(Exp(x));
    take(Expm1(y));
    take(Log(x * x));
    take(Log1p(x * x));
    take(Power(1 + x * x, y / (1 + y * y)));
    take(Length(x, y));
    scale = scale > 1e6 ? 1e-8 : scale * 3;
  }
  return hash;
}

/// What it is on every machine.
inline constexpr std::uint64_t kHashOfFunctions = 0x9ae7d73e01528a80U;

}  // namespace tumbler::portable
