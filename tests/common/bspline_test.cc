#include "common/core/bspline.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace tumbler {
namespace {

using Spline = BSpline<double, 32>;

/// A spline of the given degree with random points and random, sometimes repeated, interior knots.
Spline RandomSpline(std::mt19937_64& random, int degree) {
  std::uniform_real_distribution<double> unit(0.05, 1.0);
  const int n = degree + 1 + static_cast<int>(random() % 12);
  std::vector<double> knots(static_cast<std::size_t>(degree) + 1, 0.0);
  for (int i = degree + 1; i < n; ++i) {
    const bool repeat =
        degree > 2 && i > degree + 1 && random() % 5 == 0 && knots[knots.size() - 2] < knots.back();
    knots.push_back(repeat ? knots.back() : knots.back() + unit(random));
  }
  knots.insert(knots.end(), static_cast<std::size_t>(degree) + 1, knots.back() + unit(random));
  std::vector<double> points(static_cast<std::size_t>(n));
  for (double& point : points) point = 4 * unit(random) - 2;
  Spline spline;
  EXPECT_EQ(spline.Assign(degree, knots, points), Status::kOk);
  return spline;
}

/// The Cox-de Boor recursion as in textbooks, independent of the code under test.
double CoxDeBoor(std::span<const double> u, int i, int p, double t) {
  const auto at = [&u](int k) { return u[static_cast<std::size_t>(k)]; };
  if (p == 0) return at(i) <= t && t < at(i + 1) ? 1.0 : 0.0;
  double sum = 0;
  if (at(i + p) > at(i)) sum += (t - at(i)) / (at(i + p) - at(i)) * CoxDeBoor(u, i, p - 1, t);
  if (at(i + p + 1) > at(i + 1)) {
    sum += (at(i + p + 1) - t) / (at(i + p + 1) - at(i + 1)) * CoxDeBoor(u, i + 1, p - 1, t);
  }
  return sum;
}

class EveryDegree : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(BSpline, EveryDegree, ::testing::Range(0, 8));

TEST_P(EveryDegree, AgreesWithTheTextbookRecursion) {
  std::mt19937_64 random(11);
  for (int trial = 0; trial < 50; ++trial) {
    const Spline spline = RandomSpline(random, GetParam());
    for (double s = 0; s < 1; s += 0.013) {
      const double t = s * spline.end_s();
      double expected = 0;
      for (std::size_t i = 0; i < spline.control_points().size(); ++i) {
        expected += spline.control_points()[i] *
                    CoxDeBoor(spline.knots(), static_cast<int>(i), GetParam(), t);
      }
      EXPECT_NEAR(spline.Evaluate(t).value, expected, 1e-12);
    }
  }
}

TEST_P(EveryDegree, DerivativesAgreeWithTheSplineOfDerivativesAndWithDifferences) {
  std::mt19937_64 random(12);
  for (int trial = 0; trial < 50; ++trial) {
    const Spline spline = RandomSpline(random, GetParam());
    const Spline first = spline.Derivative();
    const Spline second = first.Derivative();
    for (double s = 0.004; s < 1; s += 0.0137) {
      const double t = s * spline.end_s();
      const Spline::Sample sample = spline.Evaluate(t);
      EXPECT_NEAR(sample.first, first.Evaluate(t).value, 1e-9 * (1 + std::abs(sample.first)));
      EXPECT_NEAR(sample.second, second.Evaluate(t).value, 1e-9 * (1 + std::abs(sample.second)));
      const double h = 1e-6;
      const bool knot_near = std::any_of(spline.knots().begin(), spline.knots().end(),
                                         [&](double u) { return std::abs(u - t) < 2 * h; });
      if (!knot_near) {
        const double difference =
            (spline.Evaluate(t + h).value - spline.Evaluate(t - h).value) / (2 * h);
        EXPECT_NEAR(sample.first, difference, 1e-5 * (1 + std::abs(difference)));
      }
    }
  }
}

TEST_P(EveryDegree, WeightsAreTheLinearMapFromControlPointsToTheSample) {
  std::mt19937_64 random(13);
  for (int trial = 0; trial < 50; ++trial) {
    const Spline spline = RandomSpline(random, GetParam());
    for (double s = 0; s <= 1.0; s += 0.0311) {
      const double t = s * spline.end_s();
      const Spline::Weights weights = spline.EvaluateWeights(t);
      double sums[3] = {0, 0, 0};
      for (std::size_t d = 0; d < 3; ++d) {
        const auto first = static_cast<std::size_t>(weights.first);
        for (std::size_t k = 0; k <= static_cast<std::size_t>(GetParam()); ++k)
          sums[d] += weights.w[d][k] * spline.control_points()[first + k];
      }
      const Spline::Sample sample = spline.Evaluate(t);
      EXPECT_NEAR(sums[0], sample.value, 1e-12);
      EXPECT_NEAR(sums[1], sample.first, 1e-9 * (1 + std::abs(sample.first)));
      EXPECT_NEAR(sums[2], sample.second, 1e-8 * (1 + std::abs(sample.second)));
    }
  }
}

TEST_P(EveryDegree, BoundsFromControlPointsHoldAtEveryTime) {
  std::mt19937_64 random(14);
  for (int trial = 0; trial < 50; ++trial) {
    const Spline spline = RandomSpline(random, GetParam());
    for (double s = 0; s <= 1.0; s += 0.00437) {
      const Spline::Sample sample = spline.Evaluate(s * spline.end_s());
      const double values[3] = {sample.value, sample.first, sample.second};
      for (int d = 0; d < 3; ++d) {
        const Interval<double> bounds = spline.Bounds(d);
        const double slack = 1e-12 * (1 + std::abs(bounds.min) + std::abs(bounds.max));
        EXPECT_GE(values[d], bounds.min - slack);
        EXPECT_LE(values[d], bounds.max + slack);
      }
    }
  }
}

TEST_P(EveryDegree, StartsAtTheFirstAndEndsAtTheLastControlPoint) {
  std::mt19937_64 random(15);
  const Spline spline = RandomSpline(random, GetParam());
  EXPECT_EQ(spline.Evaluate(spline.start_s()).value, spline.control_points().front());
  EXPECT_EQ(spline.Evaluate(spline.end_s()).value, spline.control_points().back());
}

TEST(BSpline, NeverExtrapolates) {
  std::mt19937_64 random(16);
  const Spline spline = RandomSpline(random, 5);
  EXPECT_EQ(spline.Evaluate(-3).value, spline.Evaluate(spline.start_s()).value);
  EXPECT_EQ(spline.Evaluate(spline.end_s() + 5).first, spline.Evaluate(spline.end_s()).first);
  EXPECT_EQ(spline.Evaluate(std::numeric_limits<double>::quiet_NaN()).value,
            spline.control_points().front());
}

TEST(BSpline, ReproducesAPolynomialOfItsDegreeExactly) {
  // Points at the Greville abscissae give the straight line q = t for any knots.
  std::vector<double> knots(16);
  ASSERT_EQ(Spline::ClampedUniformKnots(5, 10, 1.5, knots), Status::kOk);
  std::vector<double> points(10);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = 1; k <= 5; ++k) points[i] += knots[i + k] / 5;
  }
  Spline spline;
  ASSERT_EQ(spline.Assign(5, knots, points), Status::kOk);
  for (double t = 0; t <= 1.5; t += 0.01) {
    EXPECT_NEAR(spline.Evaluate(t).value, t, 1e-14);
    EXPECT_NEAR(spline.Evaluate(t).first, 1, 1e-12);
    EXPECT_NEAR(spline.Evaluate(t).second, 0, 1e-10);
  }
}

TEST(BSpline, RefusesWhatItsDocumentationForbidsAndStaysUnchanged) {
  Spline spline;
  const std::vector<double> knots = {0, 0, 0, 1, 1, 1};
  const std::vector<double> points = {1, 2, 3};
  ASSERT_EQ(spline.Assign(2, knots, points), Status::kOk);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  using V = std::vector<double>;
  EXPECT_EQ(spline.Assign(-1, knots, points), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(8, V(20, 0.0), V(11, 0.0)), Status::kCapacityExceeded);
  EXPECT_EQ(spline.Assign(2, V(36, 0.0), V(33, 0.0)), Status::kCapacityExceeded);
  EXPECT_EQ(spline.Assign(2, V{0, 0, 0, 1, 1}, points), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, V{0, 0, 0.1, 1, 1, 1}, points), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, V{0, 0, 0, 1, 1, 2}, points), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, V{1, 1, 1, 0, 0, 0}, points), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, V{0, 0, 0, 0, 0, 0}, points), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, V{0, 0, 0, .5, .5, .5, 1, 1, 1}, V{1, 2, 3, 4, 5, 6}),
            Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, V{0, 0, 0, 1, 1, inf}, points), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, knots, V{1, nan, 3}), Status::kInvalidArgument);
  EXPECT_EQ(spline.Assign(2, knots, V{1, 2}), Status::kInvalidArgument);
  EXPECT_EQ(spline.Evaluate(0.5).value, 2.0);
}

TEST(BSpline, DefaultIsAValidZero) {
  const Spline spline;
  EXPECT_EQ(spline.Evaluate(0.3).value, 0);
  EXPECT_EQ(spline.start_s(), 0);
  EXPECT_EQ(spline.end_s(), 1);
  EXPECT_EQ(spline.control_points().size(), 1U);
}

TEST(BSpline, FloatAgreesWithDoubleToRounding) {
  std::mt19937_64 random(17);
  const Spline spline = RandomSpline(random, 5);
  std::vector<float> knots(spline.knots().begin(), spline.knots().end());
  std::vector<float> points(spline.control_points().begin(), spline.control_points().end());
  BSpline<float, 32> single;
  ASSERT_EQ(single.Assign(5, knots, points), Status::kOk);
  for (double s = 0; s <= 1; s += 0.01) {
    EXPECT_NEAR(single.Evaluate(static_cast<float>(s * spline.end_s())).value,
                spline.Evaluate(s * spline.end_s()).value, 2e-5);
  }
}

/// FNV-1a over the bits of value and derivatives, on a grid from before the start to beyond the
/// end. All numbers are small multiples of powers of two, so that only the evaluation rounds.
std::uint64_t HashOfEvaluations(int degree, int n) {
  BSpline<float, 64> spline;
  std::vector<float> knots(static_cast<std::size_t>(degree), 0.0F);
  for (int i = 0; i <= n - degree; ++i)
    knots.push_back((static_cast<float>(i) + 0.25F * static_cast<float>(i % 3)) / 32.0F);
  knots.insert(knots.end(), static_cast<std::size_t>(degree), knots.back());
  std::vector<float> points(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i)
    points[static_cast<std::size_t>(i)] = static_cast<float>(i * 37 % 23) / 8.0F - 1.25F;
  EXPECT_EQ(spline.Assign(degree, knots, points), Status::kOk);
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (int i = -16; static_cast<float>(i - 16) / 1024.0F < knots.back(); ++i) {
    const auto sample = spline.Evaluate(static_cast<float>(i) / 1024.0F);
    for (const float x : {sample.value, sample.first, sample.second}) {
      const auto bits = std::bit_cast<std::uint32_t>(x);
      for (int shift = 0; shift < 32; shift += 8) {
        hash = (hash ^ (bits >> shift & 0xffU)) * 0x100000001b3U;
      }
    }
  }
  return hash;
}

TEST(BSpline, EvaluationsAreTheSameBitsOnEveryMachine) {
  // A change of these values changes the commands of existing primitives.
  EXPECT_EQ(HashOfEvaluations(5, 12), 6908937886072031836U);
  EXPECT_EQ(HashOfEvaluations(3, 48), 16997609321788628839U);
  EXPECT_EQ(HashOfEvaluations(4, 20), 5257233694944414290U);  // Degree 4 has no unrolled code.
}

}  // namespace
}  // namespace tumbler
