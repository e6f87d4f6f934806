#pragma once

// The polynomials are those of FreeBSD's msun, as in functions.cc, of which its sources say:
//
//   Copyright (C) 1993, 2004 by Sun Microsystems, Inc. All rights reserved.
//   Developed at SunSoft, a Sun Microsystems, Inc. business.
//   Permission to use, copy, modify, and distribute this software is freely granted, provided that
//   this notice is preserved.

#include <numbers>

#include "common/core/scalar.h"

namespace tumbler::portable {

// The natural logarithm of 2 in two parts, of which the first has few digits: its product with the
// exponent of a double is exact.
inline constexpr double kLn2High = 6.93147180369123816490e-01;
inline constexpr double kLn2Low = 1.90821492927058770002e-10;
inline constexpr double kOneByLn2 = 1.44269504088896338700e+00;

/// e to the power of high - low, which lies within ln(2) / 2: the polynomial of FreeBSD's msun
/// (e_exp.c). S is a double, or several in a vector: every lane gets the bits of a double.
///
/// Always inline: sources that are compiled for other vectors must not share a copy of it.
template <class S>
[[gnu::always_inline]] inline S ExpOfDifference(const S& high, const S& low) {
  const S r = high - low;
  const S t = r * r;
  const S c =
      r - t * (S(1.66666666666666019037e-01) +
               t * (S(-2.77777777770155933842e-03) +
                    t * (S(6.61375632143793436117e-05) + t * (S(-1.65339022054652515390e-06) +
                                                              t * S(4.13813679705723846039e-08)))));
  return S(1) - ((low - (r * c) / (S(2) - c)) - high);
}

/// Exp (functions.h) of a number from -708 to 0, in every lane: the same operations, and its bits.
template <class S>
[[gnu::always_inline]] inline S ExpBelowZero(const S& x) {
  const S to_integer(6755399441055744.0);  // 1.5 * 2^52: adding it rounds to an integer
  const S y = S(kOneByLn2) * x - S(0.5);
  const S nearest = (y + to_integer) - to_integer;
  const S k = Select(nearest < y, nearest + S(1), nearest);  // y without its fraction
  return ExpOfDifference(x - k * S(kLn2High), k * S(kLn2Low)) * PowerOfTwo(k);
}

/// e to the power of x less 1 is x - (x * third - square), of x within ln(2) / 2: the polynomial of
/// FreeBSD's msun (s_expm1.c).
template <class S>
struct ExpLessOne {
  S third, square;

  [[gnu::always_inline]] explicit ExpLessOne(const S& x) {
    const S half = S(0.5) * x;
    square = x * half;
    const S r =
        S(1) + square * (S(-3.33333333333331316428e-02) +
                         square * (S(1.58730158725481460165e-03) +
                                   square * (S(-7.93650757867487942473e-05) +
                                             square * (S(4.00821782732936239552e-06) +
                                                       square * S(-2.01099218183624371326e-07)))));
    const S t = S(3) - r * half;
    third = square * ((r - t) / (S(6) - x * t));
  }
};

/// Expm1 (functions.h) of a number from 0 to 1, in every lane: the same operations, and its bits.
template <class S>
[[gnu::always_inline]] inline S Expm1BelowOne(const S& whole) {
  const auto turns = S(0.5 * std::numbers::ln2) < whole;
  const S k = Select(turns, S(1), S(0));
  const S high = whole - k * S(kLn2High), low = k * S(kLn2Low);
  const S x = high - low, left = (high - x) - low;
  const ExpLessOne<S> e(x);
  const S more = (x * (e.third - left) - left) - e.square;
  const S turned = Select(x < S(-0.25), S(-2) * (more - (x + S(0.5))), S(1) + S(2) * (x - more));
  return Select(turns, turned, x - (x * e.third - e.square));
}

/// log(2^turns (1 + f)) + correction, of f between sqrt(2)/2 - 1 and sqrt(2) - 1: the polynomial of
/// FreeBSD's msun (e_log.c). `turns` is a whole number.
template <class S>
[[gnu::always_inline]] inline S LogOfParts(const S& turns, const S& f, const S& correction) {
  const S half = S(0.5) * f * f;
  const S s = f / (S(2) + f);
  const S z = s * s, w = z * z;
  const S even = w * (S(3.999999999940941908e-01) +
                      w * (S(2.222219843214978396e-01) + w * S(1.531383769920937332e-01)));
  const S odd = z * (S(6.666666666666735130e-01) +
                     w * (S(2.857142874366239149e-01) +
                          w * (S(1.818357216161805012e-01) + w * S(1.479819860510586590e-01))));
  return s * (half + (odd + even)) + (turns * S(kLn2Low) + correction) - half + f +
         turns * S(kLn2High);
}

/// Log1p (functions.h) of a number from 2^-53 to 1, in every lane: the same operations, and its
/// bits.
template <class S>
[[gnu::always_inline]] inline S Log1pBelowOne(const S& x) {
  const auto small = x < S(std::numbers::sqrt2 - 1);
  const S sum = S(1) + x;
  const S off = (x - (sum - S(1))) / sum;  // What the sum has rounded off, as far as it counts.
  return LogOfParts(Select(small, S(0), S(1)), Select(small, x, S(0.5) * sum - S(1)),
                    Select(small, S(0), off));
}

}  // namespace tumbler::portable
