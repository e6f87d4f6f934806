#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "offline/scene/tableau.h"

namespace tumbler {

/// Single steps of a few equations y' = f(t, y), without heap. `Integrator` is for long states and
/// for steps whose length follows from their error.
///
/// The caller gives the equations as `slope(s, y_s, k)`, which is called at every stage s of a
/// step, sets k = f(t_s, y_s), and returns whether to go on. At stage 0, y_s is y: there a
/// simulation may also record what holds at the start of the step.

/// The state of a mechanical system of n coordinates: n positions, then their n velocities.
template <std::size_t kCapacity>
using MechanicalState = std::array<double, 2 * kCapacity>;

/// One step of the first `size` numbers of y by an explicit Runge-Kutta scheme. Stage s is at the
/// time t + c_s h. A last stage that only serves as the first of the next step is left out.
/// @returns false, with y unchanged, when `slope` returns false.
template <const Tableau& kScheme, std::size_t kCapacity, class Slope>
requires(!kScheme.chained()) inline bool StepRungeKutta(std::array<double, kCapacity>& y,
                                                        std::size_t size, double h, Slope&& slope) {
  std::array<double, kCapacity> later;
  std::array<std::array<double, kCapacity>, Tableau::kMaxStages> k;
  const auto combine = [&](const Tableau::Row& w, std::size_t count) {
    for (std::size_t i = 0; i < size; ++i) {
      double sum = 0;
      for (std::size_t r = 0; r < count; ++r) sum += w[r] * k[r][i];
      later[i] = y[i] + h * sum;
    }
  };
  for (std::size_t s = 0; s < kScheme.own_stages(); ++s) {
    if (s > 0) combine(kScheme.a[s], s);
    if (!slope(static_cast<int>(s), s == 0 ? y : later, k[s].data())) return false;
  }
  combine(kScheme.b, kScheme.own_stages());
  std::copy_n(later.begin(), size, y.begin());
  return true;
}

/// The same by a scheme whose stages are chained, which needs to keep one slope only.
template <const Tableau& kScheme, std::size_t kCapacity, class Slope>
requires(kScheme.chained()) inline bool StepRungeKutta(std::array<double, kCapacity>& y,
                                                       std::size_t size, double h, Slope&& slope) {
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
/// velocities first, then the positions with the new velocities. It has one stage, is of order 1,
/// and is stable for oscillations.
/// @param air_per_s  numerical air resistance: velocities fade at this rate [1/s].
/// @returns false, with y unchanged, when `slope` returns false.
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
