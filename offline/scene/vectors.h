#pragma once

#include <array>
#include <bit>
#include <cstddef>

#include "common/core/scalar.h"
#include "common/core/sine_cosine.h"
#include "offline/scene/packet.h"

namespace tumbler {
// What is compiled for vectors of one kind must not be linked for another: lane_kernel.cc.
inline namespace TUMBLER_LANES_NAMESPACE {

/// Vectors of the compiler's. (Their size cannot be a template's parameter.)
template <std::size_t kWidth>
struct NativeVector;
template <>
struct NativeVector<2> {
  using Numbers = double __attribute__((vector_size(16)));
  using Bits = long long __attribute__((vector_size(16)));
};
template <>
struct NativeVector<4> {
  using Numbers = double __attribute__((vector_size(32)));
  using Bits = long long __attribute__((vector_size(32)));
};
template <>
struct NativeVector<8> {
  using Numbers = double __attribute__((vector_size(64)));
  using Bits = long long __attribute__((vector_size(64)));
};

/// The numbers of a packet in vectors of `kWidth` numbers each, which are computed with as one. The
/// compiler turns the operations into those of the processor's vectors. Every lane gets the bits
/// that the same operations on a double give: IEEE 754 rounds each lane alone, and nothing here
/// crosses lanes.
template <std::size_t kWidth>
struct alignas(Packet) Vectors {
  static constexpr std::size_t kParts = Packet::kLanes / kWidth;
  using Vector = typename NativeVector<kWidth>::Numbers;
  using Bits = typename NativeVector<kWidth>::Bits;
  /// One truth value for each lane.
  struct Mask {
    Bits part[kParts];
  };

  Vector part[kParts];

  Vectors() = default;
  /// The same number in all lanes.
  explicit Vectors(double all) {
    for (Vector& p : part) p = all - Vector{};
  }

  friend Vectors operator+(const Vectors& a, const Vectors& b) {
    Vectors c;
    for (std::size_t i = 0; i < kParts; ++i) c.part[i] = a.part[i] + b.part[i];
    return c;
  }
  friend Vectors operator-(const Vectors& a, const Vectors& b) {
    Vectors c;
    for (std::size_t i = 0; i < kParts; ++i) c.part[i] = a.part[i] - b.part[i];
    return c;
  }
  friend Vectors operator*(const Vectors& a, const Vectors& b) {
    Vectors c;
    for (std::size_t i = 0; i < kParts; ++i) c.part[i] = a.part[i] * b.part[i];
    return c;
  }
  friend Vectors operator/(const Vectors& a, const Vectors& b) {
    Vectors c;
    for (std::size_t i = 0; i < kParts; ++i) c.part[i] = a.part[i] / b.part[i];
    return c;
  }
  friend Vectors operator-(const Vectors& a) {
    Vectors c;
    for (std::size_t i = 0; i < kParts; ++i) c.part[i] = -a.part[i];
    return c;
  }
  Vectors& operator+=(const Vectors& b) { return *this = *this + b; }
  Vectors& operator-=(const Vectors& b) { return *this = *this - b; }
  friend Mask operator<(const Vectors& a, const Vectors& b) {
    Mask mask;
    for (std::size_t i = 0; i < kParts; ++i) mask.part[i] = a.part[i] < b.part[i];
    return mask;
  }

  /// `a` where the mask is set, else `b`.
  friend Vectors Select(const Mask& mask, const Vectors& a, const Vectors& b) {
    Vectors c;
    for (std::size_t i = 0; i < kParts; ++i) c.part[i] = mask.part[i] ? a.part[i] : b.part[i];
    return c;
  }
  friend Vectors Sqrt(const Vectors& a) {
    Vectors c;
    for (std::size_t i = 0; i < kParts; ++i) {
      for (std::size_t k = 0; k < kWidth; ++k) c.part[i][k] = __builtin_sqrt(a.part[i][k]);
    }
    return c;
  }
  /// Whether any lane of the mask is set.
  friend bool Any(const Mask& mask) {
    using Two = typename NativeVector<2>::Bits;
    const auto twos = std::bit_cast<std::array<Two, Packet::kLanes / 2>>(mask);
    const Two any = (twos[0] | twos[1]) | (twos[2] | twos[3]);
    return (any[0] | any[1]) != 0;
  }
};

/// Sine and cosine of an angle [rad], for |angle| < 1e5: the same operations in every lane, and the
/// bits of portable::SinCos.
template <class S>
struct SineAndCosine {
  S sine, cosine;

  explicit SineAndCosine(const S& angle) {
    const auto [quarters, s, c] = portable::SineAndCosineInQuarter(angle);
    const S to_integer(6755399441055744.0);  // 1.5 * 2^52: adding it rounds to an integer
    // The quadrant, -2 ... 2, of which -2 and 2 are the same.
    const S turns = (quarters * S(0.25) + to_integer) - to_integer;
    const S quadrant = quarters - S(4) * turns;
    const S magnitude = Max(quadrant, -quadrant);
    const auto odd = (magnitude - S(1)) * (magnitude - S(1)) < S(0.25);
    const S sine_sign = Select(S(1.5) < magnitude, S(-1), S(1)) *
                        Select(quadrant < S(-0.5), Select(odd, S(-1), S(1)), S(1));
    const S cosine_sign = Select(S(1.5) < magnitude, S(-1), S(1)) *
                          Select(odd, Select(S(0) < quadrant, S(-1), S(1)), S(1));
    sine = sine_sign * Select(odd, c, s);
    cosine = cosine_sign * Select(odd, s, c);
  }
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
