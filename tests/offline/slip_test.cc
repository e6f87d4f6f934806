// The term `slip` of a cost in space: a block that slides a known way.

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "offline/certify/second_look.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/random_starts.h"
#include "offline/solve/rollout.h"

namespace tumbler {
namespace {

constexpr double kSlope = 0.4, kMass_kg = 8, kFootRadius_m = 0.02;

/// A block on four feet, with a light arm on top that touches nothing.
constexpr const char* kBlock = R"(<robot name="block">
  <link name="block">
    <inertial><mass value="7.9"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial>
    SHAPES
  </link>
  <link name="arm">
    <inertial><mass value="0.1"/>
      <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="arm" type="revolute">
    <parent link="block"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="100" velocity="10"/>
  </joint>
</robot>
)";

/// Its four feet, and a box of which the corners are where they touch.
constexpr const char* kFeet =
    R"(<collision><origin xyz="0.1 0.1 0"/><geometry><sphere radius="0.02"/></geometry></collision>
    <collision><origin xyz="0.1 -0.1 0"/><geometry><sphere radius="0.02"/></geometry></collision>
    <collision><origin xyz="-0.1 0.1 0"/><geometry><sphere radius="0.02"/></geometry></collision>
    <collision><origin xyz="-0.1 -0.1 0"/><geometry><sphere radius="0.02"/></geometry></collision>)";
constexpr const char* kBox =
    R"(<collision><geometry><box size="0.2 0.2 0.04"/></geometry></collision>)";

/// It lies on a slope that falls along x, its feet so high above where they would rest.
Problem OnASlope(double mu, double above_m, const char* shapes = kFeet) {
  const double load_n = kMass_kg * 9.81 * std::cos(kSlope) / 4;
  const double height_m = kFootRadius_m + 4e-3 - load_n / 1e4 + above_m;
  const std::string text =
      R"(format = "tumbler-task"
version = 1
name = "slides"
robot = "block.urdf"
root = "floating"
duration_s = 0.6
settle_s = 0.2
[start]
joints_rad = { arm = 0.0 }
x_m = )" +
      std::to_string(height_m * std::sin(kSlope)) +
      "\nz_m = " + std::to_string(height_m * std::cos(kSlope)) + "\nquaternion = [" +
      std::to_string(std::cos(kSlope / 2)) + ", 0.0, " + std::to_string(std::sin(kSlope / 2)) +
      R"(, 0.0]
[end]
joints_rad = { arm = 0.0 }
[[cost]]
term = "slip"
weight = 3.0
[contact]
stiffness_n_per_m = 1.0e4
damping_n_s_per_m = 100.0
d_on_m = 0.004
d_off_m = 0.003
v_max_m_per_s = 0.002
mu = )" +
      std::to_string(mu) +
      R"(
[[obstacle]]
name = "slope"
point_m = [0.0, 0.0, 0.0]
normal = [)" +
      std::to_string(std::sin(kSlope)) + ", 0.0, " + std::to_string(std::cos(kSlope)) + "]\n";
  std::string block = kBlock;
  const std::string place = "SHAPES";
  block.replace(block.find(place), place.size(), shapes);
  return ParseTask(text, "slides.toml", block, "block.urdf", TaskSpaces::kPlaneAndSpace).problem;
}

TEST(Slip, OfABlockOnASlopeIsItsShareOfTheWeightTimesTheWayThatItSlides) {
  for (const double mu : {0.3, 0.0}) {
    const Problem problem = OnASlope(mu, 0);
    ASSERT_EQ(problem.cost.size(), 1U);
    EXPECT_TRUE(problem.cost[0].of_state()) << "lanes would take it";
    EXPECT_NEAR(problem.cost[0].robot_weight_n,
                kMass_kg * problem.space->scene.robot.tree.gravity.norm(), 1e-9);
    const std::vector<double> still(static_cast<std::size_t>(problem.parameter_count()), 0.0);
    const double g = problem.space->scene.robot.tree.gravity.norm();
    const double time_s = problem.duration_s + problem.settle_s;
    const double way_m =
        g * (std::sin(kSlope) - mu * std::cos(kSlope)) * time_s * time_s / 2;  // Coulomb's
    Rollout rollout(problem, 2.5e-4);
    const double slip_m = rollout.Run(still).cost / 3;
    EXPECT_NEAR(slip_m, std::cos(kSlope) * way_m, 5e-3 * way_m) << mu;
    double x_m = 0;
    rollout.VisitInSpace(still, 0, [&x_m](const SpaceSample& sample) { x_m = sample.q[0]; });
    const double slid_m = (x_m - problem.start_q[0]) / std::cos(kSlope);
    EXPECT_NEAR(slip_m, std::cos(kSlope) * slid_m, 2e-3 * way_m) << mu;
  }
}

TEST(Slip, IsSaidOfABoxAsOfOneOfItsCorners) {
  for (const char* shapes : {kFeet, kBox}) {
    const Problem problem = OnASlope(0.3, 0, shapes);
    const std::vector<double> still(static_cast<std::size_t>(problem.parameter_count()), 0.0);
    Rollout rollout(problem, 2.5e-4);
    double x_m = 0;
    rollout.VisitInSpace(still, 0, [&x_m](const SpaceSample& sample) { x_m = sample.q[0]; });
    const double slid_m = (x_m - problem.start_q[0]) / std::cos(kSlope);
    const SecondLook look = LookAgain(problem, still);
    ASSERT_TRUE(look.slip_m);
    EXPECT_NEAR(*look.slip_m, slid_m, 2e-3 * slid_m) << look.slip_of;
  }
}

TEST(Slip, WithoutLoadIsNoneAndHasNoGradient) {
  const Problem problem = OnASlope(0.3, 5.0);  // in the air until the end
  const std::vector<double> x = RandomStarts(problem).Draw(1);
  Rollout rollout(problem, 1e-3);
  OutputGradients gradient = OutputGradients::Of(rollout);
  const RolloutResult result = rollout.Run(x, gradient);
  EXPECT_FALSE(result.any_contact);
  EXPECT_EQ(result.cost, 0);
  EXPECT_EQ(gradient.row(0).cwiseAbs().maxCoeff(), 0);
}

}  // namespace
}  // namespace tumbler
