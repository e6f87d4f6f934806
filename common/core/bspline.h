#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "common/core/index.h"
#include "common/core/status.h"

namespace tumbler {

/// Smallest and largest value that a quantity is proven to take.
template <typename Scalar>
struct Interval {
  Scalar min = 0;
  Scalar max = 0;
};

/// A scalar clamped B-spline of degree p <= 7 in time, with fixed capacity,
///
///   q(t) = sum_i c_i N_{i,p}(t),   t in [start, end]         (1)  [AB04, Eq. 6], [dB01, ch. IX]
///
/// and its derivatives, which are B-splines of lower degree over the same knots u with control
/// points
///
///   c'_i = p (c_{i+1} - c_i) / (u_{i+p+1} - u_{i+1}).        (2)  [PT97, Eq. 3.4]
///
/// Clamped means that the first p + 1 knots coincide, and the last p + 1, so that q starts at c_0
/// and ends at c_{n-1}. Basis functions are non-negative and sum to one. Hence the smallest and the
/// largest control point bound the curve for all t, and those of (2) bound its derivatives.
///
/// Units: t in s, q in the caller's unit (rad, N m), derivative d in that unit per s^d.
///
/// Real time: no heap, no exceptions, bounded loops; const methods are reentrant. Freestanding.
///
/// The value of a spline at a time is part of the primitive file format: it is bit-identical on
/// every machine that rounds each operation once (no fused multiply-add), and golden tests keep it
/// that way.
///
/// [AB04] J. Albro, J. Bobrow, Motion Generation for a Tumbling Robot Using a General Contact
/// Model, 2004.
/// [dB01] C. de Boor, A Practical Guide to Splines, revised edition, 2001.
/// [PT97] L. Piegl, W. Tiller, The NURBS Book, 2nd edition, 1997.
template <typename Scalar, int kMaxControlPoints>
class BSpline {
 public:
  static constexpr int kMaxDegree = 7;
  /// The highest derivative that `Evaluate` returns with the value.
  static constexpr int kMaxDerivative = 2;
  static constexpr int kMaxKnots = kMaxControlPoints + kMaxDegree + 1;
  static_assert(kMaxControlPoints > kMaxDegree);

  /// Value and first two derivatives at one time.
  struct Sample {
    Scalar value = 0;
    Scalar first = 0;   ///< per s
    Scalar second = 0;  ///< per s^2
  };

  /// The derivatives of the curve at one time by the control points, which an optimiser over them
  /// needs: q^(d)(t) = sum_k w[d][k] c_{first + k}, k = 0 ... p. Entries beyond p are zero.
  struct Weights {
    int first = 0;
    std::array<std::array<Scalar, kMaxDegree + 1>, kMaxDerivative + 1> w{};
  };

  /// The basis functions that are not zero at one time. Splines with the same knots share them:
  /// several joints cost one evaluation of the N of (1), and a few products each.
  struct Basis {
    /// The i with u_i <= t < u_{i+1}; at the end of the spline, its last span.
    int span = 0;
    /// Row d holds the p - d + 1 functions of degree p - d.
    std::array<std::array<Scalar, kMaxDegree + 1>, kMaxDerivative + 1> rows;
    // Rows are written before they are read; to clear them first would cost time.
    // NOLINTNEXTLINE(modernize-use-equals-default)
    Basis() noexcept {}
  };

  /// The spline q = 0 on [0, 1 s]. There is no empty state.
  constexpr BSpline() noexcept { knots_[1] = Scalar(1); }

  /// Replaces the curve. Unless kOk is returned, *this is unchanged.
  /// @param knots           n + degree + 1 non-decreasing values [s]: the first degree + 1 are
  ///                        equal, so are the last, and no knot in between occurs more than degree
  ///                        times.
  /// @param control_points  n values, n >= degree + 1.
  /// @retval kInvalidArgument   one of these conditions fails, or a value is not finite.
  /// @retval kCapacityExceeded  n > kMaxControlPoints or degree > kMaxDegree.
  constexpr Status Assign(int degree, std::span<const Scalar> knots,
                          std::span<const Scalar> control_points) noexcept {
    const int n = static_cast<int>(control_points.size());
    if (degree < 0) return Status::kInvalidArgument;
    if (degree > kMaxDegree || control_points.size() > kMaxControlPoints) {
      return Status::kCapacityExceeded;
    }
    if (n < degree + 1 || static_cast<int>(knots.size()) != n + degree + 1) {
      return Status::kInvalidArgument;
    }
    // Also false for NaN. std::isfinite is not in a freestanding <cmath>.
    const auto finite = [](Scalar x) {
      return x >= std::numeric_limits<Scalar>::lowest() && x <= std::numeric_limits<Scalar>::max();
    };
    if (!std::all_of(knots.begin(), knots.end(), finite)) return Status::kInvalidArgument;
    if (!std::all_of(control_points.begin(), control_points.end(), finite)) {
      return Status::kInvalidArgument;
    }
    for (std::size_t i = 1; i < knots.size(); ++i) {
      if (knots[i] < knots[i - 1]) return Status::kInvalidArgument;
    }
    const auto u = [&knots](int i) { return knots[static_cast<std::size_t>(i)]; };
    if (!(u(0) == u(degree) && u(n) == u(n + degree) && u(0) < u(n))) {
      return Status::kInvalidArgument;
    }
    // At an interior knot that occurs degree + 1 times the curve would jump.
    for (int i = 1; i < n; ++i) {
      if (!(u(i) < u(i + degree)) && degree > 0) return Status::kInvalidArgument;
      if (degree == 0 && !(u(i) < u(i + 1))) return Status::kInvalidArgument;
    }
    degree_ = degree;
    count_ = n;
    std::copy(knots.begin(), knots.end(), knots_.begin());
    std::copy(control_points.begin(), control_points.end(), points_[0].begin());
    for (int d = 1; d <= kMaxDerivative; ++d) Differentiate(d);
    return Status::kOk;
  }

  /// The spline that `Assign` makes of these parts, bit for bit, as a constant of the program. The
  /// headers of `tumbler export` use it. Parts that `Assign` refuses do not compile.
  static consteval BSpline Constant(int degree, std::span<const Scalar> knots,
                                    std::span<const Scalar> control_points) noexcept {
    BSpline spline;
    if (spline.Assign(degree, knots, control_points) != Status::kOk) __builtin_trap();
    return spline;
  }

  /// Writes the n + degree + 1 knots [s] of the clamped uniform spline on [0, duration] to the
  /// front of `knots`.
  /// @retval kInvalidArgument  degree < 0, n < degree + 1, duration not positive and finite, or
  /// `knots` too short.
  static Status ClampedUniformKnots(int degree, int n, Scalar duration_s,
                                    std::span<Scalar> knots) noexcept {
    if (degree < 0 || n < degree + 1 || static_cast<int>(knots.size()) < n + degree + 1 ||
        !(duration_s > 0) || duration_s > std::numeric_limits<Scalar>::max()) {
      return Status::kInvalidArgument;
    }
    const int spans = n - degree;
    for (int i = 0; i < n + degree + 1; ++i) {
      const int k = std::clamp(i - degree, 0, spans);
      knots[static_cast<std::size_t>(i)] =
          k == spans ? duration_s : duration_s * Scalar(k) / Scalar(spans);
    }
    return Status::kOk;
  }

  /// Value and derivatives at t. A spline is never extrapolated: outside [start, end] the time is
  /// clamped, and NaN counts as start.
  [[nodiscard]] Sample Evaluate(Scalar t_s) const noexcept {
    Basis basis;
    EvaluateBasis(t_s, basis);
    return Evaluate(basis);
  }

  /// Span and basis functions at t, clamped as in `Evaluate` [PT97, A2.2]. The search begins with
  /// the span that `basis` already has, so that a series of growing times costs hardly any search.
  /// Results do not depend on it.
  void EvaluateBasis(Scalar t_s, Basis& basis) const noexcept {
    const Scalar start = start_s();
    const Scalar end = end_s();
    const Scalar t = t_s > start ? (t_s < end ? t_s : end) : start;
    const int guess = basis.span;
    const bool known =
        guess >= degree_ && guess < count_ && t >= Knot(guess) && t < Knot(guess + 1);
    basis.span = known ? guess : FindSpan(t);
    // Constants for the usual degrees let the compiler unroll; the operations are the same.
    switch (degree_) {
      case 3:
        return EvaluateRowsOfDegree<3>(t, basis);
      case 5:
        return EvaluateRowsOfDegree<5>(t, basis);
      default:
        return EvaluateRows(t, basis);
    }
  }

  /// The same as `Evaluate(t)`, bit for bit, from the basis at t.
  /// @pre `basis` was evaluated by a spline with this one's degree and knots (`HasKnotsOf`).
  [[nodiscard]] Sample Evaluate(const Basis& basis) const noexcept {
    if (degree_ == 5) return {Combine<5>(basis, 0), Combine<5>(basis, 1), Combine<5>(basis, 2)};
    return {Combine<-1>(basis, 0), Combine<-1>(basis, 1), Combine<-1>(basis, 2)};
  }
  /// The value of `Evaluate(basis)` alone. @pre as there.
  [[nodiscard]] Scalar Value(const Basis& basis) const noexcept {
    return degree_ == 3 ? Combine<3>(basis, 0) : Combine<-1>(basis, 0);
  }

  /// The first derivative of `Evaluate(basis)` alone. @pre as there.
  [[nodiscard]] Scalar Slope(const Basis& basis) const noexcept {
    return degree_ == 3 ? Combine<3>(basis, 1) : Combine<-1>(basis, 1);
  }

  /// Whether this spline has the degree and the knots of `other`.
  [[nodiscard]] bool HasKnotsOf(const BSpline& other) const noexcept {
    return this == &other ||
           (degree_ == other.degree_ && std::ranges::equal(knots(), other.knots()));
  }

  /// The linear map from control points to `Evaluate(t)`.
  [[nodiscard]] Weights EvaluateWeights(Scalar t_s) const noexcept {
    Basis basis;
    EvaluateBasis(t_s, basis);
    const int span = basis.span;
    Weights weights;
    weights.first = span - degree_;
    for (int d = 0; d <= std::min<int>(kMaxDerivative, degree_); ++d) {
      auto& w = weights.w[static_cast<std::size_t>(d)];
      const int p = degree_ - d;
      for (int k = 0; k <= p; ++k) w[Index(k)] = basis.rows[Index(d)][Index(k)];
      // The transpose of (2), from the innermost derivative outwards.
      for (int level = d; level >= 1; --level) {
        const int q = degree_ - level + 1;  // Degree of the spline whose points are differenced.
        Scalar carry = 0;
        for (int k = 0; k < q; ++k) {
          const int i = span - degree_ + k;  // Index into the points of that spline.
          const Scalar gain = Scalar(q) / (Knot(i + q + level) - Knot(i + level));
          const Scalar term = gain * w[Index(k)];
          w[Index(k)] = carry - term;
          carry = term;
        }
        w[Index(q)] = carry;
      }
    }
    return weights;
  }

  /// The derivative as a spline of its own, of degree p - 1 (the zero spline for p = 0).
  [[nodiscard]] BSpline Derivative() const noexcept {
    BSpline result;
    if (degree_ == 0) {
      result.knots_[0] = start_s();
      result.knots_[1] = end_s();
      return result;
    }
    result.degree_ = degree_ - 1;
    result.count_ = count_ - 1;
    std::copy_n(knots_.begin() + 1, count_ + degree_ - 1, result.knots_.begin());
    result.points_[0] = points_[1];
    for (int d = 1; d <= kMaxDerivative; ++d) result.Differentiate(d);
    return result;
  }

  /// Bounds of derivative d, 0 <= d <= kMaxDerivative, that hold for all t: its smallest and
  /// largest control point.
  [[nodiscard]] Interval<Scalar> Bounds(int d) const noexcept {
    const std::span<const Scalar> points = control_points(d);
    Interval<Scalar> bounds{points[0], points[0]};
    for (const Scalar c : points) {
      bounds.min = std::min(bounds.min, c);
      bounds.max = std::max(bounds.max, c);
    }
    return bounds;
  }

  [[nodiscard]] int degree() const noexcept { return degree_; }
  [[nodiscard]] Scalar start_s() const noexcept { return knots_[0]; }
  [[nodiscard]] Scalar end_s() const noexcept { return Knot(count_); }
  [[nodiscard]] std::span<const Scalar> knots() const noexcept {
    return {knots_.data(), Index(count_ + degree_ + 1)};
  }
  /// Control points of derivative d, 0 <= d <= kMaxDerivative; where d exceeds the degree, a single
  /// zero.
  [[nodiscard]] std::span<const Scalar> control_points(int d = 0) const noexcept {
    return {points_[Index(d)].data(), Index(std::max(d <= degree_ ? count_ - d : 1, 1))};
  }

 private:
  // Four numbers in a vector register, in the notation of g++ and clang. Neither compiler keeps to
  // vectors of four by itself.
  // NOLINTNEXTLINE(modernize-use-using): g++ takes the attribute in no other place.
  typedef Scalar Lanes __attribute__((vector_size(4 * sizeof(Scalar))));

  [[nodiscard]] constexpr Scalar Knot(int i) const noexcept { return knots_[Index(i)]; }

  /// Equation (2) applied to the points of derivative d - 1.
  constexpr void Differentiate(int d) noexcept {
    points_[Index(d)].fill(Scalar(0));
    const int p = degree_ - d + 1;
    if (p < 1) return;
    for (int i = 0; i < count_ - d; ++i) {
      const Scalar rise = points_[Index(d - 1)][Index(i + 1)] - points_[Index(d - 1)][Index(i)];
      points_[Index(d)][Index(i)] = Scalar(p) * rise / (Knot(i + p + d) - Knot(i + d));
    }
  }

  /// The span i with u_i <= t < u_{i+1}, the last one at the end. @pre start <= t <= end.
  [[nodiscard]] int FindSpan(Scalar t) const noexcept {
    int low = degree_;
    int high = count_;
    while (high - low > 1) {
      const int middle = (low + high) / 2;
      if (t >= Knot(middle)) {
        low = middle;
      } else {
        high = middle;
      }
    }
    // At the end of a curve whose last interior knot is repeated, empty spans are skipped.
    while (!(Knot(low) < Knot(low + 1))) --low;
    return low;
  }

  /// Turns the basis functions of degree r - 1 in `row` into those of degree r. The knots around t
  /// are u[-1] and u[0].
  [[gnu::always_inline]] static void RaiseDegree(int r, Scalar t, const Scalar* u,
                                                 Scalar* row) noexcept {
    // Three passes let the compiler work on several elements at a time.
    std::array<Scalar, kMaxDegree> rising;
    std::array<Scalar, kMaxDegree> falling{};  // Set, or g++ for Arm warns that it may be unset.
    for (int k = 0; k < r; ++k) {
      const Scalar share = row[k] / (u[k] - u[k - r]);
      falling[Index(k)] = (u[k] - t) * share;
      rising[Index(k)] = (t - u[k - r]) * share;
    }
    row[0] = Scalar(0) + falling[0];
    for (int k = 1; k < r; ++k) row[k] = rising[Index(k - 1)] + falling[Index(k)];
    row[r] = rising[Index(r - 1)];
  }

  /// Fills the rows of `basis` for its span, for any degree. Not inlined, so that the usual degrees
  /// do not pay for its registers.
  [[gnu::noinline]] void EvaluateRows(Scalar t, Basis& basis) const noexcept {
    std::array<Scalar, kMaxDegree + 1> row{Scalar(1)};
    for (int r = 0; r <= degree_; ++r) {
      if (r > 0) RaiseDegree(r, t, knots_.data() + basis.span + 1, row.data());
      if (degree_ - r <= kMaxDerivative) basis.rows[Index(degree_ - r)] = row;
    }
  }

  [[gnu::always_inline]] static void LoadInto(Lanes& lanes, const Scalar* from) noexcept {
    std::memcpy(&lanes, from, sizeof(lanes));
  }

  /// `RaiseDegree` for r <= 4 on four lanes at once. Lanes from r on are +0 and stay so: their
  /// divisors are made one, and they add nothing but +0 to the sums. Returns row[4] where r is 4.
  template <int r>
  [[gnu::always_inline]] static Scalar RaiseDegreeInLanes(Scalar t, const Scalar* u,
                                                          Lanes& row) noexcept {
    Lanes upper;
    LoadInto(upper, u);
    Lanes lower;
    LoadInto(lower, u - r);
    Lanes width = upper - lower;
    width = __builtin_shufflevector(width, Lanes{} + Scalar(1), 0, r > 1 ? 1 : 5, r > 2 ? 2 : 6,
                                    r > 3 ? 3 : 7);
    const Lanes share = row / width;
    const Lanes rising = (t - lower) * share;
    row = __builtin_shufflevector(Lanes{}, rising, 0, 4, 5, 6) + (upper - t) * share;
    return rising[3];
  }

  /// `EvaluateRows` for one degree, four numbers at a time, with the same operations in the same
  /// order on every number that counts. Reads the knots span - 3 ... span + 4, which exist from
  /// degree 3 on.
  template <int kDegree>
  void EvaluateRowsOfDegree(Scalar t, Basis& basis) const noexcept {
    static_assert(kDegree == 3 || kDegree == 5);
    const Scalar* const u = knots_.data() + (basis.span + 1);
    Lanes row{Scalar(1)};
    const auto store = [&basis](int d, const Lanes& lanes) {
      std::memcpy(basis.rows[Index(d)].data(), &lanes, sizeof(lanes));
    };
    RaiseDegreeInLanes<1>(t, u, row);
    if constexpr (kDegree == 3) store(2, row);
    RaiseDegreeInLanes<2>(t, u, row);
    if constexpr (kDegree == 3) store(1, row);
    RaiseDegreeInLanes<3>(t, u, row);
    store(kDegree - 3, row);
    if constexpr (kDegree == 5) {
      const Scalar last = RaiseDegreeInLanes<4>(t, u, row);
      store(1, row);
      basis.rows[1][4] = last;
      Lanes upper;
      LoadInto(upper, u);
      Lanes lower;
      LoadInto(lower, u - 5);
      const Lanes shares = row / (upper - lower);
      const Lanes rising = (t - lower) * shares;
      row = __builtin_shufflevector(Lanes{}, rising, 0, 4, 5, 6) + (upper - t) * shares;
      const Scalar share = last / (u[4] - u[-1]);
      store(0, row);
      basis.rows[0][4] = rising[3] + (u[4] - t) * share;
      basis.rows[0][5] = (t - u[-1]) * share;
    }
  }

  /// The sum (1) for derivative d. `kDegree` is the spline's degree, or -1 for any.
  template <int kDegree>
  [[nodiscard]] Scalar Combine(const Basis& basis, int d) const noexcept {
    const int degree = kDegree >= 0 ? kDegree : degree_;
    const int p = degree - d;
    if (p < 0) return Scalar(0);
    const Scalar* const points = points_[Index(d)].data() + (basis.span - degree);
    Scalar sum = 0;
    for (int k = 0; k <= p; ++k) sum += basis.rows[Index(d)][Index(k)] * points[k];
    return sum;
  }

  int degree_ = 0;
  int count_ = 1;
  std::array<Scalar, kMaxKnots> knots_{};
  std::array<std::array<Scalar, kMaxControlPoints>, kMaxDerivative + 1> points_{};
};

}  // namespace tumbler
