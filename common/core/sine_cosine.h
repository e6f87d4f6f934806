#pragma once

namespace tumbler::portable {

/// The angle less the nearest multiple of pi/2, and its sine and cosine, of which `quarters` says
/// how to turn them back: by that multiple.
template <class S>
struct QuarterTurn {
  S quarters;  ///< A whole number.
  S sine, cosine;
};

/// The sine and cosine of an angle [rad] up to whole quarter turns, for |angle| < 1e5, to 0.8 units
/// in the last place. S is a double, or several in a vector: every lane gets the bits of a double.
///
/// The angle less a multiple of pi/2, in three parts [CW80], lies within pi/4 and is the sum of two
/// numbers. There the polynomials, and how that sum enters, are those of FreeBSD's msun (k_sin.c,
/// k_cos.c).
///
/// Always inline: sources that are compiled for other vectors must not share a copy of it.
///
/// [CW80] W. Cody, W. Waite, Software Manual for the Elementary Functions, 1980.
template <class S>
[[gnu::always_inline]] inline QuarterTurn<S> SineAndCosineInQuarter(const S& angle) {
  const S to_integer(6755399441055744.0);  // 1.5 * 2^52: adding it rounds to an integer
  const S quarters = (angle * S(6.36619772367581382433e-01) + to_integer) - to_integer;
  const S coarse = angle - quarters * S(1.57079632673412561417e+00);
  const S middle = quarters * S(6.07710050630396597660e-11);
  const S fine = coarse - middle;
  const S rest = ((coarse - fine) - middle) - quarters * S(2.02226624879595063154e-21);
  const S x = fine + rest;
  const S y = (fine - x) + rest;

  const S z = x * x, v = z * x;
  const S p = S(8.33333333332248946124e-03) +
              z * (S(-1.98412698298579493134e-04) +
                   z * (S(2.75573137070700676789e-06) +
                        z * (S(-2.50507602534068634195e-08) + z * S(1.58969099521155010221e-10))));
  const S q =
      S(4.16666666666666019037e-02) +
      z * (S(-1.38888888888741095749e-03) +
           z * (S(2.48015872894767294178e-05) +
                z * (S(-2.75573143513906633035e-07) +
                     z * (S(2.08757232129817482790e-09) + z * S(-1.13596475577881948265e-11)))));
  const S half = S(0.5) * z, w = S(1) - half;
  return {quarters, x - ((z * (S(0.5) * y - v * p) - y) - v * S(-1.66666666666666324348e-01)),
          w + (((S(1) - w) - half) + (z * (z * q) - x * y))};
}

}  // namespace tumbler::portable
