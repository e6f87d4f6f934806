// Task files: the effect of defaults and tightened limits, and the pose from which a robot starts.
// Refusals of bad files are in bad_input_test.cc.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include <cmath>

#include "common/files/toml_reader.h"
#include "offline/model/contact_intent.h"
#include "offline/model/contact_model.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/model/shape.h"
#include "offline/problem/space_task.h"
#include "offline/problem/task_toml.h"
#include "tests/support/docs_tables.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::LongHandstandTask;
using testing::Replaced;
using testing::ShippedRobot;
using testing::TaskFolder;

Problem Parse(const std::string& task) {
  return ParseTask(task, "task.toml", ShippedRobot(), "robot.urdf").problem;
}

/// The acceleration of every coordinate with the joints held.
std::vector<double> Accelerations(const Problem& problem, const std::vector<double>& q,
                                  double* normal_force_n) {
  HybridDynamics<Plane> dynamics(problem.scene.robot.tree);
  ContactModel<Plane> contact(problem.scene.contact, problem.scene.robot.shapes,
                              problem.scene.obstacles);
  std::vector<double> qd(q.size()), qdd(q.size()), tau(q.size());
  dynamics.SetState(q, qd);
  contact.Apply(dynamics);
  dynamics.Solve(qdd, tau);
  *normal_force_n = 0;
  for (const auto& active : contact.active()) *normal_force_n += active.normal_force_n;
  return qdd;
}

TEST(Task, HoldsWhatItsTextSays) {
  const Problem problem = Parse(LongHandstandTask());
  EXPECT_EQ(problem.name, "handstand");
  EXPECT_EQ(problem.duration_s, 1.2);
  EXPECT_EQ(problem.settle_s, 0.3);
  ASSERT_EQ(problem.joints.size(), 2U);
  EXPECT_EQ(problem.joints[0].end_rad, 0);
  EXPECT_EQ(problem.joints[0].limits.torque_max_nm, 8) << "the URDF's";
  EXPECT_EQ(problem.joints[0].limits.velocity_max_rad_s, 20) << "the URDF's";
  EXPECT_EQ(problem.joints[0].limits.acceleration_max_rad_s2, 400) << "the task's";
  EXPECT_EQ(problem.parameter_count(), 12);
  ASSERT_EQ(problem.cost.size(), 3U);
  EXPECT_EQ(problem.cost[2].kind, CostTerm::Kind::kEffort);
  EXPECT_EQ(problem.cost[2].weight, 1e-4);
  ASSERT_TRUE(problem.target_pitch_rad.has_value());
  EXPECT_DOUBLE_EQ(*problem.target_pitch_rad, M_PI / 2);
}

/// The shipped task with its contact law, or part of it, replaced.
std::string WithContact(const std::string& contact) {
  return Replaced(LongHandstandTask(),
                  "stiffness_n_per_m = 2.5e4\ndamping_n_s_per_m = 100.0\nd_on_m = 0.01\nd_off_m = "
                  "0.0075\nmu = 0.3\nv_max_m_per_s = 0.05",
                  contact);
}
const char* const kIntent =
    "static_penetration_m = 2.0e-3\nsettling_time_s = 0.15\nslip_speed_m_per_s = 0.03\n";

TEST(Task, ContactByIntentDoesWhatItSaysOnAsManyContactsAsItSays) {
  for (const int contacts : {1, 2, 4}) {
    SCOPED_TRACE(contacts);
    const Problem problem =
        Parse(WithContact(kIntent + fmt::format("resting_contacts = {}\n", contacts)));
    const ContactLaw& law = problem.scene.contact;
    // A block of the robot's mass: its rest and the decay of its bounce.
    Tree<Plane> tree;
    tree.gravity = problem.scene.robot.tree.gravity;
    Dof<Plane> up;
    up.kind = JointKind::kPrismatic;
    up.direction = {0, 1};
    up.mass_kg = 1.8;
    tree.dofs = {up};
    HybridDynamics<Plane> dynamics(tree);
    std::vector<ContactShape<Plane>> shapes;
    for (int k = 0; k < contacts; ++k) {
      shapes.push_back({fmt::format("block/{}", k), 0, Shape<Plane>::Sphere({0.1 * k, 0}, 0.01)});
    }
    ContactModel<Plane> contact(law, shapes, {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})}});
    const double rest = 0.01 + law.d_on_m - 2e-3;
    std::vector<double> q = {rest}, qd = {0.0}, qdd = {0.0}, tau = {0.0};
    const auto evaluate = [&] {
      dynamics.SetState(q, qd);
      contact.Apply(dynamics);
      dynamics.Solve(qdd, tau);
    };
    evaluate();
    EXPECT_NEAR(qdd[0], 0, 1e-9) << "it rests 2 mm deep";
    const double bounce = 2e-4;
    q[0] += bounce;
    const double h = 1e-5;
    double after = 0;
    for (double t = 0; t < 0.3; t += h) {
      evaluate();
      qd[0] += h * qdd[0];
      q[0] += h * qd[0];
      if (t > 0.15) after = std::max(after, std::abs(q[0] - rest));
    }
    EXPECT_LT(after, 0.02 * bounce);
    EXPECT_GT(after, 0.002 * bounce) << "nor is it much faster than asked for";
    EXPECT_EQ(law.v_max_m_per_s, 0.03);
    EXPECT_NEAR(law.d_on_m, (contacts + 2) * 2e-3, 1e-15);
    EXPECT_NEAR(law.d_off_m, law.d_on_m - 1.5e-3, 1e-15);
    EXPECT_EQ(law.mu, 0.3) << "the default";
    // With the weight on one contact it is still in the layer.
    EXPECT_GT(law.d_on_m, 1.8 * 9.81 / law.stiffness_n_per_m);
  }
}

TEST(Task, LayerAndFrictionMayBeGivenBesideTheIntent) {
  const Problem problem =
      Parse(WithContact(std::string(kIntent) + "d_on_m = 0.01\nd_off_m = 0.005\nmu = 0.7\n"));
  EXPECT_EQ(problem.scene.contact.d_on_m, 0.01);
  EXPECT_EQ(problem.scene.contact.d_off_m, 0.005);
  EXPECT_EQ(problem.scene.contact.mu, 0.7);
  EXPECT_NEAR(problem.scene.contact.stiffness_n_per_m, 1.8 * 9.81 / 2e-3, 1e-9);
}

TEST(TaskContact, ALayerInWhichOneOfTheRestingContactsCannotCarryTheRobotIsRefused) {
  const std::string four = std::string(kIntent) + "resting_contacts = 4\n";
  EXPECT_EQ(Parse(WithContact(four + "d_on_m = 0.0081\n")).scene.contact.d_on_m, 0.0081);
  EXPECT_THROW(Parse(WithContact(four + "d_on_m = 0.008\n")), std::runtime_error);
}

TEST(TaskContact, ARobotRestsAsDeepAsIntendedInALayerOfAnyThickness) {
  for (const char* const layer : {"", "d_on_m = 0.003\n", "d_on_m = 0.01\n", "d_on_m = 0.03\n"}) {
    const ContactLaw law = Parse(WithContact(std::string(kIntent) + layer)).scene.contact;
    EXPECT_LE(law.d_on_m - law.d_off_m, 2.0e-3) << "where it rests, the smoothing is 1: " << layer;
    EXPECT_LT(law.d_off_m, law.d_on_m);
  }
}

TEST(Task, TheStepFollowsFromContactWhereItIsNotGiven) {
  const std::string given = "[solver]\nstep_s = 1.0e-3";
  EXPECT_EQ(Parse(Replaced(LongHandstandTask(), "1.0e-3", "5.0e-3", "[solver]")).solver.step_s,
            5e-3);
  const Problem soft = Parse(Replaced(LongHandstandTask(), given, ""));
  EXPECT_EQ(soft.solver.step_s, 1e-3) << "no longer than the default";
  EXPECT_GT(soft.advisable_step_s, 1e-3);
  const Problem stiff = Parse(Replaced(
      WithContact("static_penetration_m = 1.0e-5\nsettling_time_s = 0.01\nslip_speed_m_per_s = "
                  "0.05\nd_on_m = 0.004"),
      given, ""));
  EXPECT_LT(stiff.advisable_step_s, 5e-4);
  EXPECT_EQ(stiff.solver.step_s, stiff.advisable_step_s);
  EXPECT_EQ(stiff.search.step_s, 1.5 * stiff.advisable_step_s);
  EXPECT_EQ(stiff.solver.screen_step_s, 2 * stiff.advisable_step_s);
  const Problem sticky = Parse(Replaced(
      WithContact("stiffness_n_per_m = 1.0e3\nv_max_m_per_s = 1.0e-3\nd_on_m = 0.04"), given, ""));
  EXPECT_LT(sticky.advisable_step_s, 1e-4) << "friction at rest is a stiff damper";
}

TEST(ContactIntent, TheAdvisableStepIsStableAndThreeTimesItIsNot) {
  // A block held by a spring and damper or by friction alone, stepped by Runge-Kutta.
  const auto grows = [](const ContactLaw& law, double mass, double step) {
    Tree<Plane> tree;
    for (int i = 0; i < 2; ++i) {
      Dof<Plane> dof;
      dof.parent = i - 1;
      dof.kind = JointKind::kPrismatic;
      dof.direction[i] = 1;
      dof.massless = i == 0;
      if (i == 1) dof.mass_kg = mass, dof.inertia_kg_m2 = 0.01;
      tree.dofs.push_back(dof);
    }
    tree.gravity = {0, -9.81};
    HybridDynamics<Plane> dynamics(tree);
    ContactModel<Plane> contact(law, {{"block/0", 1, Shape<Plane>::Sphere({0, 0}, 0.01)}},
                                {{"ground", Shape<Plane>::HalfSpace({0, 0}, {0, 1})}});
    Eigen::Vector4d y(0, 0.01 + law.d_on_m - mass * 9.81 / law.stiffness_n_per_m, 1e-7, 1e-7);
    const auto rate = [&](const Eigen::Vector4d& at) -> Eigen::Vector4d {
      std::vector<double> qdd(2), tau(2);
      dynamics.SetState(std::vector<double>{at[0], at[1]}, std::vector<double>{at[2], at[3]});
      contact.Apply(dynamics);
      dynamics.Solve(qdd, tau);
      return {at[2], at[3], qdd[0], qdd[1]};
    };
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector4d k1 = rate(y), k2 = rate(y + step / 2 * k1),
                            k3 = rate(y + step / 2 * k2), k4 = rate(y + step * k3);
      y += step / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    return std::max(std::abs(y[2]), std::abs(y[3])) > 1e-6;
  };
  ContactLaw spring;
  spring.v_max_m_per_s = 10;
  spring.damping_n_s_per_m = 20;
  ContactLaw damper = spring;
  damper.damping_n_s_per_m = 2000;
  ContactLaw friction;
  friction.v_max_m_per_s = 1e-3;
  for (const ContactLaw& law : {spring, damper, friction}) {
    const double step = AdvisableStep(law, 2, 2 * 9.81);
    EXPECT_FALSE(grows(law, 2, step));
    EXPECT_FALSE(grows(law, 2, 2 * step));
    EXPECT_TRUE(grows(law, 2, 3 * step));
  }
}

TEST(ContactIntent, TheSmallestEffectiveMassIsThatOfARodsEnd) {
  // Pushed at its end, across, a free rod answers with a quarter of its mass.
  Tree<Plane> tree;
  for (int i = 0; i < 3; ++i) {
    Dof<Plane> dof;
    dof.parent = i - 1;
    dof.kind = i < 2 ? JointKind::kPrismatic : JointKind::kRevolute;
    if (i < 2) dof.direction[i] = 1;
    dof.massless = i < 2;
    if (i == 2) dof.mass_kg = 3, dof.inertia_kg_m2 = 3 * 0.4 * 0.4 / 12;
    tree.dofs.push_back(dof);
  }
  tree.gravity = {0, -9.81};
  const std::vector<ContactShape<Plane>> shapes = {
      {"rod/0", 2, Shape<Plane>::Sphere({0.2, 0}, 0.01)},
      {"rod/1", 2, Shape<Plane>::Sphere({0, 0}, 0.01)}};
  const std::vector<double> q = {0.3, 0.4, 0.5};
  EXPECT_NEAR(SmallestEffectiveMass(tree, shapes, q), 0.75, 1e-12);
  for (auto& dof : tree.dofs) dof.prescribed = true;
  EXPECT_EQ(SmallestEffectiveMass(tree, shapes, q), std::numeric_limits<double>::infinity());
}

TEST(Task, ObstaclesOfEveryKindAreWhereTheTextPutsThem) {
  const Problem problem = Parse(Replaced(LongHandstandTask(), "[search]", R"(
[[obstacle]]
name = "drum"
kind = "sphere"
centre_m = [2.0, 0.1]
radius_m = 0.1
[[obstacle]]
name = "log"
kind = "capsule"
from_m = [3.0, 0.1]
to_m = [3.0, 0.5]
radius_m = 0.1
[[obstacle]]
name = "step"
kind = "box"
centre_m = [4.0, 0.0]
size_m = [1.0, 0.2]
pitch_rad = 0.3
[search])"));
  const auto top = [&](std::size_t i, double x) {  // the height of the obstacle above x
    double z = 3;
    for (int k = 0; k < 200; ++k)
      z -= FindNearPoint<Plane>(problem.scene.obstacles[i].shape, {x, z}, 0).d;
    return z;
  };
  EXPECT_NEAR(top(1, 2), 0.2, 1e-12);
  EXPECT_NEAR(top(2, 3), 0.6, 1e-12);
  EXPECT_NEAR(top(3, 4), 0.1 / std::cos(0.3), 1e-12);
  EXPECT_GT(top(3, 4.1), top(3, 4)) << "pitch is from +x towards +z";
}

TEST(Task, JointsMayHaveDifferentNumbersOfControlPoints) {
  const Problem problem = Parse(Replaced(LongHandstandTask(), "control_points = 12",
                                         "control_points = { leg2 = 12, leg1 = 11 }"));
  EXPECT_EQ(problem.joints[0].control_points, 11);
  EXPECT_EQ(problem.joints[1].control_points, 12);
  EXPECT_EQ(problem.parameter_count(), 11);
  EXPECT_EQ(problem.first_parameter(1), 5);
}

TEST(Task, GradientsAreTheAdjointUnlessThePapersAreAskedFor) {
  EXPECT_EQ(Parse(LongHandstandTask()).solver.gradient, SolverSettings::Gradient::kAdjoint);
  EXPECT_EQ(Parse(Replaced(LongHandstandTask(), "[solver]", "[solver]\ngradient = \"forward\""))
                .solver.gradient,
            SolverSettings::Gradient::kForward);
}

/// A task of the arm of sweeper.urdf, with its base fixed.
std::string SweeperTask(const std::string& locked, const std::string& more = "") {
  return R"(format = "tumbler-task"
version = 1
name = "sweep"
robot = "sweeper.urdf"
root = "fixed"
locked = )" +
         locked + R"(
duration_s = 0.5
obstacle = []
[start]
joints_rad = { shoulder_pitch = 0.0, elbow = 0.5 }
[end]
joints_rad = { shoulder_pitch = 0.4, elbow = 0.9 }
[[cost]]
term = "effort"
weight = 1.0
)" + more;
}
Problem ParseSweeper(const std::string& task) {
  const std::string file = testing::SourcePath("tests/data/robots/sweeper.urdf");
  return ParseTask(task, "task.toml", testing::ReadFile(file), "sweeper.urdf").problem;
}

TEST(Task, JointsThatAreLockedAreNoneOfTheMotionAndTheirLinksAreOneBody) {
  const Problem problem = ParseSweeper(SweeperTask("{ shoulder_yaw = 0.0, grip = 0.01 }"));
  ASSERT_EQ(problem.joints.size(), 2U);
  const PlanarRobot& robot = problem.scene.robot;
  ASSERT_EQ(robot.tree.dofs.size(), 2U);
  EXPECT_NEAR(robot.tree.dofs[1].mass_kg, 0.15 + 0.02 + 0.02, 1e-12) << "with both fingers";
  ASSERT_EQ(robot.locked.size(), 3U);
  EXPECT_EQ(robot.locked[2].with, "grip");
}

TEST(Task, WhatCannotBeLockedIsRefusedByName) {
  const auto mistake = [](const std::string& task) {
    try {
      ParseSweeper(task);
    } catch (const FileError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  EXPECT_THAT(mistake(SweeperTask("{ shoulder_yaw = 0.0, grip = 0.1 }")),
              HasSubstr("task.toml:6: locked.grip: is 0.1; allowed: where the robot's file lets it "
                        "be, 0.005 ... 0.03"));
  const std::string sweeper =
      testing::ReadFile(testing::SourcePath("tests/data/robots/sweeper.urdf"));
  EXPECT_THAT(
      [&] {
        ParseTask(SweeperTask("{ shoulder_yaw = 0.0, grip = 0.02 }"), "task.toml",
                  Replaced(sweeper, "<mimic joint=\"grip\"/>",
                           "<mimic joint=\"grip\" multiplier=\"2\"/>"),
                  "sweeper.urdf");
      },
      ::testing::Throws<FileError>(::testing::Property(
          &FileError::what,
          HasSubstr("locked.grip: is 0.02, which puts 'grip_mirror', which follows "
                    "it, at 0.04; allowed: where the robot's file lets it be"))));
  EXPECT_THAT(
      mistake(SweeperTask("{ shoulder_yaw = 0.0, grip = 0.01, grip_mirror = 0.02 }")),
      HasSubstr("locked.grip_mirror: is 0.02, but it follows 'grip', with which it is at 0.01; "
                "leave it out"));
  EXPECT_THAT(mistake(SweeperTask("{ shoulder_yawn = 0.0 }")),
              HasSubstr("locked.shoulder_yawn: is no joint of the robot that moves; its joints: "));
  EXPECT_THAT(mistake(SweeperTask("{ camera_mount = 0.0 }")), HasSubstr("locked.camera_mount: "));
  EXPECT_THAT(mistake(SweeperTask("{ shoulder_yaw = 0.0 }")),
              HasSubstr("joint 'grip_mirror': follows joint 'grip' (mimic)"));
  EXPECT_THAT(mistake(SweeperTask("{ shoulder_yaw = 0.0, grip = 0.01, elbow = 0.5 }")),
              HasSubstr("joints_rad.elbow: is locked, so nothing moves it"));
  EXPECT_THAT(mistake(Replaced(SweeperTask("{ shoulder_yaw = 0.0, grip = 0.01 }"),
                               "shoulder_yaw = 0.0", "shoulder_yaw = 1.5")),
              HasSubstr("its axis in the robot's frame is (-0.9975, 0.07074, 0)"));
}

TEST(Task, LimitsOfAJointTightenThoseOfAll) {
  const Problem problem =
      Parse(Replaced(LongHandstandTask(), "[[cost]]",
                     "velocity_max_rad_s = 12.0\n[limits.leg2]\nvelocity_max_rad_s = "
                     "5.0\ntorque_max_nm = 2.0\nrotor_inertia_kg_m2 = 0.002\n[[cost]]"));
  EXPECT_EQ(problem.joints[0].limits.velocity_max_rad_s, 12);
  EXPECT_EQ(problem.joints[1].limits.velocity_max_rad_s, 5);
  EXPECT_EQ(problem.joints[0].limits.torque_max_nm, 8);
  EXPECT_EQ(problem.joints[1].limits.torque_max_nm, 2);
  EXPECT_EQ(problem.scene.robot.tree.dofs[3].rotor_inertia_kg_m2, 0.001);
  EXPECT_EQ(problem.scene.robot.tree.dofs[4].rotor_inertia_kg_m2, 0.002);
}

TEST(Task, LimitsOfAJointAreNoLooserThanThoseOfAll) {
  try {
    Parse(
        Replaced(LongHandstandTask(), "[[cost]]",
                 "velocity_max_rad_s = 12.0\n[limits.leg2]\nvelocity_max_rad_s = 13.0\n[[cost]]"));
    FAIL() << "13 is above 12";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("limits.leg2.velocity_max_rad_s: is 13; allowed: above 0 ... 12"));
  }
}

TEST(Task, ANormalOfAnyLengthIsAUnitVectorAfterwards) {
  const Problem problem =
      Parse(Replaced(LongHandstandTask(), "normal = [0.0, 1.0]", "normal = [0, 20]"));
  EXPECT_DOUBLE_EQ(problem.scene.obstacles[0].shape.normal.norm(), 1);
}

/// What is said of the shipped task with these keys instead of its duration.
std::string RefusalOfDuration(const std::string& keys) {
  try {
    Parse(Replaced(LongHandstandTask(), "duration_s = 1.2", keys));
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

TEST(Task, TheTorqueAtRestIsHeldWhereTheTaskSaysSoAndARestIsSimulated) {
  const auto with = [](const std::string& keys) {
    return Replaced(LongHandstandTask(), "duration_s = 1.2", "duration_s = 1.2\n" + keys);
  };
  EXPECT_EQ(Parse(LongHandstandTask()).held_torque, HeldTorque::kEnd);
  EXPECT_EQ(Parse(with("held_torque = \"end\"")).held_torque, HeldTorque::kEnd);
  const std::string rest = with("held_torque = \"rest\"");
  EXPECT_EQ(Parse(rest).held_torque, HeldTorque::kRest);
  const auto refusal = [](const std::string& text) -> std::string {
    try {
      Parse(text);
    } catch (const FileError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(with("held_torque = \"now\"")), HasSubstr("held_torque"));
  EXPECT_THAT(refusal(Replaced(rest, "settle_s = 0.3", "settle_s = 0")),
              HasSubstr("held_torque: is \"rest\", but settle_s is 0"));
  EXPECT_THAT(refusal(rest + "\n[robust]\nmass = 0.05\n[robust.feedback]\nlink = \"leg2_link\"\n"),
              HasSubstr("[robust.feedback]"));
}

TEST(Task, BoundsOfTheDurationComeInPairsAroundTheTasksOwn) {
  const Problem problem = Parse(Replaced(LongHandstandTask(), "duration_s = 1.2",
                                         "duration_s = 1.2\nduration_min_s = 0.8\n"
                                         "duration_max_s = 2.5"));
  ASSERT_TRUE(problem.free_duration);
  EXPECT_EQ(problem.free_duration->min_s, 0.8);
  EXPECT_EQ(problem.free_duration->max_s, 2.5);
  EXPECT_EQ(problem.parameter_count(), 13) << "the duration is one of them";
  EXPECT_TRUE(problem.is_duration(12));
  EXPECT_FALSE(Parse(LongHandstandTask()).free_duration);
  EXPECT_THAT(
      RefusalOfDuration("duration_s = 1.2\nduration_max_s = 2.0"),
      HasSubstr("duration_min_s: is missing; allowed: both bounds of the duration, or none"));
  EXPECT_THAT(RefusalOfDuration("duration_s = 1.2\nduration_min_s = 1.3\nduration_max_s = 2.0"),
              HasSubstr("duration_min_s: is 1.3 s, but the task's duration_s is 1.2 s"));
  EXPECT_THAT(RefusalOfDuration("duration_s = 1.2\nduration_min_s = 0.8\nduration_max_s = 1.1"),
              HasSubstr("duration_max_s: is 1.1 s, but the task's duration_s is 1.2 s"));
  EXPECT_THAT(RefusalOfDuration("duration_s = 1.2\nduration_min_s = 2.0\nduration_max_s = 0.8"),
              HasSubstr("duration_min_s: is 2 s, above duration_max_s, which is 0.8 s"));
}

TEST(Task, ACostLooksAtATimeThatIsWithinEveryMotionWhoseDurationIsFree) {
  const auto refusal = [](const std::string& time) {
    const std::string task =
        Replaced(LongHandstandTask(), "duration_s = 1.2",
                 "duration_s = 1.2\nduration_min_s = 0.8\nduration_max_s = 2.5") +
        "\n[[cost]]\nterm = \"terminal\"\nof = \"z\"\nweight = 1.0\ntime_s = " + time + "\n";
    try {
      Parse(task);
    } catch (const FileError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal("0.79"), "");
  for (const char* const time : {"0.795", "1.2", "1.3", "1.5"}) {
    EXPECT_THAT(refusal(time), HasSubstr("time_s: is not within every motion whose duration is "
                                         "free; allowed: up to 0.79 s"));
  }
}

TEST(Task, EffortTermsAddUp) {
  const Problem problem = Parse(Replaced(LongHandstandTask(), "[contact]",
                                         "[[cost]]\nterm = \"effort\"\nweight = 2\n[contact]"));
  ASSERT_EQ(problem.cost.size(), 3U);
  EXPECT_DOUBLE_EQ(problem.cost[2].weight, 2 + 1e-4);
}

TEST(Task, RobotsPathIsRelativeToTheTasksFolder) {
  const TaskFolder folder(LongHandstandTask());
  const Task task = LoadTask(folder.task_file());
  EXPECT_EQ(task.robot_text, ShippedRobot());
  EXPECT_EQ(task.task_text, LongHandstandTask());
}

TEST(RestPose, IsAtRestAndCarriesTheWeight) {
  const Problem problem = Parse(LongHandstandTask());
  double normal_force = 0;
  for (const double qdd : Accelerations(problem, problem.start_q, &normal_force))
    EXPECT_NEAR(qdd, 0, 1e-4);
  EXPECT_NEAR(normal_force, 1.8 * 9.81, 1e-3);
  EXPECT_NEAR(problem.start_q[2], 0, 1e-6) << "as symmetric as the robot";
}

TEST(RestPose, FollowsASlopeAndARaisedGround) {
  const Problem raised =
      Parse(Replaced(LongHandstandTask(), "point_m = [0.0, 0.0]", "point_m = [0.0, 3.5]"));
  const Problem level = Parse(LongHandstandTask());
  EXPECT_NEAR(raised.start_q[1], level.start_q[1] + 3.5, 1e-6);
  // On a slope within friction, the regularised law creeps: v / v_max = slope / mu / 1.5 and more,
  // so no slope is ever at rest, and the message says so.
  EXPECT_THROW(Parse(Replaced(LongHandstandTask(), "normal = [0.0, 1.0]", "normal = [0.1, 1.0]")),
               FileError);
}

TEST(RestPose, StandsOnOneLegUpsideDownAsTheHandstandEnds) {
  std::string text =
      Replaced(LongHandstandTask(), "leg1 = -1.5707963267948966, leg2 = 1.5707963267948966",
               "leg1 = 0.0, leg2 = 0.0");
  text = Replaced(text, "pitch_rad = 0.0", "pitch_rad = 1.5707963267948966");
  const Problem problem = Parse(text);
  double normal_force = 0;
  for (const double qdd : Accelerations(problem, problem.start_q, &normal_force))
    EXPECT_NEAR(qdd, 0, 1e-4);
  // Half the middle link, a leg, and a foot's radius above the ground, and the layer that it hardly
  // sinks into.
  EXPECT_NEAR(problem.start_q[1], 0.15 + 0.2 + 0.01 + problem.scene.contact.d_on_m, 0.002);
}

TEST(RestPose, AGivenHeightIsTakenAsItIs) {
  const Problem problem = Parse(Replaced(LongHandstandTask(), "pitch_rad = 0.0",
                                         "pitch_rad = 0.3\nz_m = 2.5\nx_m = -1", "[start]"));
  EXPECT_EQ(problem.start_q[0], -1);
  EXPECT_EQ(problem.start_q[1], 2.5);
  EXPECT_EQ(problem.start_q[2], 0.3);
}

TEST(Task, TheTablesOfTheDocumentAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", TaskKeyTables());
  testing::ExpectTables("docs/space.md", SpaceTaskKeyTables());
}

}  // namespace
}  // namespace tumbler
