#include "common/files/spline_extent.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace tumbler {
namespace {

using PathSpline = BSpline<double, kMaxControlPoints>;

enum class Knots { kEven, kRepeated };

/// A clamped spline whose interior knots are even, or anywhere and repeated as far as the curve
/// stays continuous.
PathSpline RandomPathSpline(std::mt19937& random, int degree, Knots kind) {
  std::uniform_int_distribution<int> count(0, 9), times(1, std::max(degree - 1, 1));
  std::uniform_real_distribution<double> inside(0.05, 1.15), angle(-3, 3);
  std::vector<double> interior;
  const int spans = count(random);
  for (int i = 1; i <= spans; ++i) {
    const bool even = kind == Knots::kEven;
    const double knot = even ? 1.2 * i / (spans + 1) : inside(random);
    for (int k = even ? 1 : times(random); k > 0; --k) interior.push_back(knot);
  }
  std::ranges::sort(interior);
  std::vector<double> knots(static_cast<std::size_t>(degree) + 1, 0.0);
  knots.insert(knots.end(), interior.begin(), interior.end());
  knots.insert(knots.end(), static_cast<std::size_t>(degree) + 1, 1.2);
  std::vector<double> points(knots.size() - static_cast<std::size_t>(degree) - 1);
  for (double& point : points) point = angle(random);
  PathSpline spline;
  EXPECT_EQ(spline.Assign(degree, knots, points), Status::kOk);
  return spline;
}

double DerivativeAt(const PathSpline& spline, int d, double t_s) {
  const PathSpline::Sample sample = spline.Evaluate(t_s);
  return d == 0 ? sample.value : (d == 1 ? sample.first : sample.second);
}

TEST(SplineExtent, EnclosesTheCurveAndIsReachedWhereItSays) {
  std::mt19937 random(3);
  for (int degree = 0; degree <= PathSpline::kMaxDegree; ++degree) {
    for (int trial = 0; trial < 30; ++trial) {
      const Knots kind = trial % 3 == 0 ? Knots::kEven : Knots::kRepeated;
      const PathSpline spline = RandomPathSpline(random, degree, kind);
      for (int d = 0; d <= PathSpline::kMaxDerivative; ++d) {
        const Extent extent = ExtentOf(spline, d);
        double largest = 0;
        for (const double point : spline.control_points(d))
          largest = std::max(largest, std::abs(point));
        double max = -1e300, min = 1e300;
        for (int i = 0; i <= 4000; ++i) {
          const double value = DerivativeAt(spline, d, 1.2 * i / 4000);
          max = std::max(max, value);
          min = std::min(min, value);
        }
        EXPECT_LE(max, extent.max + 1e-12 * largest);
        EXPECT_GE(min, extent.min - 1e-12 * largest);
        // At repeated knots a derivative may jump, and its value there is only one of the two.
        if (degree > d && kind == Knots::kEven) {
          EXPECT_NEAR(DerivativeAt(spline, d, extent.max_at_s), extent.max, 1e-3 * largest);
          EXPECT_NEAR(DerivativeAt(spline, d, extent.min_at_s), extent.min, 1e-3 * largest);
        }
      }
    }
  }
}

TEST(SplineExtent, OfAPolynomialIsItsOwnToItsLastDigits) {
  // t (1 - t) on [0, 1], and its slope 1 - 2 t: as a quadratic with the points 0, 1/2, 0.
  PathSpline spline;
  ASSERT_EQ(spline.Assign(2, std::vector<double>{0, 0, 0, 1, 1, 1}, std::vector<double>{0, 0.5, 0}),
            Status::kOk);
  const Extent value = ExtentOf(spline, 0), slope = ExtentOf(spline, 1);
  EXPECT_NEAR(value.max, 0.25, 1e-9);
  EXPECT_GE(value.max, 0.25);
  EXPECT_NEAR(value.max_at_s, 0.5, 1e-3);
  EXPECT_EQ(value.min, 0);
  EXPECT_EQ(slope.max, 1);
  EXPECT_EQ(slope.min, -1);
  EXPECT_EQ(ExtentOf(spline, 2).max, -2);
}

TEST(SplineExtent, OfWhatIsHeldAtALimitIsTheLimit) {
  const double limit = 0.1 + 0.2;  // A number that sums and products round.
  for (int degree = 0; degree <= PathSpline::kMaxDegree; ++degree) {
    std::vector<double> knots(static_cast<std::size_t>(degree) + 1, 0.0);
    knots.push_back(0.7);
    knots.insert(knots.end(), static_cast<std::size_t>(degree) + 1, 1.3);
    const std::vector<double> points(static_cast<std::size_t>(degree) + 2, limit);
    PathSpline spline;
    ASSERT_EQ(spline.Assign(degree, knots, points), Status::kOk);
    EXPECT_EQ(ExtentOf(spline, 0).max, limit);
    EXPECT_EQ(ExtentOf(spline, 0).min, limit);
  }
}

TEST(RefinedControlPoints, AreOfTheSameCurveAndNearItByTheSquareOfTheParts) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-3, 3);
  for (const int degree : {3, 5, 7}) {
    const int n = degree + 4;  // four spans
    std::vector<double> knots(static_cast<std::size_t>(n + degree) + 1);
    ASSERT_EQ(PathSpline::ClampedUniformKnots(degree, n, 1.0, knots), Status::kOk);
    std::vector<double> points(static_cast<std::size_t>(n));
    for (double& point : points) point = angle(random);
    PathSpline spline;
    ASSERT_EQ(spline.Assign(degree, knots, points), Status::kOk);
    // The same curve over the finer knots.
    std::vector<double> finer(static_cast<std::size_t>(n + 4 + degree) + 1);
    ASSERT_EQ(PathSpline::ClampedUniformKnots(degree, n + 4, 1.0, finer), Status::kOk);
    PathSpline refined;
    ASSERT_EQ(refined.Assign(degree, finer, RefinedControlPoints(spline, 0, 2)), Status::kOk);
    for (int i = 0; i <= 100; ++i) {
      EXPECT_NEAR(refined.Evaluate(i / 100.0).value, spline.Evaluate(i / 100.0).value, 1e-12);
      EXPECT_NEAR(refined.Evaluate(i / 100.0).second, spline.Evaluate(i / 100.0).second, 1e-9);
    }
    for (int d = 0; d <= 2; ++d) {
      const Extent extent = ExtentOf(spline, d);
      const auto beyond = [&](int parts) {
        double most = 0;
        for (const double point : RefinedControlPoints(spline, d, parts))
          most = std::max({most, point - extent.max, extent.min - point});
        return most;
      };
      EXPECT_EQ(RefinedControlPoints(spline, d, 1).size(), spline.control_points(d).size());
      double largest = 0;
      for (const double point : spline.control_points(d))
        largest = std::max(largest, std::abs(point));
      for (const int parts : {4, 8, 16, 32})
        EXPECT_LE(beyond(parts), 3 * largest / (parts * parts)) << degree << " " << d;
    }
  }
}

}  // namespace
}  // namespace tumbler
