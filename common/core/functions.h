#pragma once

/// Elementary functions of doubles that have the same bits on every machine.
///
/// Those of the C library do not: glibc chooses among several versions of each by the processor,
/// and other processors and libraries have still others, that round differently now and then. A
/// search that goes a million steps ends elsewhere after one such bit. These here take nothing but
/// IEEE 754's basic operations, which every machine rounds alike, without contraction
/// (`-ffp-contract=off`). So whatever a primitive, a record or a verdict comes from uses these, and
/// a test sees to it. Exact in the C library, and used from there, are sqrt, fmod, remainder, and
/// what rounds or moves a sign.
///
/// Errors are below one unit in the last place where nothing else is said (tests/common). What is
/// not a number, or infinite, goes through as IEEE 754 and C have it; the sine of -0 is +0. Nothing
/// sets `errno`.
namespace tumbler::portable {

struct SineCosine {
  double sine, cosine;
};

/// Of an angle [rad]. Beyond 1e5 rad the angle is taken modulo the double next to 2 pi: an error
/// below half a unit in its own last place.
[[nodiscard]] SineCosine SinCos(double angle) noexcept;
[[nodiscard]] double Sin(double angle) noexcept;
[[nodiscard]] double Cos(double angle) noexcept;

/// The angle of the vector (x, y) in [-pi, pi], to one and a half units in the last place.
[[nodiscard]] double Atan2(double y, double x) noexcept;

[[nodiscard]] double Exp(double x) noexcept;
/// exp(x) - 1, near 0 as well.
[[nodiscard]] double Expm1(double x) noexcept;
/// The natural logarithm.
[[nodiscard]] double Log(double x) noexcept;
/// log(1 + x), near 0 as well.
[[nodiscard]] double Log1p(double x) noexcept;

/// base^exponent of a positive base as exp(exponent log base): to (2 + 2 |exponent log base|) units
/// in the last place.
[[nodiscard]] double Power(double base, double exponent) noexcept;

/// sqrt(x^2 + y^2), to one unit in the last place, of numbers whose squares are ordinary numbers.
[[nodiscard]] double Length(double x, double y) noexcept;

}  // namespace tumbler::portable
