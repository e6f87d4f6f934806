#include "offline/contact/near_points.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "offline/dynamics/plane.h"
#include "offline/dynamics/spatial.h"

namespace tumbler {
namespace {

/// Edges and faces count as parallel below this angle [rad]. Rounding hides smaller angles.
constexpr double kParallelAngle = 1e-9;

/// The least of all least squares solutions of a symmetric system, by its eigenvalues. Eigen's
/// other decompositions of singular matrices allocate.
template <class Solver, class Column>
Column LeastSolution(const Solver& eigen, const Column& right) {
  const auto& values = eigen.eigenvalues();
  const double smallest = 1e-8 * values.cwiseAbs().maxCoeff();
  Column sum = Column::Zero(right.size());
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (std::abs(values[k]) <= smallest) continue;
    const auto& v = eigen.eigenvectors().col(k);
    sum += (v.dot(right) / values[k]) * v;
  }
  return sum;
}

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
      const Vector z = LeastSolution(
          Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kRows, kRows>>(gram), rest);
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
  constexpr int kMax = 4 * kDimension;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMax, kMax>;
  using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMax, 1>;
  NearPointsDerivative<Space> out;
  if (near.overlap) {
    for (std::size_t m = 0; m < out.kMotions; ++m) {
      out.p_a[m] = Space::BasisMotion(m).At(near.p_a);
      out.p_b[m] = out.u_d[m] = Vector::Zero();
      out.d[m] = 0;
    }
    return out;
  }
  // The rows: n . x + b = 0 with b = -n . centre - (bound); `offset` of the row is x - centre.
  struct Row {
    bool of_a;
    Vector n;
    double bound;
  };
  std::array<Row, std::size_t{2} * kDimension> rows;
  int count = 0;
  const auto add_rows = [&](const PosedShape<Space>& shape, const auto& active, bool of_a) {
    if (shape.half_space) {
      rows[static_cast<std::size_t>(count++)] = {of_a, shape.normal, 0};
      return;
    }
    for (int i = 0; i < kDimension; ++i) {
      const std::int8_t at = active[static_cast<std::size_t>(i)];
      if (at != 0) {
        rows[static_cast<std::size_t>(count++)] = {of_a, shape.axes.col(i),
                                                   at * shape.half_extents[i]};
      }
    }
  };
  add_rows(a, near.active_a, true);
  add_rows(b, near.active_b, false);
  constexpr int kX = 2 * kDimension;
  const int size = kX + count;
  Matrix H = Matrix::Zero(size, size);
  H.template topLeftCorner<kX, kX>().diagonal().setConstant(2);  // Q, from grad f = Q x
  H.template block<kDimension, kDimension>(0, kDimension).diagonal().setConstant(-2);
  H.template block<kDimension, kDimension>(kDimension, 0).diagonal().setConstant(-2);
  Column right = Column::Zero(size);
  for (int k = 0; k < count; ++k) {
    const Row& row = rows[static_cast<std::size_t>(k)];
    const int at = row.of_a ? 0 : kDimension;
    H.template block<1, kDimension>(kX + k, at) = row.n.transpose();
    H.template block<kDimension, 1>(at, kX + k) = row.n;
    right[kX + k] = row.n.dot((row.of_a ? a : b).centre) + row.bound;  // -b
  }
  Eigen::PartialPivLU<Matrix> lu;
  Eigen::SelfAdjointEigenSolver<Matrix> eigen;
  if (near.unique) {
    lu.compute(H);
  } else {
    eigen.compute(H);
  }
  const auto solve = [&](const Column& v) -> Column {
    if (near.unique) return lu.solve(v);
    return LeastSolution(eigen, v);
  };
  const Column solution = solve(right);  // (31): x and the multipliers
  for (std::size_t m = 0; m < out.kMotions; ++m) {
    const auto S = Space::BasisMotion(m);
    Column change = Column::Zero(size);  // (0, -db) - dH (x, lambda, mu)
    for (int k = 0; k < count; ++k) {
      const Row& row = rows[static_cast<std::size_t>(k)];
      if (!row.of_a) continue;
      const Vector dn = Space::Cross(S.w, row.n);
      const Vector x = solution.template head<kDimension>();
      change.template head<kDimension>() -= dn * solution[kX + k];
      change[kX + k] = dn.dot(a.centre) + row.n.dot(S.At(a.centre)) - dn.dot(x);
    }
    const Column dx = solve(change);
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
