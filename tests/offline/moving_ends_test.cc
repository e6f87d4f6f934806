// Motions that start or end with joints in motion.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/files/sequence_toml.h"
#include "common/files/spline_extent.h"
#include "common/files/toml_reader.h"
#include "offline/certify/certificate.h"
#include "offline/certify/chain.h"
#include "offline/certify/second_look.h"
#include "offline/model/hybrid_dynamics.h"
#include "offline/problem/take_free.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/clearance_constraint.h"
#include "offline/solve/constraints.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "tests/support/crossing_legs.h"
#include "tests/support/files.h"
#include "tests/support/gradients.h"
#include "tests/support/handstand.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::LongHandstandTask;
using testing::Replaced;
using testing::ShippedRobot;
using testing::TaskFolder;
using testing::WriteFile;

/// A dropped robot that starts and ends in motion.
Problem Dropped(bool free_duration) {
  Problem problem = HandstandProblem(9);
  problem.start_q[1] += 0.05;
  problem.start_root_rates = {0.3, -0.4, 1.1};
  problem.joints[0].start_rad_s = 2;
  problem.joints[0].end_rad_s = -3;
  problem.joints[1].start_rad_s = -1.5;
  problem.duration_s = 0.5;
  problem.settle_s = 0;
  if (free_duration) problem.free_duration = DurationBounds{0.3, 0.9};
  CostTerm of_point = SquareTerm(CostTerm::When::kEnd, 0, true, 0.1, 0.7);
  of_point.point = PointOfLink(problem.scene.robot, "leg1_link", {0.2, 0});
  problem.cost = {SquareTerm(CostTerm::When::kEnd, 1, true, 0.2, 0.7), of_point,
                  SquareTerm(CostTerm::When::kSettled, 2, false, 1, 1), EffortTerm(1e-2)};
  return problem;
}

std::vector<double> Motion(const Problem& problem, std::uint64_t seed) {
  std::vector<double> x = RandomMotion(problem, seed);
  if (problem.free_duration) x.push_back(1.1);
  return x;
}

TEST(MovingEnds, APathHasThePositionVelocityAndNoAccelerationThatAreAskedForAtBothEnds) {
  for (const int degree : {3, 4, 5, 6, 7}) {
    for (const int points : {8, 9, 10, 24}) {
      Problem problem = HandstandProblem(points);
      problem.degree = degree;
      problem.duration_s = 0.73;
      problem.joints[1].start_rad_s = -2.5;
      problem.joints[1].end_rad_s = 4;
      const auto path = PositionSpline(problem, RandomMotion(problem, 7), 1);
      const auto first = path.Evaluate(0), last = path.Evaluate(problem.duration_s);
      EXPECT_NEAR(first.value, problem.joints[1].start_rad, 1e-12);
      EXPECT_NEAR(first.first, -2.5, 1e-11) << degree << " " << points;
      EXPECT_NEAR(first.second, 0, 1e-8) << degree << " " << points;
      EXPECT_NEAR(last.value, problem.joints[1].end_rad, 1e-12);
      EXPECT_NEAR(last.first, 4, 1e-11) << degree << " " << points;
      EXPECT_NEAR(last.second, 0, 1e-8) << degree << " " << points;
    }
  }
}

TEST(MovingEnds, ARobotThatIsThrownHasTheMomentumThatGravityLeavesIt) {
  Problem problem = Dropped(false);
  problem.scene.obstacles.clear();
  const std::vector<double> x = Motion(problem, 3);
  double mass_kg = 0;
  for (const Dof<Plane>& dof : problem.scene.robot.tree.dofs) mass_kg += dof.mass_kg;
  Plane::Vector start = Plane::Vector::Zero();
  Rollout(problem, 1e-4).Visit(x, 0, [&](const MotionSample& sample) {
    const Plane::Vector now = sample.dynamics->Momentum().f;
    if (sample.time_s == 0) {
      start = now;
      EXPECT_EQ(sample.qd, (std::vector<double>{0.3, -0.4, 1.1, 2, -1.5}));
    }
    EXPECT_NEAR(now.x(), start.x(), 1e-6) << sample.time_s;
    EXPECT_NEAR(now.y(), start.y() - mass_kg * 9.81 * sample.time_s, 1e-6) << sample.time_s;
    if (sample.time_s == problem.duration_s) {
      EXPECT_NEAR(sample.qd[3], -3, 1e-9);
      EXPECT_NEAR(sample.qd[4], 0, 1e-9);
    }
  });
}

TEST(MovingEnds, TheGradientIsThatOfCentralDifferencesAndForwardAndBackwardAgree) {
  for (const bool free_duration : {false, true}) {
    SCOPED_TRACE(free_duration ? "free duration" : "");
    const Problem problem = Dropped(free_duration);
    testing::ExpectTrueGradients(problem, Motion(problem, 4));
  }
}

TEST(MovingEnds, TheClearanceFollowsThePointsThatMoveWithTheDuration) {
  Problem problem = LoadTask(testing::SourcePath("tests/data/tasks/long_roll.toml")).problem;
  problem.settle_s = 0;
  problem.joints[0].start_rad_s = 3;
  problem.joints[1].end_rad_s = -2;
  problem.free_duration = DurationBounds{0.5 * problem.duration_s, 2 * problem.duration_s};
  std::vector<double> x = CrossingRoll();
  x.push_back(1.2);
  ClearanceConstraint clearance(problem, 1e-3);
  std::vector<double> gradient(x.size());
  ASSERT_GT(clearance.Evaluate(x, gradient), -1);
  std::vector<double> slower = x, faster = x;
  slower.back() += 1e-5;
  faster.back() -= 1e-5;
  EXPECT_NEAR(gradient.back(), (clearance.Evaluate(slower) - clearance.Evaluate(faster)) / 2e-5,
              1e-6 * (1 + std::abs(gradient.back())));
}

TEST(MovingEnds, LimitsAreThoseOfTheSplineThatIsWritten) {
  for (const bool free_duration : {false, true}) {
    const Problem problem = Dropped(free_duration);
    const std::vector<double> x = Motion(problem, 3);
    std::array<double, 3> largest{}, excess = {-1, -1, -1};
    for (std::size_t j = 0; j < problem.joints.size(); ++j) {
      const auto path = PositionSpline(problem, x, j);
      const JointLimits<double>& limits = problem.joints[j].limits;
      const std::array<double, 3> limit = {1, limits.velocity_max_rad_s,
                                           limits.acceleration_max_rad_s2};
      for (const std::size_t d : {1U, 2U}) {
        for (const double point : RefinedControlPoints(path, static_cast<int>(d), 8))
          largest[d] = std::max(largest[d], std::abs(point) / limit[d] - 1);
      }
    }
    for (const LinearRow& row : DerivativeLimitRows(problem)) {
      double& most = excess[static_cast<std::size_t>(row.derivative)];
      most = std::max(most, row.Excess(x));
    }
    for (const std::size_t d : {1U, 2U})
      EXPECT_NEAR(std::max(0.0, excess[d]), largest[d], 2e-6 * (1 + largest[d])) << d;
  }
}

/// The shipped task without a settle phase, with these keys in its [start] and [end].
std::string WithEnds(const std::string& start, const std::string& end,
                     const std::string& settle = "") {
  std::string task = Replaced(LongHandstandTask(), "settle_s = 0.3", settle);
  task = Replaced(task, "[end]\n", "[end]\n" + end + "\n");
  return Replaced(task, "pitch_rad = 0.0\n", "pitch_rad = 0.0\n" + start + "\n");
}

std::string Refusal(const std::string& task) {
  try {
    ParseTask(task, "task.toml", ShippedRobot(), "robot.urdf");
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(MovingEnds, AreReadAndRefusedByName) {
  const Problem problem =
      ParseTask(WithEnds("joints_rad_s = { leg1 = 1.5 }\nz_m_s = -0.5\npitch_rad_s = 2.0",
                         "joints_rad_s = { leg2 = -2.0 }"),
                "task.toml", ShippedRobot(), "robot.urdf")
          .problem;
  EXPECT_EQ(problem.joints[0].start_rad_s, 1.5);
  EXPECT_EQ(problem.joints[0].end_rad_s, 0);
  EXPECT_EQ(problem.joints[1].start_rad_s, 0);
  EXPECT_EQ(problem.joints[1].end_rad_s, -2);
  EXPECT_EQ(problem.start_root_rates, (std::array<double, 3>{0, -0.5, 2}));
  EXPECT_TRUE(problem.ends_moving());
  EXPECT_EQ(ExitAfter(problem), 0);

  EXPECT_THAT(Refusal(WithEnds("", "joints_rad_s = { leg1 = 1.0 }", "settle_s = 0.3")),
              AllOf(HasSubstr("settle_s: is 0.3 s, in which the joints are held"),
                    HasSubstr("allowed: 0")));
  EXPECT_THAT(
      Refusal(WithEnds("joints_rad_s = { leg1 = 20.0 }", "")),
      HasSubstr("start.joints_rad_s.leg1: is 20 rad/s; allowed: less than the joint's limit of "
                "20 rad/s"));
  EXPECT_THAT(Refusal(WithEnds("joints_rad_s = { leg3 = 1.0 }", "")),
              HasSubstr("is not a joint of the robot"));
  EXPECT_THAT(
      Refusal(WithEnds("joints_rad_s = { leg1 = -19.0 }", "")),
      AllOf(HasSubstr("puts a control point beside the end at"), HasSubstr("rad; allowed: ")));
}

/// An acrobot on a bar with friction, which begins and ends a swing in the same state.
std::string SwingTask(const std::string& duration) {
  return "format = \"tumbler-task\"\nversion = 1\nname = \"swing\"\nrobot = "
         "\"../robots/tumbler.urdf\"\nroot = \"hinge-y\"\n" +
         duration +
         "[start]\njoints_rad = { waist = 0.2 }\njoints_rad_s = { waist = 1.0 }\npitch_rad_s = "
         "3.0\n[end]\njoints_rad = { waist = 0.2 }\njoints_rad_s = { waist = 1.0 "
         "}\n[bar]\nfriction_nm_s_per_rad = 0.02\n[[cost]]\nterm = \"terminal\"\nof = "
         "\"pitch\"\nfrom_start = true\nweight = 10.0\ntolerance = 0.005\n[[cost]]\nterm = "
         "\"terminal\"\nof = \"pitch_rate\"\nfrom_start = true\nweight = 1.0\ntolerance = "
         "0.02\n[[cost]]\nterm = \"effort\"\nweight = 1e-3\n";
}

TEST(PeriodicMotion, ASwingWithFreePeriodRepeatsItselfInAChain) {
  const TaskFolder folder(
      SwingTask("duration_s = 1.3\nduration_min_s = 0.9\nduration_max_s = 1.8\n"),
      testing::ReadFile(testing::SourcePath("primitives/acrobot/acrobot.urdf")));
  Task task = LoadTask(folder.task_file());
  EXPECT_EQ(task.problem.cost[0].target, task.problem.start_q[2]);
  EXPECT_EQ(task.problem.cost[1].target, 3.0);
  // Without friction and motor torque it would swing by itself.
  std::vector<double> x;
  for (int i = 0; i < task.problem.joints[0].free_points(); ++i) x.push_back(0.2);
  x.push_back(1);
  const SolveOutcome outcome = SolveFromGuess(task.problem, x, {});
  Solution best = outcome.solutions.front();
  ASSERT_TRUE(best.feasible());
  TakeFree(task.problem, best.x);
  EXPECT_TRUE(LookAgain(task.problem, best.x).acceptable())
      << LookAgain(task.problem, best.x).Objections();
  EXPECT_GT(task.problem.duration_s, 0.9);
  EXPECT_LT(task.problem.duration_s, 1.8);
  WriteFile(folder.path() / "swing.toml", ToToml(MakePrimitiveFile(task, outcome, best)));
  WriteFile(folder.path() / "swings.toml",
            "format = \"tumbler-sequence\"\nversion = 1\nname = \"swings\"\nstart = "
            "\"swing\"\n[primitives]\nswing = \"swing.toml\"\n[[node]]\nname = "
            "\"swing\"\nprimitive = \"swing\"\nsafe = true\nends_cycle = true\n[[edge]]\nfrom = "
            "\"swing\"\nto = \"swing\"\nsettle_s = 0.0\nwhen = \"always\"\n");
  const SequenceFile file = LoadSequence(folder.path() / "swings.toml");
  ChainOptions options;
  options.cycles = 3;
  options.last_hold_s = 0;
  const ChainOutcome chain = SimulateChain(SimulatedMotion(file), options);
  ASSERT_FALSE(chain.failure) << chain.failure->text;
  EXPECT_GE(chain.cycles, 3);
  for (const PlayedNode& passage : chain.passages) {
    EXPECT_NEAR(passage.entry_pitch_error_rad, 0, 0.1);
    EXPECT_NEAR(passage.entry_speed, 3.0, 0.3);
  }
}

/// Tasks for a robot that falls freely: the first motion ends with both legs swinging, the second
/// takes them over and stops them.
std::string FallingTask(const std::string& name, const std::string& start, const std::string& end,
                        const std::string& settle) {
  return "format = \"tumbler-task\"\nversion = 1\nname = \"" + name +
         "\"\nrobot = \"../robots/tumbler.urdf\"\nduration_s = 0.4\n" + settle +
         "obstacle = []\n[start]\nz_m = 5.0\n" + start + "\n[end]\n" + end +
         "\n[[cost]]\nterm = \"effort\"\nweight = 1.0\n";
}
constexpr const char* kSwinging = "joints_rad_s = { leg1 = 3.0, leg2 = -2.0 }";
constexpr const char* kBetween = "joints_rad = { leg1 = -0.8, leg2 = 0.9 }";

/// Solves a task from straight paths.
PrimitiveFile Made(const Task& task) {
  std::vector<double> x;
  for (const ActuatedJoint& joint : task.problem.joints) {
    for (int i = 1; i <= joint.free_points(); ++i) {
      x.push_back(joint.start_rad +
                  i * (joint.end_rad - joint.start_rad) / (joint.free_points() + 1));
    }
  }
  const SolveOutcome outcome = SolveFromGuess(task.problem, x, {});
  EXPECT_TRUE(outcome.solutions.front().feasible());
  return MakePrimitiveFile(task, outcome, outcome.solutions.front());
}

class FallInTwoMotions : public ::testing::Test {
 protected:
  FallInTwoMotions() {
    WriteFile(folder_.path() / "swing.toml", ToToml(Made(LoadTask(folder_.task_file()))));
    const PrimitiveFile swing = LoadPrimitive(folder_.path() / "swing.toml");
    WriteFile(folder_.path() / "tasks" / "stop.toml", StopTask(kSwinging));
    const Task stop = LoadTask(folder_.path() / "tasks" / "stop.toml", swing, "swing.toml");
    WriteFile(folder_.path() / "stop.toml", ToToml(Made(stop)));
    WriteFile(folder_.path() / "fall.toml",
              "format = \"tumbler-sequence\"\nversion = 1\nname = \"fall\"\nstart = "
              "\"swing\"\n[primitives]\nswing = \"swing.toml\"\nstop = "
              "\"stop.toml\"\n[[node]]\nname = \"swing\"\nprimitive = \"swing\"\n[[node]]\nname = "
              "\"stop\"\nprimitive = \"stop\"\nsafe = true\n[[edge]]\nfrom = \"swing\"\nto = "
              "\"stop\"\nsettle_s = 0.0\nwhen = \"always\"\n");
  }

  static std::string StopTask(const std::string& velocities) {
    return FallingTask("stop", std::string(kBetween) + "\n" + velocities,
                       "joints_rad = { leg1 = -0.3, leg2 = 0.5 }", "");
  }
  [[nodiscard]] std::string In(const char* name) const { return folder_.path() / name; }

  TaskFolder folder_{
      FallingTask("swing", "joints_rad = { leg1 = -1.5707963267948966, leg2 = 1.5707963267948966 }",
                  std::string(kBetween) + "\n" + kSwinging, "")};
};

TEST_F(FallInTwoMotions, TheSecondBeginsInTheStateInWhichTheFirstEnds) {
  const PrimitiveFile swing = LoadPrimitive(In("swing.toml"));
  const PrimitiveFile stop = LoadPrimitive(In("stop.toml"));
  EXPECT_FALSE(swing.entry.root_moves());
  EXPECT_TRUE(swing.exit.root_moves());
  EXPECT_EQ(swing.exit.root_x_m_s, stop.entry.root_x_m_s);
  EXPECT_EQ(swing.exit.root_z_m_s, stop.entry.root_z_m_s);
  EXPECT_EQ(swing.exit.root_pitch_rad_s, stop.entry.root_pitch_rad_s);
  EXPECT_EQ(swing.exit.root_z_m, stop.entry.root_z_m);
  EXPECT_NEAR(swing.exit.root_z_m_s, -9.81 * 0.4, 0.5) << "the legs move the root a little";
  // Its primitive needs no other file.
  const Problem again = TaskOf(stop).problem;
  EXPECT_EQ(again.start_root_rates[1], stop.entry.root_z_m_s);
  EXPECT_EQ(again.joints[0].start_rad_s, 3);
}

TEST(MovingEnds, AFileSaysHowFastARobotIsThatMovesAlthoughItsJointsRest) {
  const std::string home = "joints_rad = { leg1 = -1.5707963267948966, leg2 = 1.5707963267948966 }";
  const TaskFolder folder(FallingTask("fall", home, home, "settle_s = 0.1\n"));
  const PrimitiveFile fall = Made(LoadTask(folder.task_file()));
  EXPECT_TRUE(fall.exit.root_moves());
  EXPECT_NEAR(fall.exit.root_z_m_s, -9.81 * (0.4 + kExitAfter_s), 0.5);
  // Where it lands and stands, it is at rest.
  EXPECT_FALSE(
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml")).exit.root_moves());
}

TEST_F(FallInTwoMotions, AChainJoinsThemWithoutAHold) {
  const SequenceFile file = LoadSequence(In("fall.toml"));
  ChainOptions options;
  std::vector<double> pitch_rate, time;
  const ChainOutcome outcome =
      SimulateChain(SimulatedMotion(file), options, [&](int, const MotionSample& sample) {
        pitch_rate.push_back(sample.qd[2]);
        time.push_back(sample.time_s);
      });
  ASSERT_FALSE(outcome.failure) << outcome.failure->text;
  ASSERT_EQ(outcome.passages.size(), 2U);
  EXPECT_NEAR(outcome.passages[0].exit_pitch_error_rad, 0, 1e-6);
  EXPECT_NEAR(outcome.passages[1].entry_pitch_error_rad, 0, 1e-6);
  EXPECT_NEAR(outcome.passages[1].exit_pitch_error_rad, 0, 1e-6);
  EXPECT_NEAR(outcome.passages[1].exit_z_error_m, 0, 1e-6);
  // Nothing turns the robot as a whole, so the root's pitch rate does not jump where they join.
  for (std::size_t k = 1; k < time.size(); ++k) {
    if (time[k] > 0.39 && time[k] < 0.41) {
      EXPECT_NEAR(pitch_rate[k], pitch_rate[k - 1], 0.05) << time[k];
    }
  }
}

TEST_F(FallInTwoMotions, ASecondThatBeginsOtherwiseIsRefusedByName) {
  const PrimitiveFile swing = LoadPrimitive(In("swing.toml"));
  const auto refusal = [&](const std::string& task) -> std::string {
    WriteFile(In("tasks/stop.toml"), task);
    try {
      LoadTask(In("tasks/stop.toml"), swing, "swing.toml");
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal(StopTask("")),
              HasSubstr("has 'leg1' at 0 rad/s, but the exit of 'swing' (swing.toml) has it at 3 "
                        "rad/s: 3 rad/s apart"));
  EXPECT_THAT(refusal(StopTask(std::string(kSwinging) + "\nz_m_s = -4.0")),
              HasSubstr("start.z_m_s: is that of the exit of 'swing' (swing.toml) here; leave it"));
}

TEST_F(FallInTwoMotions, WhatPlaysMotionsRefusesThemByName) {
  const auto refusal = [&](const char* name) -> std::string {
    try {
      LoadMotion(In(name));
    } catch (const FileError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal("swing.toml"),
              HasSubstr("'swing' ends with joint 'leg1' at 3 rad/s; allowed here: at rest"));
  EXPECT_THAT(refusal("stop.toml"),
              HasSubstr("'stop' starts with joint 'leg1' at 3 rad/s; allowed here: at rest"));
  EXPECT_THAT(refusal("fall.toml"),
              HasSubstr("'swing' ends with joint 'leg1' at 3 rad/s; allowed here: at rest"));
}

TEST(MovingEnds, AThrownRobotWhoseJointsAreAtRestIsRefusedByWhatPlaysMotionsToo) {
  for (const bool at_end : {false, true}) {
    const std::string path = "primitives/nominal/handstand.toml";
    PrimitiveFile file = LoadPrimitive(testing::SourcePath(path));
    (at_end ? file.exit : file.entry).root_z_m_s = 0.6;
    std::string text = ToToml(file);
    try {
      LoadMotion("thrown.toml", [&](const std::string&) { return text; });
      ADD_FAILURE() << "accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(
          error.what(),
          HasSubstr(at_end ? "'handstand' ends with its root in motion; allowed here: at rest"
                           : "'handstand' starts with its root in motion; allowed here"));
    }
  }
}

}  // namespace
}  // namespace tumbler
