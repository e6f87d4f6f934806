// Rollouts of robots in space: against the plane, and their gradients against differences.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/core/index.h"
#include "offline/model/robot.h"
#include "offline/problem/space_quantity.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/root_chart.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/rollout.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using testing::ShippedRobot;

/// The tumbler in the plane, whose legs swing as it falls from 10 cm above the ground.
constexpr const char* kPlanarTask = R"(format = "tumbler-task"
version = 1
name = "drop"
robot = "tumbler.urdf"
root = "planar-xz"
duration_s = 0.6
settle_s = 0.4
[start]
z_m = 0.42
pitch_rad = 0.2
joints_rad = { leg1 = -1.5707963267948966, leg2 = 1.5707963267948966 }
[end]
joints_rad = { leg1 = -1.2, leg2 = 1.3 }
[[cost]]
term = "terminal"
of = "pitch"
when = "settled"
weight = 1.0
[[cost]]
term = "effort"
weight = 1.0e-3
[contact]
stiffness_n_per_m = 1.0e4
damping_n_s_per_m = 100.0
d_on_m = 0.01
d_off_m = 0.0075
mu = 0.3
v_max_m_per_s = 0.05
[[obstacle]]
name = "ground"
kind = "half-space"
point_m = [0.0, 0.0]
normal = [0.0, 1.0]
[limits]
rotor_inertia_kg_m2 = 0.001
)";

/// The same in space, turned and placed as asked.
std::string SpaceTask(const std::string& start, const std::string& costs) {
  return std::string(R"(format = "tumbler-task"
version = 1
name = "drop"
robot = "tumbler.urdf"
root = "floating"
duration_s = 0.6
settle_s = 0.4
[start]
)") + start +
         R"(
joints_rad = { leg1 = -1.5707963267948966, leg2 = 1.5707963267948966 }
[end]
joints_rad = { leg1 = -1.2, leg2 = 1.3 }
)" + costs +
         R"([[cost]]
term = "effort"
weight = 1.0e-3
[contact]
stiffness_n_per_m = 1.0e4
damping_n_s_per_m = 100.0
d_on_m = 0.01
d_off_m = 0.0075
mu = 0.3
v_max_m_per_s = 0.05
[[obstacle]]
name = "ground"
kind = "half-space"
point_m = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
[limits]
rotor_inertia_kg_m2 = 0.001
)";
}

/// Pitch of 0.2 rad about -y.
constexpr const char* kPitched =
    "z_m = 0.42\nquaternion = [0.9950041652780258, 0.0, -0.09983341664682815, 0.0]";
constexpr const char* kUpright = R"([[cost]]
term = "terminal"
of = "misalignment"
axis = [0.0, 0.0, 1.0]
along = [0.0, 0.0, 1.0]
when = "settled"
weight = 1.0
)";
/// Every quantity at some time or other.
constexpr const char* kEverything = R"([[cost]]
term = "terminal"
of = "misalignment"
link = "leg1_link"
axis = [0.3, 0.5, 1.0]
along = [0.2, 0.4, 1.0]
time_s = 0.3
weight = 1.0
[[cost]]
term = "terminal"
of = "position"
link = "leg2_link"
point_m = [0.05, 0.02, 0.2]
along = [1.0, 2.0, 0.5]
when = "end"
target = 0.1
weight = 3.0
[[cost]]
term = "terminal"
of = "velocity"
link = "leg2_link"
point_m = [0.05, 0.02, 0.2]
along = [1.0, -2.0, 0.5]
time_s = 0.45
weight = 0.5
[[cost]]
term = "terminal"
of = "angular_velocity"
link = "leg1_link"
along = [1.0, 1.0, 0.5]
time_s = 0.2
weight = 0.2
[[cost]]
term = "terminal"
of = "heading"
link = "leg1_link"
axis = [0.4, 0.3, 1.0]
along = [0.1, 0.3, 1.0]
time_s = 0.35
from_start = true
target = 1.0
weight = 0.3
[[cost]]
term = "terminal-linear"
of = "heading"
axis = [0.0, 1.0, 0.2]
along = [1.0, 0.0, 0.1]
when = "settled"
weight = 0.1
[[cost]]
term = "work"
weight = 0.05
[[cost]]
term = "slip"
weight = 2.0
[[cost]]
term = "terminal-linear"
of = "position"
along = [0.0, 1.0, 0.0]
when = "settled"
weight = 0.4
)";

Problem InSpace(const std::string& start, const std::string& costs) {
  return ParseTask(SpaceTask(start, costs), "task.toml", ShippedRobot(), "tumbler.urdf",
                   TaskSpaces::kPlaneAndSpace)
      .problem;
}

std::vector<double> SomeMotion(const Problem& problem) { return RandomStarts(problem).Draw(3); }

TEST(SpaceRollout, OfARobotInThePlaneFollowsThePlaneThroughImpacts) {
  const Problem plane = ParseTask(kPlanarTask, "task.toml", ShippedRobot(), "tumbler.urdf").problem;
  const Problem space = InSpace(kPitched, kUpright);
  const std::vector<double> x = SomeMotion(plane);
  ASSERT_EQ(x, SomeMotion(space));
  std::vector<std::array<double, 4>> expected;
  bool touched = false;
  Rollout(plane, 5e-4).Visit(x, 0.5, [&](const MotionSample& sample) {
    expected.push_back({sample.q[0], sample.q[1], sample.q[2], sample.torque[0]});
    touched = touched || !sample.contacts.empty();
  });
  EXPECT_TRUE(touched);
  std::size_t at = 0;
  double worst = 0;
  Rollout(space, 5e-4).VisitInSpace(x, 0.5, [&](const SpaceSample& sample) {
    ASSERT_LT(at, expected.size());
    const auto& [px, pz, pitch, torque] = expected[at++];
    const SpaceMatrix& R = sample.orientation;
    worst = std::max({worst, std::abs(sample.q[0] - px), std::abs(sample.q[1]),
                      std::abs(sample.q[2] - pz), std::abs(R(2, 0) - std::sin(pitch)),
                      std::abs(R(0, 0) - std::cos(pitch)), std::abs(R(1, 1) - 1),
                      1e-2 * std::abs(sample.torque[0] - torque)});
  });
  EXPECT_EQ(at, expected.size());
  EXPECT_LT(worst, 1e-12);
}

std::vector<double> OutputsOf(const RolloutResult& result) {
  std::vector<double> out{result.cost};
  out.insert(out.end(), result.torque_excess.begin(), result.torque_excess.end());
  out.push_back(result.penetration_excess);
  out.push_back(result.clearance_excess);
  return out;
}

/// The largest difference between gradient and central differences of any output, relative to the
/// largest component of its gradient, with the best of three steps for each.
double GradientError(const Problem& problem, const std::vector<double>& x, double step_s) {
  Rollout rollout(problem, step_s);
  OutputGradients gradient = OutputGradients::Of(rollout);
  const RolloutResult result = rollout.Run(x, gradient);
  EXPECT_TRUE(result.finite);
  EXPECT_TRUE(result.any_contact);
  std::vector<double> best(Index(rollout.output_count()), 1e300);
  for (const double h : {1e-5, 1e-6, 1e-7}) {
    std::vector<double> worst(best.size(), 0.0);
    for (std::size_t k = 0; k < x.size(); ++k) {
      std::vector<double> shifted = x;
      shifted[k] = x[k] + h;
      const std::vector<double> plus = OutputsOf(rollout.Run(shifted));
      shifted[k] = x[k] - h;
      const std::vector<double> minus = OutputsOf(rollout.Run(shifted));
      for (std::size_t i = 0; i < worst.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const double slope = gradient(row, static_cast<Eigen::Index>(k));
        const double scale = gradient.row(row).cwiseAbs().maxCoeff();
        if (scale == 0) continue;
        worst[i] = std::max(worst[i], std::abs((plus[i] - minus[i]) / (2 * h) - slope) / scale);
      }
    }
    for (std::size_t i = 0; i < best.size(); ++i) best[i] = std::min(best[i], worst[i]);
  }
  return *std::ranges::max_element(best);
}

TEST(SpaceRollout, HasTheGradientOfItsDifferencesThroughContactAtRollAndPitchOf90Degrees) {
  // Half turns of pitch and roll, one after the other: (1/2, 1/2, -1/2, ...) and beside it.
  const Problem problem = InSpace("z_m = 0.35\nquaternion = [0.5, 0.5, -0.5, 0.5]", kEverything);
  EXPECT_LT(GradientError(problem, SomeMotion(problem), 2.5e-4), 1e-6);
}

TEST(SpaceRollout, HasTheGradientOfItsDifferencesWhileItTumbles) {
  const Problem problem = InSpace("z_m = 0.45\nquaternion = [0.8, 0.36, -0.48, 0.0]", kEverything);
  EXPECT_LT(GradientError(problem, SomeMotion(problem), 2.5e-4), 1e-6);
}

TEST(RootChart, PullsBackWhatMoveOnDoesToSmallChanges) {
  // Differences of the map from angles and rates to those in the new chart of the undisturbed root.
  const std::array<double, 6> at = {0.3, -0.4, 0.25, 1.2, -0.7, 2.1};
  RootChart<Spatial> nominal;
  std::array<double, 6> y = at;
  const auto turn = nominal.MoveOn(&y[0], &y[3]);
  const std::array<double, 6> cotangent = {0.7, -1.1, 0.4, 0.9, 0.2, -0.6};
  std::array<double, 6> back = cotangent;
  RootChart<Spatial>::PullBack(turn, &back[0], &back[3]);
  for (std::size_t k = 0; k < 6; ++k) {
    const auto moved = [&](double h) {
      std::array<double, 6> z = at;
      z[k] += h;
      RootChart<Spatial> chart;
      chart.MoveOn(&z[0], &z[3]);
      // In the nominal chart: R = R0' R(a), of which a small a follows from the antisymmetric part.
      const SpaceMatrix small = nominal.axes.transpose() * chart.axes;
      const std::array<double, 3> a = {-(small(0, 2) - small(2, 0)) / 2,
                                       (small(2, 1) - small(1, 2)) / 2,
                                       (small(1, 0) - small(0, 1)) / 2};
      // The same angular velocity, by rates at those angles: w = E(a) a', E = 1 + dE there.
      const std::array<double, 3> w = {z[3], z[4], z[5]};
      const std::array<double, 3> rates = {w[0] - a[2] * w[1], w[1] + a[2] * w[0],
                                           w[2] - a[1] * w[0]};
      double sum = 0;
      for (std::size_t i = 0; i < 3; ++i) sum += cotangent[i] * a[i] + cotangent[i + 3] * rates[i];
      return sum;
    };
    const double h = 1e-6;
    EXPECT_NEAR((moved(h) - moved(-h)) / (2 * h), back[k], 1e-8) << k;
  }
}

TEST(SpaceTask, IsRefusedByWhoTakesOnlyThePlane) {
  try {
    ParseTask(SpaceTask(kPitched, kUpright), "task.toml", ShippedRobot(), "tumbler.urdf");
    FAIL();
  } catch (const FileError& error) {
    EXPECT_NE(std::string(error.what()).find("floating"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace tumbler
