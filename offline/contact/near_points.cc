#include "offline/contact/near_points.h"

#include <cmath>
#include <optional>

#include "common/index.h"
#include "offline/dynamics/plane.h"
#include "offline/dynamics/spatial.h"
#include "offline/linear/small_system.h"
#include "offline/linear/symmetric_eigen.h"

namespace tumbler {
namespace {

/// Edges and faces count as parallel below this angle [rad]. Rounding hides smaller angles.
constexpr double kParallelAngle = 1e-9;

/// Minimises |M y + r| over |y_i| <= h_i, where the columns of M are unit vectors. The method for
/// this bounded least squares problem is the active-set method of Stark and Parker. The free
/// columns are always independent, and every step decreases the objective, so that no active set
/// comes twice. So the method ends after finitely many steps, at the minimum to rounding.
template <int kRows>
class BoundedLeastSquares {
 public:
  static constexpr int kMax = 2 * kRows;
  using Vector = Eigen::Matrix<double, kRows, 1>;

  void Add(const Vector& column, double h) {
    M_.col(n_) = column;
    h_[n_++] = h;
  }

  void Solve(const Vector& r) {
    r_ = r;
    double size = r.norm();
    for (int i = 0; i < n_; ++i) {
      at_[I(i)] = M_.col(i).dot(r) > 0 ? -1 : 1;
      y_[i] = at_[I(i)] * h_[i];
      size += h_[i];
    }
    const double rounding = 1e-15 * size;
    std::array<bool, kMax> blocked{};
    for (;;) {
      const Vector residual = Residual();
      int enters = -1;
      double steepest = rounding;
      for (int i = 0; i < n_; ++i) {
        if (at_[I(i)] == 0 || blocked[I(i)] || h_[i] == 0) continue;
        const double descent = at_[I(i)] * M_.col(i).dot(residual);  // on leaving the bound
        if (descent > steepest) enters = i, steepest = descent;
      }
      if (enters < 0) return;
      const std::int8_t bound = at_[I(enters)];
      at_[I(enters)] = 0;
      if (!FindTarget() || bound * (target_[enters] - y_[enters]) >= 0) {
        at_[I(enters)] = bound;  // The descent that was left is rounding.
        blocked[I(enters)] = true;
        continue;
      }
      blocked.fill(false);
      while (!StepToTarget()) FindTarget();
    }
  }

  /// Takes the point of least norm where the minimum is not unique.
  /// @param u  the residual's direction.
  bool MakeUnique(const Vector& u) {
    std::array<int, kMax> loose{};
    int count = 0;
    for (int i = 0; i < n_; ++i) {
      if (h_[i] > 0 && std::abs(M_.col(i).dot(u)) <= kParallelAngle) loose[I(count++)] = i;
    }
    if (Independent(loose, count)) return true;
    // All points of the minimum have the same sum of loose columns. There is one candidate for
    // every active set of the loose coordinates, and one of them is the point of least norm.
    Vector sum = Vector::Zero();
    for (int k = 0; k < count; ++k) sum += M_.col(loose[I(k)]) * y_[loose[I(k)]];
    int sets = 1;
    for (int k = 0; k < count; ++k) sets *= 3;
    const Eigen::Matrix<double, kMax, 1> start = y_;
    const auto start_at = at_;
    double least = -1;
    Eigen::Matrix<double, kMax, 1> best = y_;
    auto best_at = at_;
    for (int set = 0; set < sets; ++set) {
      y_ = start;
      at_ = start_at;
      Vector rest = sum;
      Eigen::Matrix<double, kRows, kRows> gram = Eigen::Matrix<double, kRows, kRows>::Zero();
      for (int k = 0, code = set; k < count; ++k, code /= 3) {
        const int i = loose[I(k)];
        at_[I(i)] = static_cast<std::int8_t>(code % 3 == 2 ? -1 : code % 3);
        y_[i] = at_[I(i)] * h_[i];
        rest -= M_.col(i) * y_[i];
        if (at_[I(i)] == 0) gram += M_.col(i) * M_.col(i).transpose();
      }
      const Vector z = DecomposeSymmetric(gram).LeastSolution(rest);
      bool inside = true;
      double norm = 0;
      for (int k = 0; k < count; ++k) {
        const int i = loose[I(k)];
        if (at_[I(i)] == 0) {
          y_[i] = M_.col(i).dot(z);
          rest -= M_.col(i) * y_[i];
          inside = inside && std::abs(y_[i]) <= h_[i] * (1 + 1e-12);
        }
        norm += y_[i] * y_[i];
      }
      const double reach = start.template lpNorm<1>() + h_.head(n_).sum();
      if (!inside || rest.norm() > kParallelAngle * reach) continue;
      if (least < 0 || norm < least) least = norm, best = y_, best_at = at_;
    }
    y_ = best;
    at_ = best_at;
    return false;
  }

  [[nodiscard]] Vector Residual() const {
    Vector sum = r_;
    for (int i = 0; i < n_; ++i) sum += M_.col(i) * y_[i];
    return sum;
  }
  [[nodiscard]] double y(int i) const { return y_[i]; }
  [[nodiscard]] std::int8_t active(int i) const { return at_[I(i)]; }

 private:
  static constexpr std::size_t I(int i) { return static_cast<std::size_t>(i); }

  bool Independent(const std::array<int, kMax>& columns, int count) const {
    if (count > kRows) return false;
    Eigen::Matrix<double, kRows, kRows> Q;
    for (int k = 0; k < count; ++k) {
      Vector q = M_.col(columns[I(k)]);
      for (int j = 0; j < k; ++j) q -= Q.col(j).dot(q) * Q.col(j);
      const double norm = q.norm();
      if (norm <= kParallelAngle) return false;
      Q.col(k) = q / norm;
    }
    return true;
  }

  /// Finds the least squares solution of the free variables, with the others at their bounds, by
  /// Gram-Schmidt. @returns false when the free columns are not independent.
  bool FindTarget() {
    std::array<int, kRows> free{};
    int count = 0;
    target_ = y_;
    Vector rest = r_;
    for (int i = 0; i < n_; ++i) {
      if (at_[I(i)] != 0) {
        rest += M_.col(i) * y_[i];
        continue;
      }
      if (count == kRows) return false;
      free[I(count++)] = i;
    }
    Eigen::Matrix<double, kRows, kRows> Q, R;
    Vector c;
    for (int k = 0; k < count; ++k) {
      Vector q = M_.col(free[I(k)]);
      for (int j = 0; j < k; ++j) {
        R(j, k) = Q.col(j).dot(q);
        q -= R(j, k) * Q.col(j);
      }
      R(k, k) = q.norm();
      if (R(k, k) <= kParallelAngle) return false;
      Q.col(k) = q / R(k, k);
      c[k] = -Q.col(k).dot(rest);
      rest += c[k] * Q.col(k);
    }
    for (int k = count - 1; k >= 0; --k) {
      double value = c[k];
      for (int j = k + 1; j < count; ++j) value -= R(k, j) * target_[free[I(j)]];
      target_[free[I(k)]] = value / R(k, k);
    }
    return true;
  }

  /// Goes towards the target up to the first bound on the way. @returns whether it got there.
  bool StepToTarget() {
    double step = 1;
    int stops = -1;
    for (int i = 0; i < n_; ++i) {
      if (at_[I(i)] != 0 || std::abs(target_[i]) <= h_[i]) continue;
      const double reach = (std::copysign(h_[i], target_[i]) - y_[i]) / (target_[i] - y_[i]);
      if (stops < 0 || reach < step) step = reach, stops = i;
    }
    if (stops < 0) {
      y_ = target_;
      return true;
    }
    y_ += step * (target_ - y_);
    at_[I(stops)] = target_[stops] > 0 ? 1 : -1;
    y_[stops] = at_[I(stops)] * h_[stops];
    return false;
  }

  int n_ = 0;
  Eigen::Matrix<double, kRows, kMax> M_;
  Eigen::Matrix<double, kMax, 1> h_ = Eigen::Matrix<double, kMax, 1>::Zero();
  Eigen::Matrix<double, kMax, 1> y_ = Eigen::Matrix<double, kMax, 1>::Zero();
  Eigen::Matrix<double, kMax, 1> target_;
  Vector r_;
  std::array<std::int8_t, kMax> at_{};
};

/// The vertex of a core that is farthest along -n, or the middle of an edge or face that is level.
template <class Space>
typename Space::Vector FindLowest(const PosedShape<Space>& shape, const typename Space::Vector& n,
                                  std::array<std::int8_t, Space::Vector::RowsAtCompileTime>& active,
                                  bool& unique) {
  typename Space::Vector lowest = shape.centre;
  for (int i = 0; i < PosedShape<Space>::kDimension; ++i) {
    const double along = shape.axes.col(i).dot(n);
    std::int8_t& at = active[static_cast<std::size_t>(i)];
    at = along > 0 ? -1 : 1;
    if (shape.half_extents[i] > 0 && std::abs(along) <= kParallelAngle) {
      at = 0;
      unique = false;
    }
    lowest += at * shape.half_extents[i] * shape.axes.col(i);
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
      const Row& row = rows_[Index(k)];
      right[kX + k] = row.n.dot((row.of_a ? a_ : b_).centre) + row.bound;
    }
    return right;
  }

  /// (0, -db) - dH (x, lambda, mu) for a displaced by S, with (x, lambda, mu) the solution.
  [[nodiscard]] SmallVector ChangeOfRight(const typename Space::Motion& S,
                                          const SmallVector& solution) const {
    SmallVector change = SmallVector::Zero(kX + count_);
    const Vector x = solution.template head<kDimension>();
    for (int k = 0; k < count_; ++k) {
      const Row& row = rows_[Index(k)];
      if (!row.of_a) continue;
      const Vector dn = Space::Cross(S.w, row.n);
      change.template head<kDimension>() -= dn * solution[kX + k];
      change[kX + k] = dn.dot(a_.centre) + row.n.dot(S.At(a_.centre)) - dn.dot(x);
    }
    return change;
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

  void AddRows(const PosedShape<Space>& shape, const std::array<std::int8_t, kDimension>& active,
               bool of_a) {
    if (shape.half_space) {
      rows_[Index(count_++)] = {of_a, shape.normal, 0};
      return;
    }
    for (int i = 0; i < kDimension; ++i) {
      const std::int8_t at = active[Index(i)];
      if (at != 0) rows_[Index(count_++)] = {of_a, shape.axes.col(i), at * shape.half_extents[i]};
    }
  }

  /// H
  [[nodiscard]] SmallMatrix Matrix() const {
    SmallMatrix H = SmallMatrix::Zero(kX + count_, kX + count_);
    for (int i = 0; i < kDimension; ++i) {  // Q, from grad f = Q x
      H(i, i) = H(kDimension + i, kDimension + i) = 2;
      H(i, kDimension + i) = H(kDimension + i, i) = -2;
    }
    for (int k = 0; k < count_; ++k) {
      const Row& row = rows_[Index(k)];
      for (int i = 0; i < kDimension; ++i) {
        const int at = row.of_a ? i : kDimension + i;
        H(kX + k, at) = H(at, kX + k) = row.n[i];
      }
    }
    return H;
  }

  const PosedShape<Space>& a_;
  const PosedShape<Space>& b_;
  std::array<Row, kX> rows_;
  int count_ = 0;
  std::optional<SmallSystem> regular_;                   // where the near points are unique
  std::optional<SymmetricEigen<SmallMatrix>> singular_;  // and where they are not
};

}  // namespace

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
    const Vector x =
        FindLowest(body, ground.normal, a.half_space ? near.active_b : near.active_a, near.unique);
    near.core_distance_m = ground.normal.dot(x - ground.centre);
    near.d = near.core_distance_m - body.radius_m;
    const Vector on_body = x - body.radius_m * ground.normal;
    const Vector on_ground = x - near.core_distance_m * ground.normal;
    near.u_d = a.half_space ? Vector(-ground.normal) : ground.normal;
    near.p_a = a.half_space ? on_ground : on_body;
    near.p_b = a.half_space ? on_body : on_ground;
    return near;
  }
  BoundedLeastSquares<kDimension> problem;
  for (int i = 0; i < kDimension; ++i) problem.Add(a.axes.col(i), a.half_extents[i]);
  for (int i = 0; i < kDimension; ++i) problem.Add(-b.axes.col(i), b.half_extents[i]);
  const Vector between = a.centre - b.centre;
  problem.Solve(between);
  const Vector d_vec = problem.Residual();
  near.core_distance_m = d_vec.norm();
  const double size =
      between.norm() + a.half_extents.template lpNorm<1>() + b.half_extents.template lpNorm<1>();
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
    near.p_a += problem.y(i) * a.axes.col(i);
    near.p_b += problem.y(kDimension + i) * b.axes.col(i);
    near.active_a[static_cast<std::size_t>(i)] = problem.active(i);
    near.active_b[static_cast<std::size_t>(i)] = problem.active(kDimension + i);
  }
  return near;
}

template <class Space>
NearPointsDerivative<Space> DifferentiateNearPoints(const PosedShape<Space>& a,
                                                    const PosedShape<Space>& b,
                                                    const NearPoints<Space>& near) {
  using Vector = typename Space::Vector;
  constexpr int kDimension = NearPoints<Space>::kDimension;
  NearPointsDerivative<Space> out;
  if (near.overlap) {
    for (std::size_t m = 0; m < out.kMotions; ++m) {
      out.p_a[m] = Space::BasisMotion(m).At(near.p_a);
      out.p_b[m] = out.u_d[m] = Vector::Zero();
      out.d[m] = 0;
    }
    return out;
  }
  const KuhnTuckerSystem<Space> system(a, b, near);
  const SmallVector solution = system.Solve(system.Right());  // (31): x and the multipliers
  for (std::size_t m = 0; m < out.kMotions; ++m) {
    const auto S = Space::BasisMotion(m);
    const SmallVector dx = system.Solve(system.ChangeOfRight(S, solution));  // (32)
    const Vector dx_a = dx.template head<kDimension>();
    const Vector dx_b = dx.template segment<kDimension>(kDimension);
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

template NearPoints<Plane> FindNearPoints(const PosedShape<Plane>&, const PosedShape<Plane>&);
template NearPoints<Spatial> FindNearPoints(const PosedShape<Spatial>&, const PosedShape<Spatial>&);
template NearPointsDerivative<Plane> DifferentiateNearPoints(const PosedShape<Plane>&,
                                                             const PosedShape<Plane>&,
                                                             const NearPoints<Plane>&);
template NearPointsDerivative<Spatial> DifferentiateNearPoints(const PosedShape<Spatial>&,
                                                               const PosedShape<Spatial>&,
                                                               const NearPoints<Spatial>&);

}  // namespace tumbler
