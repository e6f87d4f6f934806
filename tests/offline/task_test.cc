// Task files: what defaults and tightened limits come to, and the pose from which a robot starts.
// Refusals of bad files are in bad_input_test.cc.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/toml_reader.h"
#include "offline/dynamics/hybrid_dynamics.h"
#include "offline/problem/task_toml.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Replaced;
using testing::ShippedRobot;
using testing::ShippedTask;
using testing::TaskFolder;

Problem Parse(const std::string& task) {
  return ParseTask(task, "task.toml", ShippedRobot(), "robot.urdf").problem;
}

/// The acceleration of every coordinate with the joints held.
std::vector<double> Accelerations(const Problem& problem, const std::vector<double>& q,
                                  double* normal_force_n) {
  HybridDynamics<Plane> dynamics(problem.robot.tree);
  ContactModel<Plane> contact(problem.contact, problem.robot.spheres, problem.obstacles);
  std::vector<double> qd(q.size()), qdd(q.size()), tau(q.size());
  dynamics.SetState(q, qd);
  contact.Apply(dynamics);
  dynamics.Solve(qdd, tau);
  *normal_force_n = 0;
  for (const auto& active : contact.active()) *normal_force_n += active.normal_force_n;
  return qdd;
}

TEST(Task, ShippedOneHoldsWhatItsTextSays) {
  const Problem problem = Parse(ShippedTask());
  EXPECT_EQ(problem.name, "handstand");
  EXPECT_EQ(problem.duration_s, 1.2);
  EXPECT_EQ(problem.settle_s, 0.3);
  ASSERT_EQ(problem.joints.size(), 2U);
  EXPECT_EQ(problem.joints[0].end_rad, 0);
  EXPECT_EQ(problem.joints[0].limits.torque_max_nm, 8) << "the URDF's";
  EXPECT_EQ(problem.joints[0].limits.velocity_max_rad_s, 20) << "the URDF's";
  EXPECT_EQ(problem.joints[0].limits.acceleration_max_rad_s2, 400) << "the task's";
  EXPECT_EQ(problem.parameter_count(), 12);
  EXPECT_EQ(problem.terminal.size(), 2U);
  EXPECT_EQ(problem.effort_weight, 1e-4);
  EXPECT_DOUBLE_EQ(problem.target_pitch_rad, M_PI / 2);
}

TEST(Task, JointsMayHaveDifferentNumbersOfControlPoints) {
  const Problem problem = Parse(
      Replaced(ShippedTask(), "control_points = 12", "control_points = { leg2 = 12, leg1 = 11 }"));
  EXPECT_EQ(problem.joints[0].control_points, 11);
  EXPECT_EQ(problem.joints[1].control_points, 12);
  EXPECT_EQ(problem.parameter_count(), 11);
  EXPECT_EQ(problem.first_parameter(1), 5);
}

TEST(Task, GradientsAreTheAdjointUnlessThePapersAreAskedFor) {
  EXPECT_EQ(Parse(ShippedTask()).solver.gradient, SolverSettings::Gradient::kAdjoint);
  EXPECT_EQ(Parse(Replaced(ShippedTask(), "[solver]", "[solver]\ngradient = \"forward\""))
                .solver.gradient,
            SolverSettings::Gradient::kForward);
}

TEST(Task, LimitsOfAJointTightenThoseOfAll) {
  const Problem problem =
      Parse(Replaced(ShippedTask(), "[[cost]]",
                     "velocity_max_rad_s = 12.0\n[limits.leg2]\nvelocity_max_rad_s = "
                     "5.0\ntorque_max_nm = 2.0\nrotor_inertia_kg_m2 = 0.002\n[[cost]]"));
  EXPECT_EQ(problem.joints[0].limits.velocity_max_rad_s, 12);
  EXPECT_EQ(problem.joints[1].limits.velocity_max_rad_s, 5);
  EXPECT_EQ(problem.joints[0].limits.torque_max_nm, 8);
  EXPECT_EQ(problem.joints[1].limits.torque_max_nm, 2);
  EXPECT_EQ(problem.robot.tree.dofs[3].rotor_inertia_kg_m2, 0.001);
  EXPECT_EQ(problem.robot.tree.dofs[4].rotor_inertia_kg_m2, 0.002);
}

TEST(Task, LimitsOfAJointAreNoLooserThanThoseOfAll) {
  try {
    Parse(
        Replaced(ShippedTask(), "[[cost]]",
                 "velocity_max_rad_s = 12.0\n[limits.leg2]\nvelocity_max_rad_s = 13.0\n[[cost]]"));
    FAIL() << "13 is above 12";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("limits.leg2.velocity_max_rad_s: is 13; allowed: above 0 ... 12"));
  }
}

TEST(Task, ANormalOfAnyLengthIsAUnitVectorAfterwards) {
  const Problem problem = Parse(Replaced(ShippedTask(), "normal = [0.0, 1.0]", "normal = [0, 20]"));
  EXPECT_DOUBLE_EQ(problem.obstacles[0].normal.norm(), 1);
}

TEST(Task, EffortTermsAddUp) {
  const Problem problem = Parse(
      Replaced(ShippedTask(), "[contact]", "[[cost]]\nterm = \"effort\"\nweight = 2\n[contact]"));
  EXPECT_DOUBLE_EQ(problem.effort_weight, 2 + 1e-4);
}

TEST(Task, RobotsPathIsRelativeToTheTasksFolder) {
  const TaskFolder folder(ShippedTask());
  const Task task = LoadTask(folder.task_file());
  EXPECT_EQ(task.robot_text, ShippedRobot());
  EXPECT_EQ(task.task_text, ShippedTask());
}

TEST(RestPose, IsAtRestAndCarriesTheWeight) {
  const Problem problem = Parse(ShippedTask());
  double normal_force = 0;
  for (const double qdd : Accelerations(problem, problem.start_q, &normal_force))
    EXPECT_NEAR(qdd, 0, 1e-4);
  EXPECT_NEAR(normal_force, 1.8 * 9.81, 1e-3);
  EXPECT_NEAR(problem.start_q[2], 0, 1e-6) << "as symmetric as the robot";
}

TEST(RestPose, FollowsASlopeAndARaisedGround) {
  const Problem raised =
      Parse(Replaced(ShippedTask(), "point_m = [0.0, 0.0]", "point_m = [0.0, 3.5]"));
  const Problem level = Parse(ShippedTask());
  EXPECT_NEAR(raised.start_q[1], level.start_q[1] + 3.5, 1e-6);
  // On a slope within friction, the regularised law creeps: v / v_max = slope / mu / 1.5 and more,
  // so no slope is ever at rest, and the message says so.
  EXPECT_THROW(Parse(Replaced(ShippedTask(), "normal = [0.0, 1.0]", "normal = [0.1, 1.0]")),
               FileError);
}

TEST(RestPose, StandsOnOneLegUpsideDownAsTheHandstandEnds) {
  std::string text =
      Replaced(ShippedTask(), "leg1 = -1.5707963267948966, leg2 = 1.5707963267948966",
               "leg1 = 0.0, leg2 = 0.0");
  text = Replaced(text, "pitch_rad = 0.0", "pitch_rad = 1.5707963267948966");
  const Problem problem = Parse(text);
  double normal_force = 0;
  for (const double qdd : Accelerations(problem, problem.start_q, &normal_force))
    EXPECT_NEAR(qdd, 0, 1e-4);
  // Half the middle link, a leg, and a foot's radius above the ground, less what it sinks in.
  EXPECT_NEAR(problem.start_q[1], 0.15 + 0.2 + 0.01, 0.004);
}

TEST(RestPose, AGivenHeightIsTakenAsItIs) {
  const Problem problem = Parse(Replaced(ShippedTask(), "pitch_rad = 0.0",
                                         "pitch_rad = 0.3\nz_m = 2.5\nx_m = -1", "[start]"));
  EXPECT_EQ(problem.start_q[0], -1);
  EXPECT_EQ(problem.start_q[1], 2.5);
  EXPECT_EQ(problem.start_q[2], 0.3);
}

}  // namespace
}  // namespace tumbler
