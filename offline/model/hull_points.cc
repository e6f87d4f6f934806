#include "offline/model/hull_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <queue>
#include <utility>

#include "common/core/index.h"
#include "offline/model/plane_vector.h"
#include "offline/model/space_vector.h"

namespace tumbler {
namespace {

/// Of sizes: what counts as nothing in a distance, and in the choice of points.
constexpr double kHullRounding = 1e-12, kOnHull = 1e-9, kHullTolerance = 1e-6;

/// A simplex of up to kDimension + 1 points.
template <class Vector>
struct Simplex {
  static constexpr int kDimension = Vector::RowsAtCompileTime;
  std::array<Vector, kDimension + 1> corners;
  int count = 0;

  /// The point nearest to the origin of the flat through the corners in `mask`, where it lies
  /// between them.
  [[nodiscard]] std::optional<Vector> NearestOfFlat(unsigned mask) const {
    std::array<Vector, kDimension> edges;
    std::array<std::array<double, kDimension + 1>, kDimension> rows{};
    int first = 0;
    while ((mask >> first & 1U) == 0) ++first;
    const Vector base = corners[Index(first)];
    int n = 0;
    for (int i = first + 1; i < count; ++i) {
      if ((mask >> i & 1U) == 0) continue;
      if (n == kDimension) return std::nullopt;
      edges[Index(n++)] = corners[Index(i)] - base;
    }
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) rows[Index(i)][Index(j)] = edges[Index(i)].dot(edges[Index(j)]);
      rows[Index(i)][kDimension] = -edges[Index(i)].dot(base);
    }
    // The matrix of the products of edges is symmetric and, but for flat simplices, definite.
    for (int k = 0; k < n; ++k) {
      auto& pivot = rows[Index(k)];
      if (!(pivot[Index(k)] > kHullRounding * edges[Index(k)].squaredNorm())) return std::nullopt;
      for (int i = 0; i < n; ++i) {
        if (i == k) continue;
        auto& row = rows[Index(i)];
        const double factor = row[Index(k)] / pivot[Index(k)];
        for (int j = k; j < n; ++j) row[Index(j)] -= factor * pivot[Index(j)];
        row[kDimension] -= factor * pivot[kDimension];
      }
    }
    Vector nearest = base;
    double sum = 0;
    for (int i = 0; i < n; ++i) {
      const double part = rows[Index(i)][kDimension] / rows[Index(i)][Index(i)];
      if (!(part >= 0)) return std::nullopt;
      sum += part;
      nearest += part * edges[Index(i)];
    }
    if (sum > 1) return std::nullopt;
    return nearest;
  }

  /// The point nearest to the origin. Only the corners that it lies between stay.
  Vector Reduce() {
    Vector best = corners[0];
    unsigned best_mask = 1;
    for (unsigned mask = 2; mask < 1U << count; ++mask) {
      const std::optional<Vector> nearest = NearestOfFlat(mask);
      if (!nearest || !(nearest->squaredNorm() < best.squaredNorm())) continue;
      best = *nearest;
      best_mask = mask;
    }
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      if ((best_mask >> i & 1U) != 0) corners[Index(kept++)] = corners[Index(i)];
    }
    count = kept;
    return best;
  }
};

}  // namespace

template <class Vector>
double DistanceFromHull(const Vector& point, std::span<const Vector> points) {
  // Gilbert, Johnson and Keerthi's algorithm, for the hull seen from the point.
  Simplex<Vector> simplex;
  double size = 0;
  for (const Vector& other : points) size = std::max(size, (other - point).norm());
  simplex.corners[0] = points.front() - point;
  simplex.count = 1;
  Vector nearest = simplex.corners[0];
  for (;;) {
    const double distance = nearest.norm();
    if (!(distance > kHullRounding * size)) return 0;
    Vector farthest = nearest;
    double least = distance * distance;
    for (const Vector& other : points) {
      const Vector seen = other - point;
      if (const double along = nearest.dot(seen); along < least) {
        least = along;
        farthest = seen;
      }
    }
    if (distance * distance - least <= kHullRounding * size * distance) return distance;
    if (simplex.count > Simplex<Vector>::kDimension) return 0;  // The point is inside.
    simplex.corners[Index(simplex.count++)] = farthest;
    const Vector next = simplex.Reduce();
    if (!(next.squaredNorm() < nearest.squaredNorm())) return distance;
    nearest = next;
  }
}

template <class Vector>
HullPoints ChooseHullPoints(std::span<const Vector> points, std::size_t most) {
  constexpr int kDimension = Vector::RowsAtCompileTime;
  Vector low = points.front(), high = points.front();
  for (const Vector& point : points) {
    for (int i = 0; i < kDimension; ++i) {
      low[i] = std::min(low[i], point[i]);
      high[i] = std::max(high[i], point[i]);
    }
  }
  const double size = (high - low).norm();
  const auto farthest = std::ranges::max_element(
      points, {}, [&](const Vector& point) { return (point - (low + high) / 2).squaredNorm(); });
  HullPoints hull;
  std::vector<Vector> corners;
  const auto choose = [&](std::size_t i) {
    hull.chosen.push_back(i);
    corners.push_back(points[i]);
  };
  choose(static_cast<std::size_t>(farthest - points.begin()));
  // Points on a face may be as far as its corners, and are no corners once these are there.
  const auto leave_out_others = [&] {
    for (std::size_t i = corners.size(); i-- > 0 && corners.size() > 1;) {
      std::vector<Vector> others = corners;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      if (DistanceFromHull<Vector>(corners[i], others) > kOnHull * size) continue;
      corners = std::move(others);
      hull.chosen.erase(hull.chosen.begin() + static_cast<std::ptrdiff_t>(i));
    }
  };
  // The distance from a hull that grows becomes no larger: what it was bounds it from above.
  struct Candidate {
    double beyond_m;
    std::size_t point, of;  ///< From the hull of so many.
    bool operator<(const Candidate& other) const {
      return std::pair(beyond_m, other.point) < std::pair(other.beyond_m, point);
    }
  };
  std::priority_queue<Candidate> queue;
  for (std::size_t i = 0; i < points.size(); ++i)
    queue.push({(points[i] - corners.front()).norm(), i, 1});
  for (std::size_t grown = 1;;) {
    Candidate next = queue.top();
    if (next.of != grown) {
      queue.pop();
      next.beyond_m = DistanceFromHull<Vector>(points[next.point], corners);
      next.of = grown;
      queue.push(next);
      continue;
    }
    hull.beyond_m = next.beyond_m;
    const bool done = next.beyond_m <= kHullTolerance * size;
    if (done || corners.size() == most) leave_out_others();
    if (done || corners.size() == most) break;
    choose(next.point);
    ++grown;
  }
  return hull;
}

template double DistanceFromHull(const PlaneVector&, std::span<const PlaneVector>);
template double DistanceFromHull(const SpaceVector&, std::span<const SpaceVector>);
template HullPoints ChooseHullPoints(std::span<const PlaneVector>, std::size_t);
template HullPoints ChooseHullPoints(std::span<const SpaceVector>, std::size_t);

}  // namespace tumbler
