#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/core/index.h"
#include "offline/model/near_points.h"
#include "offline/model/small_system.h"
#include "offline/model/symmetric_eigen.h"

/// Bodies of the functions, for the sources that compile them for one algebra each.
namespace tumbler {
namespace near_points {

/// Edges and faces count as parallel below this angle [rad]. Rounding hides smaller angles.
inline constexpr double kParallelAngle = 1e-9;

/// The sum of the sizes of a vector's numbers.
template <class Vector>
double SumOfSizes(const Vector& v) {
  double sum = 0;
  for (int i = 0; i < Vector::RowsAtCompileTime; ++i) sum += std::abs(v[i]);
  return sum;
}

/// Minimises |M y + r| over |y_i| <= h_i, where the columns of M are unit vectors. The method for
/// this bounded least squares problem is the active-set method of Stark and Parker. The free
/// columns are always independent, and every step decreases the objective, so that no active set
/// comes twice. So the method ends after finitely many steps, at the minimum to rounding.
template <class Vector>
class BoundedLeastSquares {
 public:
  static constexpr std::size_t kRows = Vector::RowsAtCompileTime;
  static constexpr std::size_t kMax = 2 * kRows;

  void Add(const Vector& column, double h) {
    M_[n_] = column;
    h_[n_++] = h;
  }

  void Solve(const Vector& r) {
    r_ = r;
    double size = r.norm();
    for (std::size_t i = 0; i < n_; ++i) {
      at_[i] = M_[i].dot(r) > 0 ? -1 : 1;
      y_[i] = at_[i] * h_[i];
      size += h_[i];
    }
    const double rounding = 1e-15 * size;
    std::array<bool, kMax> blocked{};
    for (;;) {
      const Vector residual = Residual();
      std::size_t enters = kMax;
      double steepest = rounding;
      for (std::size_t i = 0; i < n_; ++i) {
        if (at_[i] == 0 || blocked[i] || h_[i] == 0) continue;
        const double descent = at_[i] * M_[i].dot(residual);  // on leaving the bound
        if (descent > steepest) enters = i, steepest = descent;
      }
      if (enters == kMax) return;
      const std::int8_t bound = at_[enters];
      at_[enters] = 0;
      if (!FindTarget() || bound * (target_[enters] - y_[enters]) >= 0) {
        at_[enters] = bound;  // The descent that was left is rounding.
        blocked[enters] = true;
        continue;
      }
      blocked.fill(false);
      while (!StepToTarget()) FindTarget();
    }
  }

  /// Takes the point of least norm where the minimum is not unique.
  /// @param u  the residual's direction.
  bool MakeUnique(const Vector& u) {
    std::array<std::size_t, kMax> loose{};
    std::size_t count = 0;
    double reach = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      reach += std::abs(y_[i]) + h_[i];
      if (h_[i] > 0 && std::abs(M_[i].dot(u)) <= kParallelAngle) loose[count++] = i;
    }
    if (Independent(loose, count)) return true;
    // All points of the minimum have the same sum of loose columns. There is one candidate for
    // every active set of the loose coordinates, and one of them is the point of least norm.
    Vector sum = Vector::Zero();
    for (std::size_t k = 0; k < count; ++k) sum += M_[loose[k]] * y_[loose[k]];
    int sets = 1;
    for (std::size_t k = 0; k < count; ++k) sets *= 3;
    const auto start = y_;
    const auto start_at = at_;
    double least = -1;
    auto best = y_;
    auto best_at = at_;
    for (int set = 0; set < sets; ++set) {
      y_ = start;
      at_ = start_at;
      Vector rest = sum;
      SmallMatrix gram = SmallMatrix::Zero(kRows, kRows);
      for (std::size_t k = 0, code = static_cast<std::size_t>(set); k < count; ++k, code /= 3) {
        const std::size_t i = loose[k];
        at_[i] = static_cast<std::int8_t>(code % 3 == 2 ? -1 : static_cast<int>(code % 3));
        y_[i] = at_[i] * h_[i];
        rest -= M_[i] * y_[i];
        if (at_[i] == 0) AddSquare(M_[i], gram);
      }
      const Vector z = LeastSolution(gram, rest);
      bool inside = true;
      double norm = 0;
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t i = loose[k];
        if (at_[i] == 0) {
          y_[i] = M_[i].dot(z);
          rest -= M_[i] * y_[i];
          inside = inside && std::abs(y_[i]) <= h_[i] * (1 + 1e-12);
        }
        norm += y_[i] * y_[i];
      }
      if (!inside || rest.norm() > kParallelAngle * reach) continue;
      if (least < 0 || norm < least) least = norm, best = y_, best_at = at_;
    }
    y_ = best;
    at_ = best_at;
    return false;
  }

  [[nodiscard]] Vector Residual() const {
    Vector sum = r_;
    for (std::size_t i = 0; i < n_; ++i) sum += M_[i] * y_[i];
    return sum;
  }
  [[nodiscard]] double y(std::size_t i) const { return y_[i]; }
  [[nodiscard]] std::int8_t active(std::size_t i) const { return at_[i]; }

 private:
  /// Adds v v^T.
  static void AddSquare(const Vector& v, SmallMatrix& sum) {
    for (int i = 0; i < Vector::RowsAtCompileTime; ++i) {
      for (int j = 0; j < Vector::RowsAtCompileTime; ++j) sum(i, j) += v[i] * v[j];
    }
  }
  static Vector LeastSolution(const SmallMatrix& gram, const Vector& rest) {
    SmallVector right(kRows);
    for (int i = 0; i < Vector::RowsAtCompileTime; ++i) right[i] = rest[i];
    const SmallVector solution = DecomposeSymmetric(gram).LeastSolution(right);
    Vector z;
    for (int i = 0; i < Vector::RowsAtCompileTime; ++i) z[i] = solution[i];
    return z;
  }

  bool Independent(const std::array<std::size_t, kMax>& columns, std::size_t count) const {
    if (count > kRows) return false;
    std::array<Vector, kRows> Q;
    for (std::size_t k = 0; k < count; ++k) {
      Vector q = M_[columns[k]];
      for (std::size_t j = 0; j < k; ++j) q -= Q[j].dot(q) * Q[j];
      const double norm = q.norm();
      if (norm <= kParallelAngle) return false;
      Q[k] = q / norm;
    }
    return true;
  }

  /// Finds the least squares solution of the free variables, with the others at their bounds, by
  /// Gram-Schmidt. @returns false when the free columns are not independent.
  bool FindTarget() {
    std::array<std::size_t, kRows> free{};
    std::size_t count = 0;
    target_ = y_;
    Vector rest = r_;
    for (std::size_t i = 0; i < n_; ++i) {
      if (at_[i] != 0) {
        rest += M_[i] * y_[i];
        continue;
      }
      if (count == kRows) return false;
      free[count++] = i;
    }
    std::array<Vector, kRows> Q;
    std::array<std::array<double, kRows>, kRows> R;
    std::array<double, kRows> c{};
    for (std::size_t k = 0; k < count; ++k) {
      Vector q = M_[free[k]];
      for (std::size_t j = 0; j < k; ++j) {
        R[j][k] = Q[j].dot(q);
        q -= R[j][k] * Q[j];
      }
      R[k][k] = q.norm();
      if (R[k][k] <= kParallelAngle) return false;
      Q[k] = q / R[k][k];
      c[k] = -Q[k].dot(rest);
      rest += c[k] * Q[k];
    }
    for (std::size_t k = count; k-- > 0;) {
      double value = c[k];
      for (std::size_t j = k + 1; j < count; ++j) value -= R[k][j] * target_[free[j]];
      target_[free[k]] = value / R[k][k];
    }
    return true;
  }

  /// Goes towards the target up to the first bound on the way. @returns whether it got there.
  bool StepToTarget() {
    double step = 1;
    std::size_t stops = kMax;
    for (std::size_t i = 0; i < n_; ++i) {
      if (at_[i] != 0 || std::abs(target_[i]) <= h_[i]) continue;
      const double reach = (std::copysign(h_[i], target_[i]) - y_[i]) / (target_[i] - y_[i]);
      if (stops == kMax || reach < step) step = reach, stops = i;
    }
    if (stops == kMax) {
      y_ = target_;
      return true;
    }
    for (std::size_t i = 0; i < n_; ++i) y_[i] += step * (target_[i] - y_[i]);
    at_[stops] = target_[stops] > 0 ? 1 : -1;
    y_[stops] = at_[stops] * h_[stops];
    return false;
  }

  std::size_t n_ = 0;
  std::array<Vector, kMax> M_;  // by columns
  std::array<double, kMax> h_{}, y_{}, target_{};
  Vector r_;
  std::array<std::int8_t, kMax> at_{};
};

/// The vertex of a core that is farthest along -n, or the middle of an edge or face that is level.
template <class Space>
typename Space::Vector FindLowest(const PosedShape<Space>& shape, const typename Space::Vector& n,
                                  IntArray<std::int8_t, Space::Vector::RowsAtCompileTime>& active,
                                  bool& unique) {
  typename Space::Vector lowest = shape.centre;
  for (int i = 0; i < PosedShape<Space>::kDimension; ++i) {
    const double along = shape.axis(i).dot(n);
    std::int8_t& at = active[i];
    at = along > 0 ? -1 : 1;
    if (shape.half_extents[i] > 0 && std::abs(along) <= kParallelAngle) {
      at = 0;
      unique = false;
    }
    lowest += at * shape.half_extents[i] * shape.axis(i);
  }
  return lowest;
}

/// The system (31) for the near points of two shapes, with a row n . x + b = 0 for every constraint
/// that holds with equality: b = -n . centre - bound.
template <class Space>
class KuhnTuckerSystem {
 public:
  using Vector = typename Space::Vector;

  KuhnTuckerSystem(const PosedShape<Space>& a, const PosedShape<Space>& b,
                   const NearPoints<Space>& near)
      : a_(a), b_(b) {
    AddRows(a, near.active_a, true);
    AddRows(b, near.active_b, false);
    if (near.unique) {
      regular_.emplace(Matrix());
    } else {
      singular_ = DecomposeSymmetric(Matrix());
    }
  }

  /// H^-1 v; where H is singular, the least of all solutions.
  [[nodiscard]] SmallVector Solve(const SmallVector& v) const {
    return regular_ ? regular_->Solve(v) : singular_->LeastSolution(v);
  }

  /// (0, -b)
  [[nodiscard]] SmallVector Right() const {
    SmallVector right = SmallVector::Zero(kX + count_);
    for (int k = 0; k < count_; ++k) {
      const Row& row = rows_[k];
      right[kX + k] = row.n.dot((row.of_a ? a_ : b_).centre) + row.bound;
    }
    return right;
  }

  /// (0, -db) - dH (x, lambda, mu) for a displaced by S, with (x, lambda, mu) the solution.
  [[nodiscard]] SmallVector ChangeOfRight(const typename Space::Motion& S,
                                          const SmallVector& solution) const {
    SmallVector change = SmallVector::Zero(kX + count_);
    const Vector x = PartOf(solution, 0);
    for (int k = 0; k < count_; ++k) {
      const Row& row = rows_[k];
      if (!row.of_a) continue;
      const Vector dn = Space::Cross(S.w, row.n);
      for (int i = 0; i < kDimension; ++i) change[i] -= dn[i] * solution[kX + k];
      change[kX + k] = dn.dot(a_.centre) + row.n.dot(S.At(a_.centre)) - dn.dot(x);
    }
    return change;
  }

  /// x_a of a solution, or x_b where `side` is 1.
  [[nodiscard]] static Vector PartOf(const SmallVector& solution, int side) {
    Vector x;
    for (int i = 0; i < kDimension; ++i) x[i] = solution[side * kDimension + i];
    return x;
  }

 private:
  static constexpr int kDimension = NearPoints<Space>::kDimension;
  static constexpr int kX = 2 * kDimension;  // x_a and x_b
  static_assert(2 * kX <= kMaxSmallSize, "every coordinate of both cores may be at a bound");

  struct Row {
    bool of_a;
    Vector n;
    double bound;
  };

  void AddRows(const PosedShape<Space>& shape, const IntArray<std::int8_t, kDimension>& active,
               bool of_a) {
    if (shape.half_space) {
      rows_[count_++] = {of_a, shape.normal, 0};
      return;
    }
    for (int i = 0; i < kDimension; ++i) {
      const std::int8_t at = active[i];
      if (at != 0) rows_[count_++] = {of_a, shape.axis(i), at * shape.half_extents[i]};
    }
  }

  /// H
  [[nodiscard]] SmallMatrix Matrix() const {
    SmallMatrix H = SmallMatrix::Zero(kX + count_, kX + count_);
    for (int i = 0, j = kDimension; j < kX; ++i, ++j) {  // Q, from grad f = Q x
      H(i, i) = H(j, j) = 2;
      H(i, j) = H(j, i) = -2;
    }
    for (int k = 0; k < count_; ++k) {
      const Row& row = rows_[k];
      for (int i = 0; i < kDimension; ++i) {
        const int at = row.of_a ? i : kDimension + i;
        H(kX + k, at) = H(at, kX + k) = row.n[i];
      }
    }
    return H;
  }

  const PosedShape<Space>& a_;
  const PosedShape<Space>& b_;
  IntArray<Row, kX> rows_;
  int count_ = 0;
  std::optional<SmallSystem> regular_;      // where the near points are unique
  std::optional<SymmetricEigen> singular_;  // and where they are not
};

}  // namespace near_points

template <class Space>
NearPoints<Space> FindNearPoints(const PosedShape<Space>& a, const PosedShape<Space>& b) {
  using Vector = typename Space::Vector;
  constexpr int kDimension = NearPoints<Space>::kDimension;
  NearPoints<Space> near;
  if (a.half_space || b.half_space) {
    const PosedShape<Space>& ground = a.half_space ? a : b;
    const PosedShape<Space>& body = a.half_space ? b : a;
    near.active_a.fill(1);
    near.active_b.fill(1);
    const Vector x = near_points::FindLowest(
        body, ground.normal, a.half_space ? near.active_b : near.active_a, near.unique);
    near.core_distance_m = ground.normal.dot(x - ground.centre);
    near.d = near.core_distance_m - body.radius_m;
    const Vector on_body = x - body.radius_m * ground.normal;
    const Vector on_ground = x - near.core_distance_m * ground.normal;
    near.u_d = a.half_space ? Vector(-ground.normal) : ground.normal;
    near.p_a = a.half_space ? on_ground : on_body;
    near.p_b = a.half_space ? on_body : on_ground;
    return near;
  }
  near_points::BoundedLeastSquares<Vector> problem;
  for (int i = 0; i < kDimension; ++i) problem.Add(a.axis(i), a.half_extents[i]);
  for (int i = 0; i < kDimension; ++i) problem.Add(-b.axis(i), b.half_extents[i]);
  const Vector between = a.centre - b.centre;
  problem.Solve(between);
  const Vector d_vec = problem.Residual();
  near.core_distance_m = d_vec.norm();
  const double size = between.norm() + near_points::SumOfSizes(a.half_extents) +
                      near_points::SumOfSizes(b.half_extents);
  near.overlap = near.core_distance_m <= 1e-12 * size;
  if (near.overlap) {
    const double length = between.norm();
    near.u_d = length > 0 ? Vector(between / length) : Vector(Vector::Unit(kDimension - 1));
  } else {
    near.u_d = d_vec / near.core_distance_m;  // [AB04, Eq. 10]
    near.unique = problem.MakeUnique(near.u_d);
  }
  near.d = near.core_distance_m - a.radius_m - b.radius_m;
  near.p_a = a.centre - (near.overlap ? 0 : a.radius_m) * near.u_d;
  near.p_b = b.centre + (near.overlap ? 0 : b.radius_m) * near.u_d;
  for (int i = 0; i < kDimension; ++i) {
    const std::size_t of_a = Index(i), of_b = Index(kDimension + i);
    near.p_a += problem.y(of_a) * a.axis(i);
    near.p_b += problem.y(of_b) * b.axis(i);
    near.active_a[i] = problem.active(of_a);
    near.active_b[i] = problem.active(of_b);
  }
  return near;
}

template <class Space>
NearPointsDerivative<Space> DifferentiateNearPoints(const PosedShape<Space>& a,
                                                    const PosedShape<Space>& b,
                                                    const NearPoints<Space>& near) {
  using Vector = typename Space::Vector;
  NearPointsDerivative<Space> out;
  if (near.overlap) {
    for (std::size_t m = 0; m < out.kMotions; ++m) {
      out.p_a[m] = Space::BasisMotion(m).At(near.p_a);
      out.p_b[m] = out.u_d[m] = Vector::Zero();
      out.d[m] = 0;
    }
    return out;
  }
  const near_points::KuhnTuckerSystem<Space> system(a, b, near);
  const SmallVector solution = system.Solve(system.Right());  // (31): x and the multipliers
  for (std::size_t m = 0; m < out.kMotions; ++m) {
    const auto S = Space::BasisMotion(m);
    const SmallVector dx = system.Solve(system.ChangeOfRight(S, solution));  // (32)
    const Vector dx_a = system.PartOf(dx, 0), dx_b = system.PartOf(dx, 1);
    const Vector d_vec = dx_a - dx_b;
    out.d[m] = near.u_d.dot(d_vec);
    if (a.half_space) {
      out.u_d[m] = Space::Cross(S.w, near.u_d);
    } else if (b.half_space) {
      out.u_d[m] = Vector::Zero();
    } else {
      out.u_d[m] = (d_vec - out.d[m] * near.u_d) / near.core_distance_m;
    }
    out.p_a[m] = dx_a - a.radius_m * out.u_d[m];
    out.p_b[m] = dx_b + b.radius_m * out.u_d[m];
  }
  return out;
}

}  // namespace tumbler
