#pragma once

#include <array>
#include <bit>
#include <cmath>
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

/// What the bits of floating-point numbers mean (IEEE 754).
template <class Real>
struct RealFormat;
template <>
struct RealFormat<double> {
  using Integer = long long;
  using Memory = Packet;
  static constexpr int kSign = 63, kFraction = 52, kBias = 1023;
  /// 1.5 * 2^52 has the last bit of a whole number where that of an integer is.
  static constexpr double kToInteger = 6755399441055744.0;
};
template <>
struct RealFormat<float> {
  using Integer = int;
  using Memory = WidePacket;
  static constexpr int kSign = 31, kFraction = 23, kBias = 127;
  static constexpr float kToInteger = 12582912.0F;  // 1.5 * 2^23
};

/// Vectors of the compiler's.
template <std::size_t kWidth, class Real>
struct NativeVector {
  using Integer = typename RealFormat<Real>::Integer;
  using Numbers [[gnu::vector_size(kWidth * sizeof(Real))]] = Real;
  using Bits [[gnu::vector_size(kWidth * sizeof(Real))]] = Integer;
};

/// Whether any of a vector's integers, of which all bits are set or none, is not zero.
template <class Bits>
[[gnu::always_inline]] inline bool AnySet(const Bits& bits) {
  // What asks for the sign of every four bytes does for integers of eight, too.
#if defined(__AVX512F__)
  if constexpr (sizeof(Bits) == 64) {
    const auto all = std::bit_cast<__m512i>(bits);
    return _mm512_test_epi64_mask(all, all) != 0;
  }
#endif
#if defined(__AVX__)
  if constexpr (sizeof(Bits) == 32)
    return __builtin_ia32_movmskps256(std::bit_cast<NativeVector<8, float>::Numbers>(bits)) != 0;
#endif
#if defined(__SSE2__)
  if constexpr (sizeof(Bits) == 16)
    return __builtin_ia32_movmskps(std::bit_cast<NativeVector<4, float>::Numbers>(bits)) != 0;
#endif
  using Pair = typename NativeVector<2, double>::Bits;
  constexpr std::size_t kPairs = sizeof(Bits) / 16;  // bytes
  const auto pairs = std::bit_cast<std::array<Pair, kPairs>>(bits);
  Pair any = pairs[0];
  for (std::size_t i = 1; i < pairs.size(); ++i) any |= pairs[i];
  return (any[0] | any[1]) != 0;
}

/// Turns a sine and a cosine by so many quarters, which are whole numbers. They are exchanged where
/// the number is odd; the sine's sign changes with the bit of 2, the cosine's with that of one
/// more. Numbers are a real number or a vector of these, Bits as many integers.
template <class Real, class Numbers, class Bits>
[[gnu::always_inline]] inline void TurnByQuarters(const Numbers& quarters, Numbers& sine,
                                                  Numbers& cosine) {
  using Format = RealFormat<Real>;
  const Bits n = std::bit_cast<Bits>(quarters + Format::kToInteger);
  const Bits odd = n << Format::kSign;
  const Numbers s = odd < 0 ? cosine : sine, c = odd < 0 ? sine : cosine;
  sine = std::bit_cast<Numbers>(std::bit_cast<Bits>(s) ^ ((n & 2) << (Format::kSign - 1)));
  cosine = std::bit_cast<Numbers>(std::bit_cast<Bits>(c) ^ (((n + 1) & 2) << (Format::kSign - 1)));
}
inline void TurnByQuarters(double quarters, double& sine, double& cosine) {
  TurnByQuarters<double, double, long long>(quarters, sine, cosine);
}

/// Lanes of a packet in one vector, which are computed with as one. The compiler turns the
/// operations into those of the processor's vectors. Every lane gets the bits that the same
/// operations on a number give: IEEE 754 rounds each lane alone, and nothing here crosses lanes.
/// @tparam Number  double, or float, of wide packets.
template <std::size_t kWidth, class Number = double>
struct Vector {
  using Real = Number;
  using Format = RealFormat<Real>;
  /// In which the numbers are stored.
  using Memory = typename Format::Memory;
  static constexpr std::size_t kLanes = kWidth;
  using Numbers = typename NativeVector<kWidth, Real>::Numbers;
  using Bits = typename NativeVector<kWidth, Real>::Bits;
  /// One truth value for each lane.
  struct Mask {
    Bits bits;
    friend Mask operator|(const Mask& a, const Mask& b) { return {a.bits | b.bits}; }
  };

  Numbers numbers;

  Vector() = default;
  explicit Vector(const Numbers& these) : numbers(these) {}
  /// The same number in all lanes.
  explicit Vector(double all) : numbers(static_cast<Real>(all) - Numbers{}) {}
  /// Those of a packet from lane `first` on.
  static Vector Of(const Memory& packet, std::size_t first) {
    Vector v;
    __builtin_memcpy(&v.numbers, &packet.lanes[first], sizeof(Numbers));
    return v;
  }
  void Put(Memory& packet, std::size_t first) const {
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
    for (std::size_t k = 0; k < kWidth; ++k) c.numbers[k] = std::sqrt(a.numbers[k]);
    return c;
  }
  /// Whether any lane of the mask is set.
  friend bool Any(const Mask& mask) { return AnySet(mask.bits); }
  /// 2 to the power of whole numbers, as that of scalar.h.
  friend Vector PowerOfTwo(const Vector& k) {
    return Vector(
        std::bit_cast<Numbers>((std::bit_cast<Bits>(k.numbers + Format::kToInteger) + Format::kBias)
                               << Format::kFraction));
  }
  /// Turns a sine and a cosine by so many quarters, whole numbers.
  friend void TurnByQuarters(const Vector& quarters, Vector& sine, Vector& cosine) {
    TurnByQuarters<Real, Numbers, Bits>(quarters.numbers, sine.numbers, cosine.numbers);
  }
};

/// Twice the lanes, in two vectors that are computed with in turn: one's operations fill the time
/// that the other's take.
template <class V>
struct Two {
  using Memory = typename V::Memory;
  static constexpr std::size_t kLanes = 2 * V::kLanes;
  struct Mask {
    typename V::Mask low, high;
    friend Mask operator|(const Mask& a, const Mask& b) { return {a.low | b.low, a.high | b.high}; }
  };

  V low, high;

  Two() = default;
  Two(const V& a, const V& b) : low(a), high(b) {}
  explicit Two(double all) : low(all), high(all) {}
  static Two Of(const Memory& packet, std::size_t first) {
    return {V::Of(packet, first), V::Of(packet, first + V::kLanes)};
  }
  void Put(Memory& packet, std::size_t first) const {
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

/// Whether numbers are of single precision.
template <class S>
inline constexpr bool kIsSingle = false;
template <std::size_t kWidth>
inline constexpr bool kIsSingle<Vector<kWidth, float>> = true;
template <class V>
inline constexpr bool kIsSingle<Two<V>> = kIsSingle<V>;

/// Lanes of packets, as many as S has, as S.
template <class S>
class LanesFrom {
 public:
  static constexpr std::size_t kLanes = S::kLanes;
  explicit LanesFrom(std::size_t first) : first_(first) {}
  S operator()(const typename S::Memory& packet) const { return S::Of(packet, first_); }
  /// What all lanes share.
  S operator()(float all) const { return S(static_cast<double>(all)); }
  void Put(const S& numbers, typename S::Memory& packet) const { numbers.Put(packet, first_); }

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

/// As portable::SineAndCosineInQuarter, in single precision, for |angle| < 1e3, to 1e-7: pi/2 in
/// three parts [CW80], and the least polynomials of their degree within pi/4 (Cephes, sinf.c).
template <class S>
[[gnu::always_inline]] inline portable::QuarterTurn<S> SingleSineAndCosineInQuarter(
    const S& angle) {
  const S to_integer(RealFormat<float>::kToInteger);
  const S quarters = (angle * S(0.636619772) + to_integer) - to_integer;
  const S x = ((angle - quarters * S(1.5703125)) - quarters * S(4.837512969970703125e-4)) -
              quarters * S(7.54978995489188216e-8);
  const S z = x * x;
  const S p = S(-1.6666654611e-1) + z * (S(8.3321608736e-3) + z * S(-1.9515295891e-4));
  const S q =
      S(4.166664568298827e-2) + z * (S(-1.388731625493765e-3) + z * S(2.443315711809948e-5));
  return {quarters, x + x * (z * p), (S(1) - S(0.5) * z) + z * (z * q)};
}

/// Sine and cosine of an angle [rad], for |angle| < 1e5: the same operations in every lane, and the
/// bits of portable::SinCos; of wide packets as SingleSineAndCosineInQuarter.
template <class S>
struct SineAndCosine {
  S sine, cosine;

  explicit SineAndCosine(const S& angle) {
    const auto [quarters, s, c] = InQuarter(angle);
    sine = s;
    cosine = c;
    TurnByQuarters(quarters, sine, cosine);
  }

 private:
  [[gnu::always_inline]] static portable::QuarterTurn<S> InQuarter(const S& angle) {
    if constexpr (kIsSingle<S>) return SingleSineAndCosineInQuarter(angle);
    return portable::SineAndCosineInQuarter(angle);
  }
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler
