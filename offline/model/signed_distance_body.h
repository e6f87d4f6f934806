#pragma once

#include <cmath>
#include <limits>

#include "offline/model/near_points.h"
#include "offline/model/signed_distance.h"

/// Bodies of the functions, for the sources that compile them for one algebra each.
namespace tumbler {
namespace signed_distance {

/// The vertex of a core that is farthest along a direction.
template <class Space>
typename Space::Vector Farthest(const PosedShape<Space>& shape,
                                const typename Space::Vector& direction) {
  using Vector = typename Space::Vector;
  Vector vertex = shape.centre;
  for (int i = 0; i < Vector::RowsAtCompileTime; ++i) {
    const Vector& axis = shape.axis(i);
    vertex += std::copysign(shape.half_extents[i], axis.dot(direction)) * axis;
  }
  return vertex;
}

/// The ways apart of two cores that overlap, of which the shortest counts: along the axes of either
/// core, and in space across a pair of their edges.
template <class Space>
class Overlap {
 public:
  using Vector = typename Space::Vector;

  Overlap(const PosedShape<Space>& a, const PosedShape<Space>& b) : a_(a), b_(b) {
    best_.d = -std::numeric_limits<double>::infinity();
    constexpr int kAxes = Vector::RowsAtCompileTime;
    for (const PosedShape<Space>* side : {&a, &b}) {
      for (int i = 0; i < kAxes; ++i) {
        // The vertex of the other core slides along this side, and the side's direction turns.
        Try(side->axis(i), side == &a ? Meets::kVertexOfB : Meets::kVertexOfA);
      }
    }
    if constexpr (kAxes == 3) {
      // Edges that are nearly parallel cross along an axis that was tried.
      constexpr double kParallel = 1e-6;
      for (int i = 0; i < kAxes; ++i) {
        for (int k = 0; k < kAxes; ++k) {
          const Vector across = a.axis(i).cross(b.axis(k));
          const double size = across.norm();
          if (size > kParallel) Try(across / size, Meets::kEdges, i, k);
        }
      }
    }
  }

  [[nodiscard]] const SignedDistance<Space>& best() const { return best_; }

 private:
  enum class Meets { kVertexOfA, kVertexOfB, kEdges };

  void Try(Vector u, Meets meets, int edge_a = 0, int edge_b = 0) {
    if (u.dot(a_.centre - b_.centre) < 0) u = -u;
    const Vector on_a = Farthest(a_, Vector(-u)), on_b = Farthest(b_, u);
    const double d = u.dot(on_a - on_b);
    if (!(d > best_.d)) return;
    best_ = {d, u, meets == Meets::kVertexOfB ? on_b : on_a};
    if constexpr (Vector::RowsAtCompileTime == 3) {
      if (meets == Meets::kEdges) best_.point = NearestOnEdge(on_a, on_b, edge_a, edge_b);
    }
  }

  /// Where an edge of a through `on_a` is nearest to an edge of b through `on_b`.
  [[nodiscard]] Vector NearestOnEdge(const Vector& on_a, const Vector& on_b, int edge_a,
                                     int edge_b) const {
    const Vector &s = a_.axis(edge_a), &t = b_.axis(edge_b);
    const double cosine = s.dot(t);
    const Vector between = on_b - on_a;
    const double along = (between.dot(s) - cosine * between.dot(t)) / (1 - cosine * cosine);
    return on_a + along * s;
  }

  const PosedShape<Space>& a_;
  const PosedShape<Space>& b_;
  SignedDistance<Space> best_;
};

}  // namespace signed_distance

template <class Space>
SignedDistance<Space> FindSignedDistance(const PosedShape<Space>& a, const PosedShape<Space>& b) {
  using Vector = typename Space::Vector;
  const double radii = a.radius_m + b.radius_m;
  if (a.half_extents == Vector::Zero() && b.half_extents == Vector::Zero()) {
    const Vector between = a.centre - b.centre;
    const double length = between.norm();
    if (length == 0) return {-radii, Vector::Unit(Vector::RowsAtCompileTime - 1), a.centre};
    return {length - radii, between / length, a.centre};
  }
  const NearPoints<Space> near = FindNearPoints(a, b);
  if (!near.overlap) return {near.d, near.u_d, near.p_a};
  SignedDistance<Space> crossing = signed_distance::Overlap<Space>(a, b).best();
  crossing.d -= radii;
  return crossing;
}

}  // namespace tumbler
