// Limits hold for all t. A search finds the largest |q|, |qd| and |qdd| of a motion: dense samples,
// and then Newton's method on each local extremum. The motions have as many limits active as
// possible, in the splines of the solver and of the runtime.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "common/files/primitive_rounding.h"
#include "common/files/primitive_toml.h"
#include "offline/solve/constraints.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

using Spline = JointMotion<double>::Spline;

/// Times at which |q^(d)| may be largest: dense samples, and the zeros of q^(d+1) between them by
/// Newton's method, from a spline in double precision.
std::vector<double> Suspects(const Spline& spline, int d) {
  std::array<Spline, 5> derivative{spline};
  for (std::size_t k = 1; k < derivative.size(); ++k)
    derivative[k] = derivative[k - 1].Derivative();
  const Spline& slope = derivative[static_cast<std::size_t>(d) + 1];
  const Spline& curvature = derivative[static_cast<std::size_t>(d) + 2];
  constexpr int kPerSpan = 16;
  std::vector<double> times;
  const auto knots = spline.knots();
  for (std::size_t i = 1; i < knots.size(); ++i) {
    const double width = knots[i] - knots[i - 1];
    for (int k = 0; width > 0 && k < kPerSpan; ++k) {
      const double low = knots[i - 1] + width * k / kPerSpan;
      const double high = knots[i - 1] + width * (k + 1) / kPerSpan;
      times.push_back(low);
      if (slope.Evaluate(low).value * slope.Evaluate(high).value > 0) continue;
      double t = 0.5 * (low + high);
      for (int step = 0; step < 8; ++step) {
        const double bend = curvature.Evaluate(t).value;
        if (bend == 0) break;
        t = std::clamp(t - slope.Evaluate(t).value / bend, low, high);
        times.push_back(t);
      }
    }
  }
  times.push_back(knots.back());
  return times;
}

/// The largest |q^(d)|, or for d = 0 |q - middle|, that the search finds, in the precision of
/// `spline`.
template <class AnySpline>
double Hunt(const AnySpline& spline, int d, double middle) {
  using Scalar = std::remove_cvref_t<decltype(spline.end_s())>;
  const std::vector<double> knots(spline.knots().begin(), spline.knots().end());
  const std::vector<double> points(spline.control_points().begin(), spline.control_points().end());
  Spline exact;
  EXPECT_EQ(exact.Assign(spline.degree(), knots, points), Status::kOk);
  double largest = 0;
  for (const double t : Suspects(exact, d)) {
    // In single precision the time of an extremum is one of several neighbours.
    const auto nearest = static_cast<Scalar>(t);
    for (const Scalar at :
         {nearest, std::nextafter(nearest, spline.end_s()), std::nextafter(nearest, Scalar(0))}) {
      const auto sample = spline.Evaluate(at);
      const Scalar value = d == 0 ? sample.value : d == 1 ? sample.first : sample.second;
      largest = std::max(largest, std::abs(static_cast<double>(value) - (d == 0 ? middle : 0)));
    }
  }
  return largest;
}

double Value(const LinearRow& row, const std::vector<double>& x) {
  return row.b + std::inner_product(row.a.begin(), row.a.end(), x.begin(), 0.0);
}

/// The straight line from start to end.
std::vector<double> Line(const Problem& problem) { return RandomMotion(problem, 0, 0); }

/// The rows of the limits, those of position included: they are bounds of the parameters, and
/// stand a millionth inside here.
std::vector<LinearRow> RowsOfLimits(const Problem& problem) {
  std::vector<LinearRow> rows = DerivativeLimitRows(problem);
  for (int i = 0; i < problem.parameter_count(); ++i) {
    const auto& limits = problem.joints[problem.joint_of_parameter(i)].limits;
    for (const double side : {-1.0, 1.0}) {
      LinearRow row;
      row.a.assign(static_cast<std::size_t>(problem.parameter_count()), 0.0);
      row.a[static_cast<std::size_t>(i)] = side;
      row.b = 1e-6 - (side > 0 ? limits.position_max_rad : -limits.position_min_rad);
      rows.push_back(row);
    }
  }
  return rows;
}

/// Pushes x along random directions, as far as the rows let it, and from then on along what is
/// active: as many rows end active as there are parameters, as in a corner.
std::vector<double> AtTheEdge(const Problem& problem, const std::vector<LinearRow>& rows,
                              std::mt19937_64& random) {
  std::vector<double> x = Line(problem);
  std::vector<std::vector<double>> normals;  // of active rows, at right angles to each other
  const auto dot = [](const std::vector<double>& a, const std::vector<double>& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  };
  const auto without_normals = [&](std::vector<double> v) {
    for (int twice = 0; twice < 2; ++twice) {  // Against rounding.
      for (const std::vector<double>& normal : normals) {
        const double along = dot(v, normal);
        for (std::size_t i = 0; i < v.size(); ++i) v[i] -= along * normal[i];
      }
    }
    const double length = std::sqrt(dot(v, v));
    for (double& component : v) component /= length;
    return v;
  };
  while (normals.size() < x.size()) {
    std::vector<double> direction(x.size());
    for (double& component : direction) component = Uniform(random, -1, 1);
    direction = without_normals(direction);
    double reach = 100;
    const LinearRow* met = nullptr;
    for (const LinearRow& row : rows) {
      const double slope = dot(row.a, direction);
      // Rows that are nearly along what is active are met nowhere but there.
      if (slope < 1e-6 * std::sqrt(dot(row.a, row.a))) continue;
      const double until = std::max(0.0, -Value(row, x) / slope);
      if (until < reach) {
        reach = until;
        met = &row;
      }
    }
    if (met == nullptr) break;
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += reach * direction[i];
    normals.push_back(without_normals(met->a));
  }
  return x;
}

/// Legs with different numbers of points, whose limits are near what the motion needs.
Problem Tight(int degree) {
  Problem problem = HandstandProblem();
  problem.degree = degree;
  problem.joints[0].control_points = 11;
  problem.joints[1].control_points = 15;
  problem.joints[0].limits.velocity_max_rad_s = 6;
  problem.joints[0].limits.acceleration_max_rad_s2 = 90;
  problem.joints[1].limits.velocity_max_rad_s = 9;
  problem.joints[1].limits.acceleration_max_rad_s2 = 60;
  problem.joints[0].limits.position_min_rad = -1.7;
  problem.joints[1].limits.position_max_rad = 1.8;
  return problem;
}

/// Largest |q - middle of its range|, |qd| and |qdd| over their limits.
using Ratios = std::array<double, 3>;

/// Raises `worst` to the ratios that the search finds in one joint.
template <class AnySpline, class Limits>
void Raise(const AnySpline& spline, const Limits& limits, Ratios& worst) {
  const auto low = static_cast<double>(limits.position_min_rad);
  const auto high = static_cast<double>(limits.position_max_rad);
  const Ratios bound = {0.5 * (high - low), static_cast<double>(limits.velocity_max_rad_s),
                        static_cast<double>(limits.acceleration_max_rad_s2)};
  for (std::size_t d = 0; d < 3; ++d) {
    worst[d] = std::max(worst[d], Hunt(spline, static_cast<int>(d), 0.5 * (low + high)) / bound[d]);
  }
}

class BoundsForAllTime : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Degree, BoundsForAllTime, ::testing::Values(3, 5, 7));

TEST_P(BoundsForAllTime, NoMotionAtTheEdgeOfItsRowsExceedsALimitBetweenSamples) {
  const Problem problem = Tight(GetParam());
  const std::vector<LinearRow> rows = RowsOfLimits(problem);
  std::mt19937_64 random(1);
  Ratios found{}, in_runtime{};
  std::size_t active = 0;
  constexpr int kMotions = 40;
  for (int trial = 0; trial < kMotions; ++trial) {
    const std::vector<double> x = AtTheEdge(problem, rows, random);
    for (const LinearRow& row : rows) {
      ASSERT_LT(Value(row, x), 1e-9);
      active += Value(row, x) > -1e-9 ? 1U : 0U;
    }
    Primitive<double> primitive;
    primitive.name = FixedString<48>("edge");
    primitive.duration_s = problem.duration_s;
    primitive.entry_tolerance_rad = problem.entry_tolerance_rad;
    primitive.following_tolerance_rad = problem.following_tolerance_rad;
    primitive.joint_count = 2;
    for (std::size_t j = 0; j < 2; ++j) {
      primitive.joints[j].name = FixedString<32>(j == 0 ? "leg1" : "leg2");
      primitive.joints[j].limits = problem.joints[j].limits;
      primitive.joints[j].position = PositionSpline(problem, x, j);
      const std::vector<double> none(primitive.joints[j].position.control_points().size());
      ASSERT_EQ(primitive.joints[j].torque.Assign(problem.degree,
                                                  primitive.joints[j].position.knots(), none),
                Status::kOk);
      Raise(primitive.joints[j].position, primitive.joints[j].limits, found);
    }
    const Primitive<float> runtime = ToRuntime(primitive);
    for (std::size_t j = 0; j < 2; ++j)
      Raise(runtime.joints[j].position, runtime.joints[j].limits, in_runtime);
  }
  EXPECT_GE(active, kMotions * static_cast<std::size_t>(problem.parameter_count()))
      << "the edge is where limits are active";
  // The solver's rows are a millionth inside.
  EXPECT_LE(found[0], 1);
  EXPECT_LE(found[1], 1);
  EXPECT_LE(found[2], 1);
  // A sum of a few products in single precision: some units in the last place.
  for (const double ratio : in_runtime) EXPECT_LE(ratio, 1 + 1e-6);
  // The largest values come near the limits: a search that finds nothing would prove nothing.
  for (const double ratio : found) EXPECT_GT(ratio, 0.75);
}

/// Rows that limit velocity and acceleration at the knots only, which the search must catch.
std::vector<LinearRow> RowsAtTheKnots(const Problem& problem) {
  std::vector<LinearRow> rows;
  const std::vector<double> zero(static_cast<std::size_t>(problem.parameter_count()));
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const ActuatedJoint& joint = problem.joints[j];
    const Spline spline = PositionSpline(problem, zero, j);
    for (const double t : spline.knots()) {
      const Spline::Weights w = spline.EvaluateWeights(t);
      const auto sample = spline.Evaluate(t);
      for (std::size_t d = 1; d <= 2; ++d) {
        const double limit =
            d == 1 ? joint.limits.velocity_max_rad_s : joint.limits.acceleration_max_rad_s2;
        for (const double sign : {1.0, -1.0}) {
          LinearRow row{"knot", zero, sign * (d == 1 ? sample.first : sample.second) / limit - 1};
          for (int k = 0; k <= problem.degree; ++k) {
            const int i = w.first + k - 3;
            if (i < 0 || i >= joint.free_points()) continue;
            row.a[static_cast<std::size_t>(problem.first_parameter(j)) +
                  static_cast<std::size_t>(i)] = sign * w.w[d][static_cast<std::size_t>(k)] / limit;
          }
          rows.push_back(row);
        }
      }
    }
  }
  return rows;
}

TEST_P(BoundsForAllTime, TheHunterCatchesABoundAtTheKnotsOnly) {
  const Problem problem = Tight(GetParam());
  const std::vector<LinearRow> rows = RowsAtTheKnots(problem);
  std::mt19937_64 random(2);
  Ratios found{}, at_knots{};
  for (int trial = 0; trial < 10; ++trial) {
    const std::vector<double> x = AtTheEdge(problem, rows, random);
    for (std::size_t j = 0; j < 2; ++j) {
      const Spline spline = PositionSpline(problem, x, j);
      Raise(spline, problem.joints[j].limits, found);
      for (const double t : spline.knots()) {
        at_knots[1] = std::max(at_knots[1], std::abs(spline.Evaluate(t).first) /
                                                problem.joints[j].limits.velocity_max_rad_s);
      }
    }
  }
  EXPECT_LE(at_knots[1], 1 + 1e-9) << "at the knots the wrong bound holds";
  EXPECT_GT(found[1], 1.01) << "velocity between the knots";
  // The acceleration of a cubic is linear between knots, so its knots are enough.
  if (GetParam() > 3) {
    EXPECT_GT(found[2], 1.01) << "acceleration between the knots";
  }
}

TEST(TorqueBound, CoversTheTorqueOfATenTimesFinerIntegrationWithoutItsMargin) {
  for (const bool dropped : {false, true}) {
    Problem problem = HandstandProblem();
    if (dropped) problem.start_q[1] += 0.05;  // An impact, where torques change within a step.
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      const std::vector<double> x = RandomMotion(problem, seed, 0.7);
      const RolloutResult bound = Rollout(problem, problem.solver.step_s).Run(x);
      std::array<double, 2> peak{};
      Rollout(problem, 0.1 * problem.solver.step_s).Visit(x, 0, [&](const MotionSample& sample) {
        for (std::size_t j = 0; j < 2; ++j) peak[j] = std::max(peak[j], std::abs(sample.torque[j]));
      });
      for (std::size_t j = 0; j < 2; ++j) {
        const double fine = peak[j] / problem.joints[j].limits.torque_max_nm - 1;
        EXPECT_GE(bound.torque_excess[j], fine) << seed;
      }
    }
  }
}

}  // namespace
}  // namespace tumbler
