// Robots in space that lie on their backs get up: where they lie, the cost has no slope.

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/certify/task_result.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/search_in_space.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using testing::ReadFile;
using testing::SourcePath;

/// A plate of 1 kg with an arm on either side.
constexpr const char* kTurtle = R"(<robot name="turtle">
  <link name="shell">
    <inertial><mass value="1"/>
      <inertia ixx="0.0035" ixy="0" ixz="0" iyy="0.0076" iyz="0" izz="0.0108"/></inertial>
    <collision><geometry><box size="0.3 0.2 0.04"/></geometry></collision>
  </link>
  <joint name="left" type="revolute">
    <parent link="shell"/><child link="left_arm"/><origin xyz="0 0.1 0"/><axis xyz="1 0 0"/>
    <limit lower="-2.7" upper="2.7" effort="8" velocity="30"/>
  </joint>
  <link name="left_arm">
    <inertial><origin xyz="0 0.15 0"/><mass value="0.1"/>
      <inertia ixx="0.0008" ixy="0" ixz="0" iyy="0.00001" iyz="0" izz="0.0008"/></inertial>
    <collision><origin xyz="0 0.3 0"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
  <joint name="right" type="revolute">
    <parent link="shell"/><child link="right_arm"/><origin xyz="0 -0.1 0"/><axis xyz="1 0 0"/>
    <limit lower="-2.7" upper="2.7" effort="8" velocity="30"/>
  </joint>
  <link name="right_arm">
    <inertial><origin xyz="0 -0.15 0"/><mass value="0.1"/>
      <inertia ixx="0.0008" ixy="0" ixz="0" iyy="0.00001" iyz="0" izz="0.0008"/></inertial>
    <collision><origin xyz="0 -0.3 0"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
</robot>
)";

constexpr const char* kGetUp = R"(format = "tumbler-task"
version = 1
name = "get_up"
robot = "turtle.urdf"
root = "floating"
duration_s = 1.2
settle_s = 0.5
[start]
quaternion = [0.0, 1.0, 0.0, 0.0]
joints_rad = { left = -0.6, right = 0.6 }
[end]
joints_rad = { left = 0.6, right = -0.6 }
[spline]
control_points = 11
[limits]
rotor_inertia_kg_m2 = 0.0003
[[cost]]
term = "terminal"
of = "misalignment"
axis = [0.0, 0.0, 1.0]
along = [0.0, 0.0, 1.0]
when = "settled"
weight = 5.0
[[cost]]
term = "effort"
weight = 1.0e-4
[contact]
resting_contacts = 4
static_penetration_m = 4.0e-3
settling_time_s = 0.1
slip_speed_m_per_s = 0.1
mu = 0.7
[[obstacle]]
name = "ground"
point_m = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
[search]
seed = 1
)";

TEST(OnItsBack, ARobotOfTwoArmsTurnsOver) {
  const Task task =
      ParseTask(kGetUp, "get_up.toml", kTurtle, "turtle.urdf", TaskSpaces::kPlaneAndSpace);
  const Problem& problem = task.problem;
  // Nothing but the waypoints leads from there: the misalignment is as large as it can be.
  const std::vector<double> at_rest(problem.start_q.size());
  EXPECT_NEAR(problem.cost.front().quantity.Value(problem.start_q, at_rest,
                                                  problem.space->start_orientation),
              2, 1e-6);
  WorkSettings settings;
  settings.quiet = true;
  settings.threads = 1;
  const TaskResult result = WorkOn(task, settings);
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_TRUE(result.look.acceptable()) << result.look.Objections();
  EXPECT_EQ(result.file->purpose.size(), 1U) << "the waypoints are none of the task's targets";
  settings.threads = 2;
  const TaskResult again = WorkOn(task, settings);
  ASSERT_TRUE(again.file);
  EXPECT_EQ(ContentHash(*again.file), ContentHash(*result.file));
}

TEST(OnItsBack, ASearchThatIsInterruptedHasItsBestMotionAsItIs) {
  const Task task =
      ParseTask(kGetUp, "get_up.toml", kTurtle, "turtle.urdf", TaskSpaces::kPlaneAndSpace);
  std::atomic<bool> interrupt = false;
  SolveOptions options;
  options.threads = 1;
  options.interrupt = &interrupt;
  options.progress = [&interrupt](const Evaluation& /*evaluation*/) { interrupt = true; };
  const SolveOutcome outcome = SolveInSpace(task.problem, options);
  EXPECT_TRUE(outcome.interrupted);
  ASSERT_EQ(outcome.solutions.size(), 1U);
  EXPECT_FALSE(outcome.solutions.front().finished);
  EXPECT_EQ(outcome.solutions.front().x.size(),
            static_cast<std::size_t>(task.problem.parameter_count()));
}

class GetsUp : public ::testing::TestWithParam<int> {};
TEST_P(GetsUp, AsAskedByAFinerStep) {
  Task task = LoadTask(SourcePath("primitives/solo12/tasks/nominal/get_up.toml"),
                       TaskSpaces::kPlaneAndSpace);
  task.problem.search.seed = static_cast<std::uint64_t>(GetParam());
  WorkSettings settings;
  settings.quiet = true;
  const TaskResult result = WorkOn(std::move(task), settings);
  ASSERT_TRUE(result.file) << result.cause;
  EXPECT_TRUE(result.look.acceptable()) << result.look.Objections();
}
INSTANTIATE_TEST_SUITE_P(Seeds, GetsUp, ::testing::Values(1, 2, 4));

}  // namespace
}  // namespace tumbler
