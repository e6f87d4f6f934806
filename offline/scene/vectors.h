#pragma once

#include <array>
#include <bit>
#include <cstddef>

#if defined(__AVX512F__)
#include <immintrin.h>
#endif

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

/// Whether any of a vector's integers, of which all bits are set or none, is not zero.
template <class Bits>
[[gnu::always_inline]] inline bool AnySet(const Bits& bits) {
#if defined(__AVX512F__)
  if constexpr (sizeof(Bits) == 64) {
    const auto all = std::bit_cast<__m512i>(bits);
    return _mm512_test_epi64_mask(all, all) != 0;
  }
#endif
#if defined(__AVX__)
  if constexpr (sizeof(Bits) == 32)
    return __builtin_ia32_movmskpd256(std::bit_cast<NativeVector<4>::Numbers>(bits)) != 0;
#endif
#if defined(__SSE2__)
  if constexpr (sizeof(Bits) == 16)
    return __builtin_ia32_movmskpd(std::bit_cast<NativeVector<2>::Numbers>(bits)) != 0;
#endif
  using Pair = typename NativeVector<2>::Bits;
  constexpr std::size_t kPairs = sizeof(Bits) / 16;  // bytes
  const auto pairs = std::bit_cast<std::array<Pair, kPairs>>(bits);
  Pair any = pairs[0];
  for (std::size_t i = 1; i < pairs.size(); ++i) any |= pairs[i];
  return (any[0] | any[1]) != 0;
}

/// Turns a sine and a cosine by so many quarters, which are whole numbers. They are exchanged where
/// the number is odd; the sine's sign changes with the bit of 2, the cosine's with that of one
/// more. Numbers are a double or a vector of these, Bits as many integers.
template <class Numbers, class Bits>
[[gnu::always_inline]] inline void TurnByQuarters(const Numbers& quarters, Numbers& sine,
                                                  Numbers& cosine) {
  // 1.5 * 2^52 has the last bit of a whole number where that of an integer is.
  const Bits n = std::bit_cast<Bits>(quarters + 6755399441055744.0);
  const Bits odd = n << 63;
  const Numbers s = odd < 0 ? cosine : sine, c = odd < 0 ? sine : cosine;
  sine = std::bit_cast<Numbers>(std::bit_cast<Bits>(s) ^ ((n & 2) << 62));
  cosine = std::bit_cast<Numbers>(std::bit_cast<Bits>(c) ^ (((n + 1) & 2) << 62));
}
inline void TurnByQuarters(double quarters, double& sine, double& cosine) {
  TurnByQuarters<double, long long>(quarters, sine, cosine);
}

/// Lanes of a packet in one vector, which are computed with as one. The compiler turns the
/// operations into those of the processor's vectors. Every lane gets the bits that the same
/// operations on a double give: IEEE 754 rounds each lane alone, and nothing here crosses lanes.
template <std::size_t kWidth>
struct Vector {
  static constexpr std::size_t kLanes = kWidth;
  using Numbers = typename NativeVector<kWidth>::Numbers;
  using Bits = typename NativeVector<kWidth>::Bits;
  /// One truth value for each lane.
  struct Mask {
    Bits bits;
    friend Mask operator|(const Mask& a, const Mask& b) { return {a.bits | b.bits}; }
  };

  Numbers numbers;

  Vector() = default;
  explicit Vector(const Numbers& these) : numbers(these) {}
  /// The same number in all lanes.
  explicit Vector(double all) : numbers(all - Numbers{}) {}
  /// Those of a packet from lane `first` on.
  static Vector Of(const Packet& packet, std::size_t first) {
    Vector v;
    __builtin_memcpy(&v.numbers, &packet.lanes[first], sizeof(Numbers));
    return v;
  }
  void Put(Packet& packet, std::size_t first) const {
    __builtin_memcpy(&packet.lanes[first], &numbers, sizeof(Numbers));
  }

  friend Vector operator+(const Vector& a, const Vector& b) {
    return Vector(a.numbers + b.numbers);
  }
  friend Vector operator-(const Vector& a, const Vector& b) {
    return Vector(a.numbers - b.numbers);
  }
  friend Vector operator*(const Vector& a, const Vector& b) {
    return Vector(a.numbers * b.numbers);
  }
  friend Vector operator/(const Vector& a, const Vector& b) {
    return Vector(a.numbers / b.numbers);
  }
  friend Vector operator-(const Vector& a) { return Vector(-a.numbers); }
  Vector& operator+=(const Vector& b) { return *this = *this + b; }
  Vector& operator-=(const Vector& b) { return *this = *this - b; }
  friend Mask operator<(const Vector& a, const Vector& b) { return {a.numbers < b.numbers}; }

  /// `a` where the mask is set, else `b`.
  friend Vector Select(const Mask& mask, const Vector& a, const Vector& b) {
    return Vector(mask.bits ? a.numbers : b.numbers);
  }
  friend Vector Sqrt(const Vector& a) {
    Vector c;
    for (std::size_t k = 0; k < kWidth; ++k) c.numbers[k] = __builtin_sqrt(a.numbers[k]);
    return c;
  }
  /// Whether any lane of the mask is set.
  friend bool Any(const Mask& mask) { return AnySet(mask.bits); }
  /// 2 to the power of whole numbers, as that of scalar.h.
  friend Vector PowerOfTwo(const Vector& k) {
    return Vector(
        std::bit_cast<Numbers>((std::bit_cast<Bits>(k.numbers + 6755399441055744.0) + 1023) << 52));
  }
  /// Turns a sine and a cosine by so many quarters, whole numbers.
  friend void TurnByQuarters(const Vector& quarters, Vector& sine, Vector& cosine) {
    TurnByQuarters<Numbers, Bits>(quarters.numbers, sine.numbers, cosine.numbers);
  }
};

/// Twice the lanes, in two vectors that are computed with in turn: one's operations fill the time
/// that the other's take.
template <class V>
struct Two {
  static constexpr std::size_t kLanes = 2 * V::kLanes;
  struct Mask {
    typename V::Mask low, high;
    friend Mask operator|(const Mask& a, const Mask& b) { return {a.low | b.low, a.high | b.high}; }
  };

  V low, high;

  Two() = default;
  Two(const V& a, const V& b) : low(a), high(b) {}
  explicit Two(double all) : low(all), high(all) {}
  static Two Of(const Packet& packet, std::size_t first) {
    return {V::Of(packet, first), V::Of(packet, first + V::kLanes)};
  }
  void Put(Packet& packet, std::size_t first) const {
    low.Put(packet, first);
    high.Put(packet, first + V::kLanes);
  }

  friend Two operator+(const Two& a, const Two& b) { return {a.low + b.low, a.high + b.high}; }
  friend Two operator-(const Two& a, const Two& b) { return {a.low - b.low, a.high - b.high}; }
  friend Two operator*(const Two& a, const Two& b) { return {a.low * b.low, a.high * b.high}; }
  friend Two operator/(const Two& a, const Two& b) { return {a.low / b.low, a.high / b.high}; }
  friend Two operator-(const Two& a) { return {-a.low, -a.high}; }
  Two& operator+=(const Two& b) { return *this = *this + b; }
  Two& operator-=(const Two& b) { return *this = *this - b; }
  friend Mask operator<(const Two& a, const Two& b) { return {a.low < b.low, a.high < b.high}; }
  friend Two Select(const Mask& mask, const Two& a, const Two& b) {
    return {Select(mask.low, a.low, b.low), Select(mask.high, a.high, b.high)};
  }
  friend Two Sqrt(const Two& a) { return {Sqrt(a.low), Sqrt(a.high)}; }
  friend bool Any(const Mask& mask) { return Any(mask.low | mask.high); }
  friend Two PowerOfTwo(const Two& k) { return {PowerOfTwo(k.low), PowerOfTwo(k.high)}; }
  friend void TurnByQuarters(const Two& quarters, Two& sine, Two& cosine) {
    TurnByQuarters(quarters.low, sine.low, cosine.low);
    TurnByQuarters(quarters.high, sine.high, cosine.high);
  }
};

/// Lanes of packets, as many as S has, as S.
template <class S>
class LanesFrom {
 public:
  static constexpr std::size_t kLanes = S::kLanes;
  explicit LanesFrom(std::size_t first) : first_(first) {}
  S operator()(const Packet& packet) const { return S::Of(packet, first_); }
  void Put(const S& numbers, Packet& packet) const { numbers.Put(packet, first_); }

 private:
  std::size_t first_;
};
/// One robot has no lanes.
template <>
class LanesFrom<double> {
 public:
  static constexpr std::size_t kLanes = 1;
  explicit LanesFrom(std::size_t /*first*/) {}
  double operator()(double number) const { return number; }
  void Put(double number, double& to) const { to = number; }
};

/// Sine and cosine of an angle [rad], for |angle| < 1e5: the same operations in every lane, and the
/// bits of portable::SinCos.
template <class S>
struct SineAndCosine {
  S sine, cosine;

  explicit SineAndCosine(const S& angle) {
    const auto [quarters, s, c] = portable::SineAndCosineInQuarter(angle);
    sine = s;
    cosine = c;
    TurnByQuarters(quarters, sine, cosine);
  }
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
