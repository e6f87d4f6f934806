// Friction and torque-speed curves of motors: the optimiser's torque is that of a motor that bears
// its friction, its limit falls with the speed, gradients go with it, and the twin's motors agree.

#include "offline/scene/motor.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "firmware_interface/devices/drives_toml.h"
#include "offline/certify/certificate.h"
#include "offline/certify/chain.h"
#include "offline/certify/second_look.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/lane_scene.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "offline/twin/simulated_robot.h"
#include "offline/twin/twin.h"
#include "tests/support/files.h"
#include "tests/support/following_drive.h"
#include "tests/support/handstand.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using testing::FollowingDrive;
using ::testing::HasSubstr;
using testing::Replaced;

Problem ParseArm(const std::string& task) {
  const std::string robot = testing::SourcePath("primitives/acrobot/acrobot.urdf");
  return ParseTask(task, "task.toml", testing::ReadFile(robot), robot).problem;
}

/// The acrobot's lower link, swung by its motor while the upper one is held.
std::string ArmTask(const std::string& motor) {
  return R"(format = "tumbler-task"
version = 1
name = "arm"
robot = "acrobot.urdf"
root = "fixed"
duration_s = 0.5
settle_s = 0.1
obstacle = []

[start]
joints_rad = { waist = -1.0 }

[end]
joints_rad = { waist = 1.2 }

[limits]
torque_max_nm = 1.2
rotor_inertia_kg_m2 = 0.0005

[[cost]]
term = "effort"
weight = 1.0

[self_contact]
clearance_m = 0.0

)" + motor;
}

/// The motor of that arm, written down once more: the torque for a motion from hanging down.
double ArmTorque(double q, double v, double a, double viscous, double dry) {
  const double s = std::clamp(v / 0.05, -1.0, 1.0);
  return (3.0e-3 + 0.35 * 0.16 * 0.16 + 0.0005) * a + 0.35 * 9.81 * 0.16 * std::sin(q) +
         viscous * v + dry * (1.5 * s - 0.5 * s * s * s);
}

TEST(Motor, BearsTheFrictionOfItsJointBesidesTheArm) {
  const Problem arm =
      ParseArm(ArmTask("[motor]\nviscous_friction_nm_s_per_rad = 0.03\ndry_friction_nm = 0.2\n"));
  const Problem light = ParseArm(ArmTask(""));
  for (const bool with : {true, false}) {
    const Problem& problem = with ? arm : light;
    int slow = 0;
    Rollout(problem, 1e-3).Visit(RandomMotion(problem, 5, 0.8), 0.0, [&](const MotionSample& at) {
      const double v = at.qd[0];
      // The path's acceleration, from what the torque is made of without friction.
      const double a = ((at.torque[0] - ArmTorque(at.q[0], v, 0, with ? 0.03 : 0, with ? 0.2 : 0)) /
                        (3.0e-3 + 0.35 * 0.16 * 0.16 + 0.0005));
      const JointMotion<double>::Spline path =
          PositionSpline(problem, RandomMotion(problem, 5, 0.8), 0);
      if (at.time_s < problem.duration_s) {
        EXPECT_NEAR(a, path.Evaluate(at.time_s).second, 1e-9 * (1 + std::abs(a))) << at.time_s;
      }
      slow += std::abs(v) < 0.05 ? 1 : 0;
    });
    EXPECT_GT(slow, 5) << "the law below its full strength is looked at, too";
  }
}

/// Standing on its feet, the shipped robot with motors that have everything.
Problem WithMotors(const std::string& motor) {
  return ParseTask(testing::LongHandstandTask() + motor, "task.toml", testing::ShippedRobot(),
                   "robot.urdf")
      .problem;
}
constexpr const char* kEverything =
    "\n[motor]\nviscous_friction_nm_s_per_rad = 0.05\ndry_friction_nm = 0.3\n"
    "base_speed_rad_s = 3.0\nno_load_speed_rad_s = 9.0\n[motor.leg2]\nbase_speed_rad_s = 1.0\n";

struct Outcome {
  RolloutResult result;
  OutputGradients gradient;
};
template <class Run>
Outcome RunOf(Run&& rollout, const std::vector<double>& x) {
  Outcome out{{}, OutputGradients::Of(rollout)};
  out.result = rollout.Run(x, out.gradient);
  return out;
}

TEST(Motor, GradientsOfAdjointAndForwardSensitivitiesAgreeToRoundingOnEveryOutput) {
  Problem problem = WithMotors(kEverything);
  for (ActuatedJoint& joint : problem.joints) joint.limits.torque_max_nm = 4;
  Problem straight = problem;
  for (ActuatedJoint& joint : straight.joints) {
    joint.motor.base_speed_rad_s = joint.motor.no_load_speed_rad_s =
        std::numeric_limits<double>::infinity();
  }
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const std::vector<double> x = RandomMotion(problem, seed, 0.8);
    for (const bool adaptive : {false, true}) {
      Rollout rollout(problem, 1e-3);
      if (adaptive) rollout.Use(StepsFor(problem, x));
      const Outcome adjoint = RunOf(rollout, x);
      const Outcome forward =
          RunOf(ForwardSensitivity(problem, adaptive ? AdaptiveSteps(problem) : StepSettings{}), x);
      ASSERT_TRUE(adjoint.result.finite);
      EXPECT_NEAR(adjoint.result.cost, forward.result.cost, 1e-9 * adjoint.result.cost);
      for (Eigen::Index row = 0; row < 3; ++row) {
        EXPECT_LT((adjoint.gradient.row(row) - forward.gradient.row(row)).cwiseAbs().maxCoeff(),
                  1e-7 * forward.gradient.row(row).cwiseAbs().maxCoeff())
            << "seed " << seed << " row " << row << (adaptive ? " adaptive" : "");
      }
      for (std::size_t j = 0; j < 2; ++j)
        EXPECT_NEAR(adjoint.result.torque_excess[j], forward.result.torque_excess[j], 1e-9);
    }
    const std::vector<double> with = RunOf(Rollout(problem, 1e-3), x).result.torque_excess;
    const std::vector<double> without = RunOf(Rollout(straight, 1e-3), x).result.torque_excess;
    EXPECT_GT(std::max(with[0] - without[0], with[1] - without[1]), 0.02) << "the curve counts";
  }
}

TEST(Motor, GradientsAreThoseOfCentralDifferences) {
  // In the air, where no impact amplifies rounding.
  const Problem problem = ParseTask(Replaced(testing::LongHandstandTask(), "pitch_rad = 0.0",
                                             "pitch_rad = 0.0\nz_m = 50.0", "[start]") +
                                        kEverything,
                                    "task.toml", testing::ShippedRobot(), "robot.urdf")
                              .problem;
  for (const std::uint64_t seed : {1U, 2U}) {
    const std::vector<double> x = RandomMotion(problem, seed, 0.8);
    Rollout rollout(problem, 1e-3);
    const Outcome at = RunOf(rollout, x);
    ASSERT_GT(at.result.torque_excess[0], -1);
    for (std::size_t k = 0; k < x.size(); ++k) {
      const auto moved = [&](double by) {
        std::vector<double> beside = x;
        beside[k] += by;
        return rollout.Run(beside);
      };
      // Extrapolated from two steps: a smooth maximum is strongly curved.
      constexpr double kStep = 2e-5;
      const std::array<RolloutResult, 4> there = {moved(kStep), moved(-kStep), moved(kStep / 2),
                                                  moved(-kStep / 2)};
      const auto compare = [&](Eigen::Index row, const auto& value) {
        const double wide = (value(there[0]) - value(there[1])) / (2 * kStep);
        const double narrow = (value(there[2]) - value(there[3])) / kStep;
        const double scale = at.gradient.row(row).cwiseAbs().maxCoeff();
        EXPECT_NEAR(at.gradient(row, static_cast<Eigen::Index>(k)), (4 * narrow - wide) / 3,
                    1e-6 * scale)
            << "row " << row << " parameter " << k;
      };
      compare(0, [](const RolloutResult& result) { return result.cost; });
      for (std::size_t j = 0; j < 2; ++j) {
        compare(static_cast<Eigen::Index>(1 + j),
                [j](const RolloutResult& result) { return result.torque_excess[j]; });
      }
    }
  }
}

TEST(Motor, TheSmoothTorqueLimitIsKeptWhereTheMotorIsWithinItsCurveAtAllTimes) {
  std::mt19937_64 random(7);
  int inside = 0, outside = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Problem problem =
        ParseArm(ArmTask("[motor]\ndry_friction_nm = 0.1\nbase_speed_rad_s = 3.0\n"
                         "no_load_speed_rad_s = 20.0\n"));
    problem.joints[0].limits.torque_max_nm = Uniform(random, 0.9, 2.5);
    const std::vector<double> x = RandomMotion(problem, seed, 0.3);
    const RolloutResult result = Rollout(problem, 1e-3).Run(x);
    double within = -1;  // of the limit
    Rollout(problem, 1e-4).Visit(x, 0, [&](const MotionSample& at) {
      const double torque = at.torque[0], speed = std::abs(at.qd[0]);
      double available = problem.joints[0].limits.torque_max_nm;
      if (torque * at.qd[0] > 0 && speed > 3) available *= (20 - speed) / 17;
      within =
          std::max(within, (std::abs(torque) - available) / problem.joints[0].limits.torque_max_nm);
    });
    (within < 0 ? inside : outside) += 1;
    if (within > 0) {
      EXPECT_GT(result.torque_excess[0], 0.8 * within) << seed;
    }
    // The margin on the falling side is larger by the part of it that is left: 20 / 17.
    EXPECT_LT(result.torque_excess[0], std::max(0.85 * within, within) + 0.05) << seed;
    const SecondLook look = LookAgain(problem, x);
    EXPECT_NEAR(look.torque_excess, within, 0.01) << seed;
  }
  EXPECT_GT(inside, 5);
  EXPECT_GT(outside, 5);
}

/// The torque of the arm's motor in the twin, at the times of samples, while the arm follows a
/// motion.
struct Played {
  double peak_nm = 0;
  double furthest_nm = 0;  ///< From the plan's torque.
};
Played PlayInTwin(const Problem& problem, const std::vector<double>& x, const TwinConfig& given) {
  TwinConfig config = given;
  config.step_ns = 5'000;
  config.held = false;
  const JointMotion<double>::Spline path = PositionSpline(problem, x, 0);
  SimulatedMotorConfig motor;
  motor.encoder_step_rad = 0;
  motor.torque_max_nm = problem.joints[0].limits.torque_max_nm;
  motor.base_speed_rad_s = problem.joints[0].motor.base_speed_rad_s;
  motor.no_load_speed_rad_s = problem.joints[0].motor.no_load_speed_rad_s;
  FollowingDrive drive(motor, [&](double t) {
    const auto at = path.Evaluate(std::min(t, problem.duration_s));
    return std::pair(at.value, t < problem.duration_s ? at.first : 0.0);
  });
  SimulatedBus bus;
  PrimitivePose start;
  start.joint_positions_rad = {problem.joints[0].start_rad};
  Twin twin(problem.scene, start, config, bus, {&drive});
  Played played;
  Rollout(problem, 1e-3).Visit(x, 0, [&](const MotionSample& at) {
    if (at.time_s > problem.duration_s - 1e-3) return;
    twin.AdvanceTo(static_cast<std::int64_t>(std::llround(1e9 * at.time_s)));
    const double torque = twin.state().joint_torques_nm[0];
    played.peak_nm = std::max(played.peak_nm, std::abs(torque));
    // Drives need a moment for the weight of an arm that was held.
    if (at.time_s > 0.02)
      played.furthest_nm = std::max(played.furthest_nm, std::abs(torque - at.torque[0]));
  });
  return played;
}

TEST(Motor, TheTwinsMotorGivesTheTorqueThatTheCertificateStates) {
  const Problem problem =
      ParseArm(ArmTask("[motor]\nviscous_friction_nm_s_per_rad = 0.04\ndry_friction_nm = 0.25\n"));
  const std::vector<double> x = RandomMotion(problem, 3, 0.5);
  const double certified_nm = Summarize(problem, x).peak_torque_nm;
  // The task's friction is the twin's, which file or not.
  const Played played = PlayInTwin(problem, x, {});
  EXPECT_NEAR(played.peak_nm, certified_nm, 0.01 * certified_nm);
  EXPECT_LT(played.furthest_nm, 0.02 * certified_nm);
  // A twin that has another friction needs another torque: the check sees friction.
  TwinConfig other;
  other.joints.resize(1);
  other.joints[0].dry_friction_nm = 0.0;
  EXPECT_GT(PlayInTwin(problem, x, other).furthest_nm, 0.2);
  other.joints[0] = {};
  other.joints[0].viscous_friction_nm_s_per_rad = 0.0;
  EXPECT_GT(PlayInTwin(problem, x, other).furthest_nm, 0.1);
}

/// The arm of a robot whose file says what its joint loses.
Problem ParseRubbingArm(const std::string& task, const std::string& dynamics) {
  const std::string robot =
      testing::ReadFile(testing::SourcePath("primitives/acrobot/acrobot.urdf"));
  return ParseTask(task, "task.toml", Replaced(robot, "<limit ", dynamics + "<limit "), "arm.urdf")
      .problem;
}

TEST(Motor, HasTheFrictionOfTheRobotsFileUnlessTheTaskSaysOtherwise) {
  const char* const kRubs = "<dynamics friction=\"0.25\"/>";
  const Problem problem =
      ParseRubbingArm(ArmTask("[motor]\nviscous_friction_nm_s_per_rad = 0.04\n"), kRubs);
  EXPECT_EQ(problem.scene.motors[0].dry_friction_nm, 0.25);
  const std::vector<double> x = RandomMotion(problem, 3, 0.5);
  const double certified_nm = Summarize(problem, x).peak_torque_nm;
  EXPECT_LT(PlayInTwin(problem, x, {}).furthest_nm, 0.02 * certified_nm);
  EXPECT_EQ(ParseRubbingArm(ArmTask("[motor]\ndry_friction_nm = 0.1\n"), kRubs)
                .scene.motors[0]
                .dry_friction_nm,
            0.1);
}

TEST(Motor, WithoutATasksMotorsTheFilesFrictionIsInTheTwinAndInLanesAndNotInThePlan) {
  const Problem problem = ParseRubbingArm(ArmTask(""), "<dynamics friction=\"0.25\"/>");
  const Problem light = ParseArm(ArmTask(""));
  const std::vector<double> x = RandomMotion(problem, 3, 0.5);
  EXPECT_EQ(Summarize(problem, x).peak_torque_nm, Summarize(light, x).peak_torque_nm);
  TwinConfig config;
  config.joints.resize(1);
  config.joints[0].viscous_friction_nm_s_per_rad = 0.0;
  EXPECT_NEAR(PlayInTwin(problem, x, config).furthest_nm, 0.25, 0.02);
  config.joints[0].dry_friction_nm = 0.0;
  EXPECT_LT(PlayInTwin(problem, x, config).furthest_nm, 0.02);
  Problem handstand = ParseTask(testing::QuickTask(), "task.toml",
                                Replaced(testing::ShippedRobot(), "<limit ",
                                         "<dynamics friction=\"0.25\"/><limit "),
                                "robot.urdf")
                          .problem;
  LaneDrive drive;
  EXPECT_EQ(MakeLaneScene(handstand.scene, drive).robot.joints[0].dry_friction, 0.25);
  EXPECT_EQ(MakeLaneScene(handstand.scene, drive).robot.joints[1].dry_friction, 0);
}

TEST(Motor, FrictionOfAFileThatIsNotSimulatedIsRefusedWithWhatCanBeSaidInstead) {
  const auto mistake = [](const std::string& task, const std::string& friction) {
    try {
      ParseRubbingArm(ArmTask(task), "<dynamics friction=\"" + friction + "\"/>");
    } catch (const FileError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  EXPECT_THAT(mistake("", "6"),
              HasSubstr("robot: has joint 'waist' with a dry friction of 6 N m, which is more than "
                        "is simulated; allowed: up to 5, or motor.waist.dry_friction_nm"));
  EXPECT_EQ(mistake("[motor.waist]\ndry_friction_nm = 5.0\n", "6"), "taken");
  EXPECT_EQ(mistake("", "5"), "taken");
  EXPECT_THAT(mistake("[passive.waist]\n", "0.1"),
              HasSubstr("passive.waist: has a dry friction of 0.1 N m in the robot's file"));
}

TEST(Motor, AMotionFoundWithACurveStaysWithinItInAFinerSimulationAndInTheTwin) {
  const std::string curve =
      "[motor]\ndry_friction_nm = 0.1\nbase_speed_rad_s = 2.0\n"
      "no_load_speed_rad_s = 8.0\n";
  const Problem problem = ParseArm(ArmTask(curve));
  const SolveOutcome found = Solve(problem, {});
  ASSERT_FALSE(found.solutions.empty());
  const std::vector<double>& x = found.solutions.front().x;
  const SecondLook look = LookAgain(problem, x, 64);
  EXPECT_TRUE(look.acceptable()) << look.Objections();
  EXPECT_GT(look.torque_excess, -0.1) << "the curve holds the motion back";
  const Played played = PlayInTwin(problem, x, {});
  EXPECT_LT(played.furthest_nm, 0.03) << "the motor gives what is asked of it";
  // Without the curve, the same task asks for what such a motor cannot give.
  const Problem strong = ParseArm(ArmTask("[motor]\ndry_friction_nm = 0.1\n"));
  const SolveOutcome other = Solve(strong, {});
  ASSERT_FALSE(other.solutions.empty());
  EXPECT_GT(LookAgain(problem, other.solutions.front().x).torque_excess, 0.02);
  EXPECT_LT(other.solutions.front().rollout.cost, found.solutions.front().rollout.cost);
}

TEST(Motor, APathIsNeverFasterThanTheNoLoadSpeed) {
  const Problem problem =
      ParseArm(ArmTask("[motor]\nbase_speed_rad_s = 2.0\nno_load_speed_rad_s = 9.0\n"));
  EXPECT_EQ(problem.joints[0].limits.velocity_max_rad_s, 9);
  EXPECT_EQ(ParseArm(ArmTask("")).joints[0].limits.velocity_max_rad_s, 20);
}

std::string MotorMistake(const std::string& task, bool arm = true) {
  try {
    if (arm) {
      ParseArm(task);
    } else {
      WithMotors(task);
    }
  } catch (const FileError& error) {
    return error.what();
  }
  return "taken";
}

TEST(Motor, WhatAMotorCannotBeIsRefusedByName) {
  EXPECT_THAT(
      MotorMistake(ArmTask("[motor]\nbase_speed_rad_s = 2.0\n")),
      HasSubstr("motor.base_speed_rad_s: is 2 without a no_load_speed_rad_s for joint waist"));
  EXPECT_THAT(
      MotorMistake(ArmTask("[motor]\nno_load_speed_rad_s = 2.0\n")),
      HasSubstr("motor.no_load_speed_rad_s: is 2 without a base_speed_rad_s for joint waist"));
  EXPECT_THAT(
      MotorMistake(ArmTask("[motor]\nbase_speed_rad_s = 2.0\nno_load_speed_rad_s = 2\n")),
      AllOf(HasSubstr("task.toml:"),
            HasSubstr("motor.no_load_speed_rad_s: gives joint waist a base speed of 2 and a "
                      "no-load speed of 2 rad/s; allowed: both or neither")));
  EXPECT_THAT(
      MotorMistake(ArmTask("[motor.waist]\nbase_speed_rad_s = 9.0\nno_load_speed_rad_s = 2\n")),
      HasSubstr("motor.waist.no_load_speed_rad_s: gives joint waist a base speed of 9"));
  EXPECT_THAT(MotorMistake(ArmTask("[motor]\ndry_friction_nm = -1.0\n")),
              HasSubstr("motor.dry_friction_nm: is -1; allowed: from 0 ... 5"));
  EXPECT_THAT(MotorMistake(ArmTask("[motor.elbow]\ndry_friction_nm = 1.0\n")),
              HasSubstr("motor.elbow: is not a joint of the robot; its joints: waist"));
}

TEST(Motor, WhatSimulatesASequenceRefusesPrimitivesOfDifferentMotorsByName) {
  const SequenceFile shipped = LoadSequence(testing::SourcePath("primitives/nominal/gait.toml"));
  EXPECT_NO_THROW(RequireOneRobot(SimulatedMotion(shipped)));
  SequenceFile mixed = shipped;
  mixed.primitives[1].provenance.task_toml += "\n[motor]\ndry_friction_nm = 0.1\n";
  const SimulatedMotion motion(mixed);
  const auto says = ::testing::Property(
      &FileError::what, HasSubstr("was made for other [motor] or [passive], or damping of joints"));
  EXPECT_THAT([&] { RequireOneRobot(motion); }, ::testing::Throws<FileError>(says));
  EXPECT_THAT([&] { SimulateChain(motion, {}, {}); }, ::testing::Throws<FileError>(says));
  const DrivesConfig drives = LoadDrives(testing::SourcePath("primitives/nominal/drives.toml"));
  EXPECT_THAT([&] { SimulatedRobot(motion, drives, {}); }, ::testing::Throws<FileError>(says));
}

TEST(Motor, LanesRefuseMotorsByName) {
  const Problem problem = WithMotors("\n[motor]\ndry_friction_nm = 0.1\n");
  try {
    MakeLaneScene(problem.scene, {});
    FAIL() << "lanes take it";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("leave out [motor]"));
  }
  EXPECT_THAT(MotorMistake("\n[robust]\n[motor]\ndry_friction_nm = 0.1\n", false),
              AllOf(HasSubstr("robust: cannot simulate this task in lanes"),
                    HasSubstr("leave out [motor]")));
}

}  // namespace
}  // namespace tumbler
