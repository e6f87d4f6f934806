// A robot that hangs from a bar: its equations are those of the textbook's acrobot, energy is kept,
// the bar bears what it has to, and gradients, lanes and places of rest go with it.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "firmware_interface/devices/simulated_mit.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/rest_pose.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/scene/stepper.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "offline/twin/twin.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"

#define TUMBLER_LANES_NAMESPACE lanes_test
#include "offline/scene/lane_dynamics.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Replaced;

constexpr double kPi = std::numbers::pi;
constexpr double kGravity = 9.81;

std::string TaskText() {
  return testing::ReadFile(testing::SourcePath("primitives/acrobot/tasks/swing_up.toml"));
}
Problem Parse(const std::string& task) {
  const std::string robot = testing::SourcePath("primitives/acrobot/acrobot.urdf");
  return ParseTask(task, "task.toml", testing::ReadFile(robot), robot).problem;
}
Problem Acrobot() { return Parse(TaskText()); }

/// The acrobot of textbooks: angles from hanging down, the second relative to the first. Numbers
/// are those of primitives/acrobot, written down once more.
struct Textbook {
  double m1 = 0.45, m2 = 0.35, l1 = 0.30, c1 = 0.20, c2 = 0.16, I1 = 4.0e-3, I2 = 3.0e-3;
  double bar = 0.02;      // friction
  double rotor = 0.0005;  // seen at the waist
  double q1 = 0, q2 = 0, v1 = 0, v2 = 0;

  [[nodiscard]] double m11() const {
    return I1 + I2 + m1 * c1 * c1 + m2 * (l1 * l1 + c2 * c2 + 2 * l1 * c2 * std::cos(q2));
  }
  [[nodiscard]] double m12() const { return I2 + m2 * (c2 * c2 + l1 * c2 * std::cos(q2)); }
  [[nodiscard]] double m22() const { return I2 + m2 * c2 * c2; }
  [[nodiscard]] double h() const { return m2 * l1 * c2 * std::sin(q2); }
  [[nodiscard]] double g2() const { return m2 * kGravity * c2 * std::sin(q1 + q2); }
  [[nodiscard]] double g1() const { return (m1 * c1 + m2 * l1) * kGravity * std::sin(q1) + g2(); }
  /// The acceleration of the first angle for one of the second.
  [[nodiscard]] double Swing(double a2) const {
    const double rest = -h() * v2 * v2 - 2 * h() * v1 * v2 + g1() + bar * v1;
    return -(m12() * a2 + rest) / m11();
  }
  /// The motor's torque.
  [[nodiscard]] double Torque(double a1, double a2) const {
    return m12() * a1 + (m22() + rotor) * a2 + h() * v1 * v1 + g2();
  }
  [[nodiscard]] double Energy() const {
    const double kinetic =
        0.5 * m11() * v1 * v1 + m12() * v1 * v2 + 0.5 * (m22() + rotor) * v2 * v2;
    return kinetic - kGravity * ((m1 * c1 + m2 * l1) * std::cos(q1) + m2 * c2 * std::cos(q1 + q2));
  }
};

TEST(Hinge, TheAcrobotMovesAsInTextbooks) {
  const Problem problem = Acrobot();
  SceneDynamics robot(problem.scene);
  ASSERT_THAT(robot.free, ::testing::ElementsAre(2));
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 200; ++trial) {
    Textbook book;
    book.q1 = Uniform(random, -7, 7);
    book.q2 = Uniform(random, -2.4, 2.4);
    book.v1 = Uniform(random, -10, 10);
    book.v2 = Uniform(random, -10, 10);
    const double a2 = Uniform(random, -200, 200);
    robot.SetFree({book.q1, book.v1});
    robot.q[3] = book.q2;
    robot.qd[3] = book.v2;
    robot.qdd[3] = a2;
    robot.TouchAndSolve();
    const double a1 = book.Swing(a2);
    EXPECT_NEAR(robot.qdd[2], a1, 1e-10 * (1 + std::abs(a1)));
    EXPECT_NEAR(robot.tau[3], book.Torque(a1, a2), 1e-10 * (1 + std::abs(a1)));
    EXPECT_EQ(robot.q[0], 0);
    EXPECT_EQ(robot.q[1], 0.8);
  }
}

TEST(Hinge, WithoutFrictionAndMotorTheEnergyIsKept) {
  Scene scene = Acrobot().scene;
  scene.robot.tree.dofs[2].damping_nm_s_per_rad = 0;
  scene.robot.tree.dofs[3].prescribed = false;
  SceneDynamics robot(scene);
  SceneDynamics::State y{2.5, 1.0, 0, 3.0};  // over the top, and tumbling
  const auto energy = [&y] {
    Textbook book;
    book.q1 = y[0], book.q2 = y[1], book.v1 = y[2], book.v2 = y[3];
    return book.Energy();
  };
  const double before = energy();
  for (int i = 0; i < 20000; ++i) {
    StepRungeKutta<kClassical>(y, 4, 2e-4, [&](int, const SceneDynamics::State& y_s, double* k) {
      robot.SetFree(y_s);
      robot.TouchAndSolve();
      robot.TakeSlope(k);
      return true;
    });
  }
  EXPECT_NEAR(energy(), before, 1e-7);
  EXPECT_GT(std::abs(y[0] - 2.5), 0.1);
}

TEST(Hinge, SmallSwingsTakeAsLongAsThoseOfAPendulum) {
  Scene scene = Acrobot().scene;
  scene.robot.tree.dofs[2].damping_nm_s_per_rad = 0;
  for (const double waist : {0.0, 1.2}) {
    SceneDynamics robot(scene);
    robot.q[3] = waist;
    Textbook book;
    book.q2 = waist;
    const double moment_x = 0.35 * 0.16 * std::sin(waist);
    const double moment_z = 0.45 * 0.20 + 0.35 * 0.30 + 0.35 * 0.16 * std::cos(waist);
    const double rest = -std::atan2(moment_x, moment_z), moment = std::hypot(moment_x, moment_z);
    constexpr double kSwing = 0.02, kStep_s = 1e-3;
    SceneDynamics::State y{rest + kSwing, 0};
    double crossed_s = 0, before = kSwing;  // downwards, for the fifth time
    int crossings = 0;
    for (int i = 1; crossings < 5; ++i) {
      ASSERT_LT(i, 20000);
      StepRungeKutta<kClassical>(y, 2, kStep_s, [&](int, const SceneDynamics::State& s, double* k) {
        robot.SetFree(s);
        robot.TouchAndSolve();
        robot.TakeSlope(k);
        return true;
      });
      const double now = y[0] - rest;
      if (before > 0 && now <= 0 && ++crossings == 5)
        crossed_s = kStep_s * (i - now / (now - before));
      before = now;
    }
    // A quarter of a swing to the first crossing; the last factor is that of a swing not quite
    // small.
    const double period_s = 2 * kPi * std::sqrt(book.m11() / (kGravity * moment));
    EXPECT_NEAR(crossed_s / 4.25, period_s * (1 + kSwing * kSwing / 16), 1e-6 * period_s);
  }
}

TEST(Hinge, TheTwinWithoutTorqueMovesAsInTextbooks) {
  const Problem problem = Acrobot();
  SimulatedBus bus;
  SimulatedMitConfig limp;
  limp.mit.command_id = 1;
  limp.mit.reply_id = 17;
  SimulatedMitDrive drive(limp);
  bus.Attach(drive, SimulatedMitDrive::PortConfig());
  TwinConfig config;
  config.held = false;
  config.joints.resize(1);
  config.joints[0].viscous_friction_nm_s_per_rad = 0;
  config.stop_stiffness_nm_per_rad = config.stop_damping_nm_s_per_rad = 0;
  PrimitivePose start;
  start.root_z_m = 0.8;
  start.root_pitch_rad = 1.2;
  start.joint_positions_rad = {-0.7};
  Twin twin(problem.scene, start, config, bus, {&drive});
  Textbook book;
  book.q1 = 1.2, book.q2 = -0.7;
  constexpr double kStep_s = 1e-5;
  for (int i = 0; i < 100'000; ++i) {
    // The midpoint rule; no torque at either joint.
    const auto slope = [](const Textbook& at) {
      const double a = at.m11(), b = at.m12(), c = at.m22() + at.rotor;
      const double rest1 = at.m11() * -at.Swing(0), rest2 = at.h() * at.v1 * at.v1 + at.g2();
      const double det = a * c - b * b;
      return std::array<double, 2>{(-c * rest1 + b * rest2) / det, (b * rest1 - a * rest2) / det};
    };
    const auto moved = [&](const Textbook& from, const Textbook& at, double h) {
      const auto [a1, a2] = slope(at);
      Textbook to = from;
      to.q1 += h * at.v1, to.q2 += h * at.v2, to.v1 += h * a1, to.v2 += h * a2;
      return to;
    };
    book = moved(book, moved(book, book, kStep_s / 2), kStep_s);
  }
  twin.AdvanceTo(1'000'000'000);
  const TwinState state = twin.state();
  EXPECT_NEAR(state.root_pitch_rad, book.q1, 1e-5);
  EXPECT_NEAR(state.joint_positions_rad[0], book.q2, 1e-5);
  EXPECT_EQ(state.root_x_m, 0);
  EXPECT_EQ(state.root_z_m, 0.8);
  EXPECT_GT(std::abs(book.q1 - 1.2), 0.3);
  twin.Displace(std::array{1.0, 1.0, 0.1, 0.0}, std::array{1.0, 1.0, 0.0, 0.2});
  EXPECT_EQ(twin.state().root_x_m, 0) << "a bar does not move";
  EXPECT_NEAR(twin.state().root_pitch_rad, state.root_pitch_rad + 0.1, 1e-12);
  EXPECT_NEAR(twin.state().joint_velocities_rad_s[0], state.joint_velocities_rad_s[0] + 0.2, 1e-12);
}

TEST(Hinge, TheBarBearsWeightAndWhatTurningTakes) {
  const Problem problem = Acrobot();
  SceneDynamics robot(problem.scene);
  robot.SetFree({0, 0});
  robot.TouchAndSolve();
  EXPECT_NEAR(robot.tau[0], 0, 1e-12);
  EXPECT_NEAR(robot.tau[1], 0.8 * kGravity, 1e-12);
  // Straight and turning, the masses go round the bar.
  const double rate = 6, moment = 0.45 * 0.2 + 0.35 * 0.46;
  robot.SetFree({0, rate});
  robot.TouchAndSolve();
  EXPECT_NEAR(robot.tau[1], 0.8 * kGravity + moment * rate * rate, 1e-10);
}

TEST(Hinge, GradientsAreThoseOfCentralDifferences) {
  for (const char* gradient : {"adjoint", "forward"}) {
    const Problem problem = Parse(
        Replaced(TaskText(), "[solver]", std::string("[solver]\ngradient = \"") + gradient + "\""));
    std::mt19937_64 random(2);
    std::vector<double> x(static_cast<std::size_t>(problem.parameter_count()));
    for (double& value : x) value = Uniform(random, -0.8, 0.8);
    Rollout rollout(problem, 2e-3);
    auto slopes = OutputGradients::Of(rollout);
    ASSERT_TRUE(rollout.Run(x, slopes).finite);
    const double scale = slopes.row(0).cwiseAbs().maxCoeff();
    ASSERT_GT(scale, 0);
    for (std::size_t k = 0; k < x.size(); ++k) {
      const auto at = [&](double by) {
        std::vector<double> moved = x;
        moved[k] += by;
        return rollout.Run(moved).cost;
      };
      const double difference = (at(1e-6) - at(-1e-6)) / 2e-6;
      EXPECT_NEAR(slopes(0, static_cast<Eigen::Index>(k)), difference, 1e-6 * scale)
          << gradient << " " << k;
    }
  }
}

TEST(Hinge, LanesMoveAsTheSceneDoes) {
  Scene scene = Acrobot().scene;
  const LaneScene in_lanes = MakeLaneScene(scene, {.viscous_friction_nm_s_per_rad = 0});
  LaneDynamics<double> lanes(in_lanes.model, in_lanes.robot);
  std::mt19937_64 random(3);
  for (const bool prescribed : {true, false}) {
    scene.robot.tree.dofs[3].prescribed = prescribed;
    SceneDynamics one(scene);
    for (int trial = 0; trial < 100; ++trial) {
      LaneState<double> state{};
      LaneDynamics<double>::Numbers tau{}, qdd{};
      state.q = {0, 0.8, Uniform(random, -7, 7), Uniform(random, -2.4, 2.4)};
      state.v = {0, 0, Uniform(random, -10, 10), Uniform(random, -10, 10)};
      for (std::size_t i = 0; i < 4; ++i) one.q[i] = state.q[i], one.qd[i] = state.v[i];
      one.tau.fill(0);
      one.qdd.fill(0);
      (prescribed ? qdd : tau)[3] = (prescribed ? one.qdd : one.tau)[3] = Uniform(random, -8, 8);
      one.Touch();
      one.Solve();
      prescribed ? lanes.AcceleratePrescribed(state, tau, qdd) : lanes.Accelerate(state, tau, qdd);
      for (std::size_t i = 0; i < 4; ++i)
        EXPECT_NEAR(qdd[i], one.qdd[i], 1e-9 * (1 + std::abs(one.qdd[i]))) << i;
      if (prescribed) {
        EXPECT_NEAR(tau[3], one.tau[3], 1e-9 * (1 + std::abs(one.tau[3])));
      }
    }
  }
}

TEST(Hinge, ARobotStartsWithItsMassStraightBelowOrAboveTheBar) {
  const auto start = [](const std::string& pitch, const std::string& waist) {
    std::string text = Replaced(TaskText(), "pitch_rad = 0.0", "pitch_rad = " + pitch);
    text = Replaced(text, "joints_rad = { waist = 0.0 }\n\n[end]",
                    "joints_rad = { waist = " + waist + " }\n\n[end]");
    const Problem problem = Parse(text);
    SceneDynamics robot(problem.scene);
    robot.SetFree({problem.start_q[2], 0});
    robot.q[3] = problem.start_q[3];
    robot.TouchAndSolve();
    EXPECT_NEAR(robot.qdd[2], 0, 1e-10) << "at rest";
    return problem;
  };
  EXPECT_NEAR(start("0.3", "0.0").start_q[2], 0, 1e-12);
  EXPECT_NEAR(start("3.0", "0.0").start_q[2], kPi, 1e-12);
  EXPECT_NEAR(start("-6.1", "0.0").start_q[2], -2 * kPi, 1e-12);
  const Problem bent = start("-0.4", "1.2");
  EXPECT_LT(bent.start_q[2], -0.1);
  EXPECT_NEAR(TurnFromHanging(bent.scene, bent.start_q), 0, 1e-12);
  EXPECT_NEAR(std::abs(TurnFromHanging(bent.scene, std::vector<double>{0, 0, kPi, 0})), kPi, 1e-12);
}

std::string Mistake(const std::string& text) {
  try {
    Parse(text);
  } catch (const FileError& error) {
    return error.what();
  }
  return "taken";
}

TEST(Hinge, WhatABarCannotDoIsRefusedByName) {
  const std::string good = TaskText();
  EXPECT_THAT(Mistake(Replaced(good, "\"pitch\"", "\"x\"")),
              AllOf(HasSubstr("task.toml:"), HasSubstr("of: is 'x', which the bar holds"),
                    HasSubstr("allowed for root = \"hinge-y\": pitch, pitch_rate")));
  EXPECT_THAT(Mistake(Replaced(good, "pitch_rad = 0.0", "pitch_rad = 1.0")),
              AllOf(HasSubstr("start.pitch_rad: is 1 rad, where the robot does not stay"),
                    HasSubstr("it is at rest at 0 rad"), HasSubstr("allowed: <= 0.5 rad")));
  EXPECT_THAT(Mistake(Replaced(good, "\"hinge-y\"", "\"fixed\"")),
              HasSubstr("bar: holds nothing here; allowed: with root = \"hinge-y\""));
  EXPECT_THAT(Mistake(Replaced(good, "\"hinge-y\"", "\"hinge\"")),
              HasSubstr("allowed: planar-xz, fixed, hinge-y"));
  EXPECT_THAT(Mistake(Replaced(good, "friction_nm_s_per_rad = 0.02", "friction_nm_s_per_rad = -1")),
              HasSubstr("bar.friction_nm_s_per_rad: is -1; allowed:"));
  EXPECT_THAT(Mistake(good + "\n[robust]\n"),
              HasSubstr("robust: simulates in steps that are too coarse for a robot that swings"));
  EXPECT_THAT(
      Mistake(Replaced(good, "friction_nm_s_per_rad = 0.02", "x_m = 1.0")),
      HasSubstr("bar.x_m: is not a key that this file can hold; also allowed here: friction_nm"));
}

}  // namespace
}  // namespace tumbler
