// Reductions and polynomials are those of FreeBSD's msun, of which its sources say:
//
//   Copyright (C) 1993, 2004 by Sun Microsystems, Inc. All rights reserved.
//   Developed at SunSoft, a Sun Microsystems, Inc. business.
//   Permission to use, copy, modify, and distribute this software is freely granted, provided that
//   this notice is preserved.

#include "common/core/functions.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "common/core/exponential.h"
#include "common/core/sine_cosine.h"

namespace tumbler::portable {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

constexpr double kExpOverflows = 7.09782712893383973096e+02;
constexpr double kExpVanishes = -7.45133219101941108420e+02;

/// 2^k of an exponent that ordinary numbers have.
double TwoTo(int k) { return std::bit_cast<double>(static_cast<std::uint64_t>(1023 + k) << 52U); }

/// y * 2^k, rounded once.
double Scaled(double y, int k) {
  if (k > 1023) return y * 2 * TwoTo(k - 1);
  if (k < -1022) return y * TwoTo(k + 1000) * TwoTo(-1000);
  return y * TwoTo(k);
}

/// x as 2^k f, with f from sqrt(2)/2 to sqrt(2). x is positive and not tiny.
struct Parts {
  int k;
  double f;
};
Parts Split(double x) {
  // The top of sqrt(2)/2's bits: adding what lacks to 1 carries into the exponent from there on.
  constexpr std::uint64_t kLeast = std::uint64_t{0x3fe6a09e} << 32U;
  constexpr std::uint64_t kOne = std::uint64_t{0x3ff00000} << 32U;
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x) + (kOne - kLeast);
  const auto k = static_cast<int>(bits >> 52U) - 1023;
  constexpr std::uint64_t kFraction = (std::uint64_t{1} << 52U) - 1;
  return {k, std::bit_cast<double>((bits & kFraction) + kLeast)};
}

/// The arc tangent of a number that is not negative.
double Atan(double x) {
  struct Interval {
    double high, low;  ///< The arc tangent of its middle, as a sum.
  };
  constexpr std::array<Interval, 4> kMiddles = {{
      {4.63647609000806093515e-01, 2.26987774529616870924e-17},  // 1/2
      {7.85398163397448278999e-01, 3.06161699786838301793e-17},  // 1
      {9.82793723247329054082e-01, 1.39033110312309984516e-17},  // 3/2
      {1.57079632679489655800e+00, 6.12323399573676603587e-17},  // infinity
  }};
  if (x >= 0x1p66) return kMiddles[3].high;
  const Interval* middle = nullptr;
  if (x >= 2.4375) {
    middle = &kMiddles[3];
    x = -1 / x;
  } else if (x >= 1.1875) {
    middle = &kMiddles[2];
    x = (x - 1.5) / (1 + 1.5 * x);
  } else if (x >= 0.6875) {
    middle = &kMiddles[1];
    x = (x - 1) / (x + 1);
  } else if (x >= 0.4375) {
    middle = kMiddles.data();
    x = (2 * x - 1) / (2 + x);
  }
  const double z = x * x, w = z * z;
  const double odd =
      z * (3.33333333333329318027e-01 +
           w * (1.42857142725034663711e-01 +
                w * (9.09088713343650656196e-02 +
                     w * (6.66107313738753120669e-02 +
                          w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))));
  const double even =
      w * (-1.99999999998764832476e-01 +
           w * (-1.11111104054623557880e-01 +
                w * (-7.69187620504482999495e-02 +
                     w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
  if (middle == nullptr) return x - x * (odd + even);
  return middle->high - ((x * (odd + even) - middle->low) - x);
}

}  // namespace

SineCosine SinCos(double angle) noexcept {
  constexpr double kReduced = 1e5;
  if (!(std::abs(angle) <= kReduced)) {
    if (!std::isfinite(angle)) return {kNaN, kNaN};
    angle = std::fmod(angle, 2 * std::numbers::pi);
  }
  const auto [quarters, sine, cosine] = SineAndCosineInQuarter(angle);
  switch (static_cast<unsigned>(static_cast<int>(quarters)) & 3U) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

double Sin(double angle) noexcept { return SinCos(angle).sine; }
double Cos(double angle) noexcept { return SinCos(angle).cosine; }

double Atan2(double y, double x) noexcept {
  if (std::isnan(x) || std::isnan(y)) return kNaN;
  constexpr double kPi = std::numbers::pi, kPiLow = 1.2246467991473531772e-16;
  const double steep = std::abs(y), wide = std::abs(x);
  double angle = 0;  // of the vector in the first quadrant
  if (std::isinf(steep) && std::isinf(wide)) {
    angle = kPi / 4;
  } else if (steep != 0 || wide != 0) {
    angle = Atan(wide == 0 ? kInfinity : steep / wide);
  }
  if (std::signbit(x)) angle = kPi - (angle - kPiLow);
  return std::copysign(angle, y);
}

double Exp(double x) noexcept {
  if (!(x <= kExpOverflows)) return std::isnan(x) ? x : kInfinity;
  if (x < kExpVanishes) return 0;
  const int k = static_cast<int>(kOneByLn2 * x + (x < 0 ? -0.5 : 0.5));
  return Scaled(ExpOfDifference<double>(x - k * kLn2High, k * kLn2Low), k);
}

double Expm1(double x) noexcept {
  constexpr double kAllOfOne = 56 * std::numbers::ln2;
  if (!(x <= kExpOverflows)) return std::isnan(x) ? x : kInfinity;
  if (x < -kAllOfOne) return -1;
  if (std::abs(x) < 0x1p-54) return x;
  int k = 0;
  double left = 0;  // x less what the sum of k ln 2 and the reduced x is
  if (std::abs(x) > 0.5 * std::numbers::ln2) {
    k = static_cast<int>(kOneByLn2 * x + (x < 0 ? -0.5 : 0.5));
    const double high = x - k * kLn2High, low = k * kLn2Low;
    x = high - low;
    left = (high - x) - low;
  }
  const ExpLessOne<double> polynomial(x);
  const double square = polynomial.square;
  double e = polynomial.third;
  if (k == 0) return x - (x * e - square);
  e = x * (e - left) - left;
  e -= square;
  if (k == -1) return 0.5 * (x - e) - 0.5;
  if (k == 1) return x < -0.25 ? -2 * (e - (x + 0.5)) : 1 + 2 * (x - e);
  if (k < 0 || k > 56) return Scaled(1 - (e - x), k) - 1;
  if (k < 20) return Scaled((1 - TwoTo(-k)) - (e - x), k);
  return Scaled((x - (e + TwoTo(-k))) + 1, k);
}

double Log(double x) noexcept {
  if (!(x > 0)) return x == 0 ? -kInfinity : kNaN;
  if (x == kInfinity) return x;
  int tiny = 0;
  if (x < std::numeric_limits<double>::min()) {
    x *= 0x1p54;
    tiny = 54;
  }
  const Parts parts = Split(x);
  return LogOfParts<double>(parts.k - tiny, parts.f - 1, 0);
}

double Log1p(double x) noexcept {
  if (!(x > -1)) return x == -1 ? -kInfinity : kNaN;
  if (x == kInfinity || std::abs(x) < 0x1p-53) return x;
  if (x > std::numbers::sqrt2 / 2 - 1 && x < std::numbers::sqrt2 - 1)
    return LogOfParts<double>(0, x, 0);
  const double sum = 1 + x;
  const Parts parts = Split(sum);
  // What the sum has rounded off, as far as it counts.
  double off = 0;
  if (parts.k < 54) off = (parts.k >= 2 ? 1 - (sum - x) : x - (sum - 1)) / sum;
  return LogOfParts<double>(parts.k, parts.f - 1, off);
}

double Power(double base, double exponent) noexcept { return Exp(exponent * Log(base)); }

double Length(double x, double y) noexcept { return std::sqrt(x * x + y * y); }

}  // namespace tumbler::portable
