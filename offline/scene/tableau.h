#pragma once

#include <array>
#include <cstddef>

namespace tumbler {

/// The coefficients of an explicit Runge-Kutta scheme for y' = f(t, y):
///
///   y_s = y + h sum_{r < s} a_sr k_r,   k_s = f(t + c_s h, y_s),   y(t + h) = y + h sum_s b_s k_s
struct Tableau {
  static constexpr std::size_t kMaxStages = 7;
  using Row = std::array<double, kMaxStages>;

  std::size_t stages;
  /// Whether the last stage is at the end of the step and serves as the first of the next step.
  bool first_same_as_last;
  /// Order of the error estimate, plus one.
  double order;
  Row c;
  std::array<Row, kMaxStages> a;
  Row b;
  /// b less the weights of an embedded scheme of lower order. All 0: there is none.
  Row error;
  /// Weights of the slopes in the highest power of the polynomial that follows y within a step
  /// (Integrator::Between). All 0: there is none.
  Row between;

  /// Number of the stages that a step does not share with the next one.
  [[nodiscard]] constexpr std::size_t own_stages() const {
    return stages - (first_same_as_last ? 1 : 0);
  }
  /// Whether each stage needs only the slope of the stage before it.
  [[nodiscard]] constexpr bool chained() const {
    for (std::size_t s = 0; s < stages; ++s) {
      for (std::size_t r = 0; r + 1 < s; ++r) {
        if (a[s][r] != 0) return false;
      }
    }
    return true;
  }
};

/// The midpoint rule, of order 2.
inline constexpr Tableau kMidpoint = {2, false, 2, {0, 0.5}, {{{}, {0.5}}}, {0, 1}, {}, {}};

/// The classical method of order 4.
inline constexpr Tableau kClassical = {4,
                                       false,
                                       4,
                                       {0, 0.5, 0.5, 1},
                                       {{{}, {0.5}, {0, 0.5}, {0, 0, 1}}},
                                       {1. / 6, 1. / 3, 1. / 3, 1. / 6},
                                       {},
                                       {}};

/// The 5(4) pair of J. R. Dormand and P. J. Prince, A Family of Embedded Runge-Kutta Formulae,
/// J. Comp. Appl. Math. 6(1), 1980. The polynomial within a step is of order 4, from E. Hairer,
/// S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 1993, section II.6.
inline constexpr Tableau kDormandPrince = {
    7,
    true,
    5,
    {0, 1. / 5, 3. / 10, 4. / 5, 8. / 9, 1, 1},
    {{{},
      {1. / 5},
      {3. / 40, 9. / 40},
      {44. / 45, -56. / 15, 32. / 9},
      {19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729},
      {9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656},
      {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84}}},
    {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84, 0},
    {71. / 57600, 0, -71. / 16695, 71. / 1920, -17253. / 339200, 22. / 525, -1. / 40},
    {-12715105075. / 11282082432, 0, 87487479700. / 32700410799, -10690763975. / 1880347072,
     701980252875. / 199316789632, -1453857185. / 822651844, 69997945. / 29380423}};

}  // namespace tumbler
