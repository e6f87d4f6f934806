#include "common/files/spline_extent.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "common/core/index.h"

namespace tumbler {
namespace {

/// How much wider an extent may be than its curve, as a share of the largest control point.
constexpr double kTolerance = 1e-9;
/// A piece is not cut more often. The width of its control points falls by four with every cut.
constexpr int kCutsMax = 24;

using Values = std::array<double, BSpline<double, kMaxControlPoints>::kMaxDegree + 1>;

/// A curve in double precision: a derivative of a spline.
struct Curve {
  int degree = 0;
  std::vector<double> knots;
  std::vector<double> points;

  [[nodiscard]] double knot(int i) const { return knots[Index(i)]; }

  /// The last span that is not empty and begins at t or before.
  [[nodiscard]] int SpanAt(double t) const {
    int span = degree;
    for (int i = degree; i < static_cast<int>(points.size()); ++i)
      if (knot(i) <= t && knot(i) < knot(i + 1)) span = i;
    return span;
  }

  /// The polar form of the span's polynomial at as many arguments as its degree: the control points
  /// of any cut of it are its values at the knots of the cut [Ram89].
  [[nodiscard]] double Polar(int span, std::span<const double> at) const {
    Values value{};
    for (int k = 0; k <= degree; ++k) value[Index(k)] = points[Index(span - degree + k)];
    for (int r = 1; r <= degree; ++r) {
      const double t = at[Index(r - 1)];
      for (int k = degree; k >= r; --k) {
        const int i = span - degree + k;
        const double from = knot(i), to = knot(i + degree - r + 1);
        double& upper = value[Index(k)];
        upper = ((to - t) * value[Index(k - 1)] + (t - from) * upper) / (to - from);
      }
    }
    return value[Index(degree)];
  }
};

template <typename Scalar>
Curve DerivativeOf(const BSpline<Scalar, kMaxControlPoints>& spline, int d) {
  Curve curve;
  curve.degree = std::max(spline.degree() - d, 0);
  const auto points = spline.control_points(d);
  curve.points.assign(points.begin(), points.end());
  const auto knots = spline.knots();
  if (d > spline.degree()) {
    curve.knots = {static_cast<double>(knots.front()), static_cast<double>(knots.back())};
  } else {
    curve.knots.assign(knots.begin() + d, knots.end() - d);
  }
  return curve;
}

/// Looks for the largest value of a curve, or of its negative.
class Search {
 public:
  Search(const Curve& curve, double sign)
      : curve_(curve), sign_(sign), hull_(sign * curve.points.front()) {
    double largest = 0;
    for (const double point : curve.points) {
      largest = std::max(largest, std::abs(point));
      hull_ = std::max(hull_, sign * point);
    }
    tolerance_ = kTolerance * largest;
  }

  struct Found {
    double bound = 0;  ///< No value of the curve is above it.
    double at_s = 0;
  };
  Found Run() {
    const int p = curve_.degree;
    reached_ = sign_ * curve_.points.front();
    Found found{reached_, curve_.knots.front()};
    std::vector<Piece> pieces;
    for (int span = p; span < static_cast<int>(curve_.points.size()); ++span) {
      const double from = curve_.knot(span), to = curve_.knot(span + 1);
      if (!(from < to)) continue;
      Piece piece{{}, from, to, 0};
      Values at{};
      for (int k = 0; k <= p; ++k) {
        for (int i = 0; i < p; ++i) at[Index(i)] = i < p - k ? from : to;
        piece.points[Index(k)] = sign_ * curve_.Polar(span, {at.data(), Index(p)});
      }
      Reach(piece);
      pieces.push_back(piece);
    }
    while (!pieces.empty()) {
      const Piece piece = pieces.back();
      pieces.pop_back();
      const double bound = BoundOf(piece);
      if (bound <= found.bound) continue;
      if (bound <= reached_ + tolerance_ || piece.cuts == kCutsMax) {
        found = {bound, TimeOfBound(piece)};
        continue;
      }
      const auto [left, right] = Halves(piece);
      Reach(left);
      Reach(right);
      // The better half last, so that it is looked at first.
      const bool left_first = BoundOf(left) > BoundOf(right);
      pieces.push_back(left_first ? right : left);
      pieces.push_back(left_first ? left : right);
    }
    return found;
  }

 private:
  /// A part of the curve as a Bezier curve.
  struct Piece {
    Values points{};
    double from_s = 0;
    double to_s = 0;
    int cuts = 0;
  };

  [[nodiscard]] double BoundOf(const Piece& piece) const {
    const double bound =
        *std::max_element(piece.points.begin(), piece.points.begin() + curve_.degree + 1);
    return std::min(bound, hull_);  // Cuts round; what is not cut does not.
  }
  /// Where the largest control point has its greatest weight.
  [[nodiscard]] double TimeOfBound(const Piece& piece) const {
    const auto largest =
        std::max_element(piece.points.begin(), piece.points.begin() + curve_.degree + 1);
    const auto k = static_cast<double>(largest - piece.points.begin());
    return piece.from_s + (piece.to_s - piece.from_s) * k / std::max(curve_.degree, 1);
  }
  void Reach(const Piece& piece) {  // Its ends are on the curve.
    reached_ = std::max({reached_, piece.points.front(), piece.points[Index(curve_.degree)]});
  }
  /// [PT97, A1.5], de Casteljau.
  [[nodiscard]] std::pair<Piece, Piece> Halves(const Piece& piece) const {
    const double middle_s = (piece.from_s + piece.to_s) / 2;
    Piece left = piece, right = piece;
    left.to_s = right.from_s = middle_s;
    left.cuts = right.cuts = piece.cuts + 1;
    const auto p = Index(curve_.degree);
    for (std::size_t r = 1; r <= p; ++r) {
      for (std::size_t k = 0; k + r <= p; ++k)
        right.points[k] = (right.points[k] + right.points[k + 1]) / 2;
      left.points[r] = right.points[0];
    }
    return {left, right};
  }

  const Curve& curve_;
  double sign_;
  double hull_;  ///< The largest control point, which no value exceeds.
  double tolerance_ = 0;
  double reached_ = 0;
};

}  // namespace

template <typename Scalar>
Extent ExtentOf(const BSpline<Scalar, kMaxControlPoints>& spline, int d) {
  const Curve curve = DerivativeOf(spline, d);
  const Search::Found max = Search(curve, 1).Run();
  const Search::Found min = Search(curve, -1).Run();
  return {-min.bound, max.bound, min.at_s, max.at_s};
}

template Extent ExtentOf(const BSpline<double, kMaxControlPoints>& spline, int d);
template Extent ExtentOf(const BSpline<float, kMaxControlPoints>& spline, int d);

std::vector<double> RefinedControlPoints(const BSpline<double, kMaxControlPoints>& spline, int d,
                                         int parts) {
  const Curve curve = DerivativeOf(spline, d);
  const int p = curve.degree;
  std::vector<double> knots;
  for (std::size_t i = 0; i < curve.knots.size(); ++i) {
    knots.push_back(curve.knots[i]);
    if (i + 1 == curve.knots.size() || !(curve.knots[i] < curve.knots[i + 1])) continue;
    const double width = curve.knots[i + 1] - curve.knots[i];
    for (int part = 1; part < parts; ++part) knots.push_back(curve.knots[i] + width * part / parts);
  }
  std::vector<double> points(knots.size() - Index(p) - 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = curve.Polar(curve.SpanAt(knots[i]), std::span(knots).subspan(i + 1, Index(p)));
  }
  return points;
}

}  // namespace tumbler
