#pragma once

#include <array>
#include <cstddef>

#include "offline/stepper/tableau.h"

namespace tumbler {

/// Single steps of few equations y' = f(t, y), without heap. Long states, and steps whose length
/// follows from their error, are those of the `Integrator`.
///
/// What is integrated is a callable `slope(s, y_s, k)`, which is asked for k = f(t_s, y_s) at every
/// stage s of a step, and may look around there: what a simulation takes note of at the start of a
/// step, it does at stage 0, where y_s is y. It returns whether to go on.

/// The state of a mechanical system of n coordinates: n positions, then their n velocities.
template <std::size_t kCapacity>
using MechanicalState = std::array<double, 2 * kCapacity>;

/// One step of the first `size` numbers of y by an explicit Runge-Kutta scheme whose stages are
/// chained; stage s is at the time t + c_s h. @returns false, with y as it was, when `slope` does.
template <const Tableau& kScheme, std::size_t kCapacity, class Slope>
inline bool StepRungeKutta(std::array<double, kCapacity>& y, std::size_t size, double h,
                           Slope&& slope) {
  static_assert(kScheme.chained());
  std::array<double, kCapacity> later, k, sum;
  for (std::size_t i = 0; i < size; ++i) sum[i] = 0;
  for (std::size_t s = 0; s < kScheme.stages; ++s) {
    if (!slope(static_cast<int>(s), s == 0 ? y : later, k.data())) return false;
    for (std::size_t i = 0; i < size; ++i) sum[i] += kScheme.b[s] * k[i];
    if (s + 1 == kScheme.stages) break;
    const double a = h * kScheme.a[s + 1][s];
    for (std::size_t i = 0; i < size; ++i) later[i] = y[i] + a * k[i];
  }
  for (std::size_t i = 0; i < size; ++i) y[i] += h * sum[i];
  return true;
}

/// One step of a mechanical system of n coordinates by the semi-implicit Euler method: the
/// velocities first, then the positions with the new velocities. One stage, of order 1, and stable
/// where oscillations are.
/// @param air_per_s  numerical air: velocities fade by this part of themselves.
/// @returns false, with y as it was, when `slope` does.
template <std::size_t kCapacity, class Slope>
inline bool StepSemiImplicitEuler(std::array<double, kCapacity>& y, std::size_t n, double h,
                                  Slope&& slope, double air_per_s = 0) {
  std::array<double, kCapacity> k;
  if (!slope(0, y, k.data())) return false;
  for (std::size_t i = 0; i < n; ++i) {
    y[n + i] = (y[n + i] + h * k[n + i]) * (1 - air_per_s * h);
    y[i] += h * y[n + i];
  }
  return true;
}

}  // namespace tumbler
