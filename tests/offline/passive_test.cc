// Joints without a motor, with springs and dampers: the optimiser moves them as equations written
// down by hand do, gradients go through them, and rest poses, twin, chains and files have them.

#include <fmt/format.h>
#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_toml.h"
#include "common/files/sequence_toml.h"
#include "offline/certify/certificate.h"
#include "offline/certify/chain.h"
#include "offline/certify/second_look.h"
#include "offline/problem/link_chains.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/lane_scene.h"
#include "offline/scene/scene_dynamics.h"
#include "offline/solve/forward_sensitivity.h"
#include "offline/solve/output_gradients.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "offline/twin/twin.h"
#include "tests/support/files.h"
#include "tests/support/following_drive.h"
#include "tests/support/handstand.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using testing::FollowingDrive;
using ::testing::HasSubstr;
using testing::Replaced;

constexpr double kG = 9.81;

/// A double pendulum on a fixed base: a motor at the shoulder, a sprung wrist.
const std::string kPendulum = R"(<?xml version="1.0"?>
<robot name="sprung-pendulum">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="0 0 -0.15"/>
      <mass value="0.5"/>
      <inertia ixx="4e-3" ixy="0" ixz="0" iyy="4e-3" iyz="0" izz="1e-4"/>
    </inertial>
  </link>
  <link name="tip">
    <inertial>
      <origin xyz="0 0 -0.10"/>
      <mass value="0.2"/>
      <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-4"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <axis xyz="0 -1 0"/>
    <limit lower="-3" upper="3" effort="8.0" velocity="20.0"/>
  </joint>
  <joint name="wrist" type="revolute">
    <parent link="arm"/>
    <child link="tip"/>
    <origin xyz="0 0 -0.30"/>
    <axis xyz="0 -1 0"/>
    <limit lower="-2" upper="2" effort="1.0" velocity="50.0"/>
  </joint>
</robot>
)";

const std::string kPendulumTask = R"(format = "tumbler-task"
version = 1
name = "pendulum"
robot = "pendulum.urdf"
root = "fixed"
duration_s = 0.6
settle_s = 0.4
obstacle = []

[passive.wrist]
stiffness_nm_per_rad = 1.5
rest_rad = 0.2
damping_nm_s_per_rad = 0.01

[start]
joints_rad = { shoulder = -0.4, wrist = 0.3 }

[end]
joints_rad = { shoulder = 0.9 }

[limits]
rotor_inertia_kg_m2 = 0.001

[[cost]]
term = "effort"
weight = 1e-3

[[cost]]
term = "terminal"
of = "point_x_rate"
link = "tip"
point_m = [0.0, -0.2]
when = "settled"
weight = 1.0
)";

Task ParsePendulumTask(const std::string& task) {
  return ParseTask(task, "task.toml", kPendulum, "pendulum.urdf");
}
Problem Pendulum(const std::string& task = kPendulumTask) {
  return ParsePendulumTask(task).problem;
}

/// The wrist of that pendulum: Lagrange's equation for it, angles from hanging down, and the
/// shoulder's torque.
struct Wrist {
  double m1 = 0.5, m2 = 0.2, l1 = 0.3, c1 = 0.15, c2 = 0.1, I1 = 4e-3, I2 = 1e-3, rotor = 1e-3;
  double stiffness = 1.5, rest = 0.2, damping = 0.01;

  /// @param a1  acceleration of the shoulder.
  [[nodiscard]] double Acceleration(double q1, double v1, double a1, double q2, double v2) const {
    const double inertia = I2 + m2 * c2 * c2;
    const double coupled = inertia + m2 * l1 * c2 * std::cos(q2);
    const double moment = -m2 * l1 * c2 * std::sin(q2) * v1 * v1 -
                          m2 * kG * c2 * std::sin(q1 + q2) - stiffness * (q2 - rest) - damping * v2;
    return (moment - coupled * a1) / inertia;
  }
  [[nodiscard]] double ShoulderTorque(double q1, double v1, double a1, double q2, double v2,
                                      double a2) const {
    const double m11 =
        I1 + m1 * c1 * c1 + rotor + I2 + m2 * (l1 * l1 + c2 * c2 + 2 * l1 * c2 * std::cos(q2));
    const double m12 = I2 + m2 * c2 * c2 + m2 * l1 * c2 * std::cos(q2);
    return m11 * a1 + m12 * a2 - m2 * l1 * c2 * std::sin(q2) * (2 * v1 * v2 + v2 * v2) +
           (m1 * c1 + m2 * l1) * kG * std::sin(q1) + m2 * kG * c2 * std::sin(q1 + q2);
  }
};

TEST(Passive, ASprungWristMovesAsItsOwnEquationIntegratedByHand) {
  const Problem problem = Pendulum();
  const std::vector<double> x = RandomMotion(problem, 2, 0.6);
  const auto path = PositionSpline(problem, x, 0);
  const Wrist wrist;
  constexpr double kStep_s = 1e-5;
  double q2 = 0.3, v2 = 0, furthest = 0;
  int done = 0;
  const auto shoulder = [&](double t) {
    const auto at = path.Evaluate(std::min(t, problem.duration_s));
    return t < problem.duration_s - 1e-12
               ? std::array{at.value, static_cast<double>(at.first), static_cast<double>(at.second)}
               : std::array{problem.joints[0].end_rad, 0.0, 0.0};
  };
  const auto acceleration = [&](double t, double q, double v) {
    const auto [q1, v1, a1] = shoulder(t);
    return wrist.Acceleration(q1, v1, a1, q, v);
  };
  Rollout(problem, 5e-4).Visit(x, 0, [&](const MotionSample& at) {
    for (; done < std::lround(at.time_s / kStep_s); ++done) {  // the midpoint rule
      const double t = kStep_s * done;
      const double middle_q = q2 + kStep_s / 2 * v2;
      const double middle_v = v2 + kStep_s / 2 * acceleration(t, q2, v2);
      q2 += kStep_s * middle_v;
      v2 += kStep_s * acceleration(t + kStep_s / 2, middle_q, middle_v);
    }
    EXPECT_NEAR(at.q[1], q2, 1e-7) << at.time_s;
    EXPECT_NEAR(at.qd[1], v2, 1e-5) << at.time_s;
    const auto [q1, v1, a1] = shoulder(at.time_s);
    EXPECT_NEAR(at.torque[0],
                wrist.ShoulderTorque(q1, v1, a1, q2, v2, wrist.Acceleration(q1, v1, a1, q2, v2)),
                1e-4)
        << at.time_s;
    furthest = std::max(furthest, std::abs(q2 - 0.2));
  });
  EXPECT_GT(furthest, 0.2) << "it swings";
}

struct Gradients {
  RolloutResult result;
  OutputGradients gradient;
};
template <class Run>
Gradients GradientsOf(Run&& rollout, const std::vector<double>& x) {
  Gradients out{{}, OutputGradients::Of(rollout)};
  out.result = rollout.Run(x, out.gradient);
  return out;
}

/// A hopper that stands on a sprung leg, with a motor at its hip, on the ground.
const std::string kHopper = R"(<?xml version="1.0"?>
<robot name="sprung-hopper">
  <link name="trunk">
    <inertial>
      <mass value="1.0"/>
      <inertia ixx="5e-3" ixy="0" ixz="0" iyy="5e-3" iyz="0" izz="5e-3"/>
    </inertial>
  </link>
  <link name="thigh">
    <inertial>
      <origin xyz="0 0 -0.05"/>
      <mass value="0.2"/>
      <inertia ixx="3e-4" ixy="0" ixz="0" iyy="3e-4" iyz="0" izz="1e-4"/>
    </inertial>
  </link>
  <link name="foot">
    <inertial>
      <mass value="0.1"/>
      <inertia ixx="2e-4" ixy="0" ixz="0" iyy="2e-4" iyz="0" izz="2e-4"/>
    </inertial>
    <collision>
      <origin xyz="0.08 0 -0.01"/>
      <geometry><sphere radius="0.01"/></geometry>
    </collision>
    <collision>
      <origin xyz="-0.08 0 -0.01"/>
      <geometry><sphere radius="0.01"/></geometry>
    </collision>
  </link>
  <joint name="hip" type="revolute">
    <parent link="trunk"/>
    <child link="thigh"/>
    <axis xyz="0 -1 0"/>
    <limit lower="-1" upper="1" effort="8.0" velocity="20.0"/>
  </joint>
  <joint name="leg" type="prismatic">
    <parent link="thigh"/>
    <child link="foot"/>
    <origin xyz="0 0 -0.20"/>
    <axis xyz="0 0 -1"/>
    <limit lower="-0.1" upper="0.1" effort="1000" velocity="50.0"/>
  </joint>
</robot>
)";

const std::string kHopperTask = R"(format = "tumbler-task"
version = 1
name = "sway"
robot = "hopper.urdf"
root = "planar-xz"
duration_s = 0.5
settle_s = 0.2

[passive.leg]
stiffness_nm_per_rad = 2000.0
damping_nm_s_per_rad = 30.0

[start]
joints_rad = { hip = 0.0 }

[end]
joints_rad = { hip = 0.1 }

[[cost]]
term = "effort"
weight = 1e-3

[[cost]]
term = "terminal"
of = "z"
when = "settled"
weight = 10.0
target = 0.2
tolerance = 0.1

[contact]
stiffness_n_per_m = 2.0e4
damping_n_s_per_m = 100.0
d_on_m = 0.01
d_off_m = 0.005
mu = 0.6
v_max_m_per_s = 0.1

[[obstacle]]
name = "ground"
kind = "half-space"
point_m = [0.0, 0.0]
normal = [0.0, 1.0]
)";

Problem Hopper(const std::string& task = kHopperTask) {
  return ParseTask(task, "task.toml", kHopper, "hopper.urdf").problem;
}

TEST(Passive, ARobotRestsOnItsSpringAsFarInAsItsWeightPressesIt) {
  const Problem problem = Hopper();
  ASSERT_EQ(problem.joints.size(), 1U);
  ASSERT_EQ(problem.start_q.size(), 5U);
  // The foot is no weight on the spring. The leg's coordinate grows downwards.
  EXPECT_NEAR(problem.start_q[4], -1.2 * kG / 2000, 1e-6);
  EXPECT_NEAR(problem.start_q[2], 0, 1e-6);
  SceneDynamics robot(problem.scene);
  robot.SetFree(robot.AtRest(problem.start_q));
  robot.q[3] = problem.start_q[3];
  robot.TouchAndSolve();
  for (const int dof : robot.free) EXPECT_NEAR(robot.qdd[static_cast<std::size_t>(dof)], 0, 1e-4);
}

TEST(Passive, MessagesMeasureASlidingJointInMetresAndNewtons) {
  const auto refusal = [](const std::string& task, const std::string& robot = kHopper) {
    try {
      static_cast<void>(ParseTask(task, "task.toml", robot, "hopper.urdf"));
    } catch (const FileError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  const std::string with_motor =
      Replaced(Replaced(Replaced(kHopperTask,
                                 "[passive.leg]\nstiffness_nm_per_rad = 2000.0\n"
                                 "damping_nm_s_per_rad = 30.0\n",
                                 ""),
                        "{ hip = 0.0 }", "{ hip = 0.0, leg = 0.0 }"),
               "{ hip = 0.1 }", "{ hip = 0.1, leg = 0.0 }");
  const std::string rubs =
      Replaced(kHopper, "effort=\"1000\" velocity=\"50.0\"/>",
               "effort=\"1000\" velocity=\"50.0\"/><dynamics friction=\"9\"/>");
  EXPECT_EQ(refusal(with_motor), "taken");
  EXPECT_THAT(refusal(with_motor, rubs), HasSubstr("'leg' with a dry friction of 9 N, which"));
  EXPECT_THAT(refusal(kHopperTask, rubs), HasSubstr("has a dry friction of 9 N in the robot's"));
  const auto fast = [&with_motor](const std::string& rates) {
    return Replaced(Replaced(with_motor, "settle_s = 0.2", "settle_s = 0.0"), "[start]",
                    "[start]\njoints_rad_s = " + rates);
  };
  EXPECT_THAT(refusal(fast("{ leg = 60.0 }")),
              HasSubstr("is 60 m/s; allowed: less than the joint's limit of 50 m/s"));
  EXPECT_THAT(refusal(fast("{ leg = 40.0 }")),
              ::testing::ContainsRegex("beside the end at [0-9.]+ m; allowed: -0.1 to 0.1 m;"));
  EXPECT_THAT(refusal(fast("{ hip = 30.0 }")), HasSubstr("is 30 rad/s; allowed: less than"));
}

TEST(Passive, AStiffSpringShortensTheStepsThatATaskLeavesOut) {
  const auto with = [](const std::string& stiffness) {
    return Pendulum(Replaced(kPendulumTask, "stiffness_nm_per_rad = 1.5",
                             "stiffness_nm_per_rad = " + stiffness));
  };
  // The tip turns about its joint with 3e-3 kg m^2.
  EXPECT_NEAR(with("1.5").advisable_step_s, std::sqrt(3e-3 / 1.5), 1e-9);
  EXPECT_EQ(with("1.5").solver.step_s, SolverSettings().step_s);
  EXPECT_NEAR(with("30000.0").solver.step_s, std::sqrt(3e-3 / 3e4), 1e-9);
  EXPECT_NEAR(with("30000.0").search.step_s, 1.5 * std::sqrt(3e-3 / 3e4), 1e-9);
  EXPECT_TRUE(
      std::isinf(Pendulum(Replaced(Replaced(kPendulumTask, "stiffness_nm_per_rad = 1.5", ""),
                                   "damping_nm_s_per_rad = 0.01", ""))
                     .advisable_step_s));
}

TEST(Passive, GradientsOfAdjointAndForwardSensitivitiesAgreeAndAreThoseOfDifferences) {
  for (const bool hops : {false, true}) {
    // Dropped from some height, it lands on its springy leg, deep in the layer.
    const std::string dropped = Replaced(kHopperTask, "[start]", "[start]\nz_m = 0.32");
    const Problem problem = hops ? Hopper(Replaced(dropped, "d_on_m = 0.01\nd_off_m = 0.005",
                                                   "d_on_m = 0.003\nd_off_m = 0.0015"))
                                 : Pendulum();
    for (const std::uint64_t seed : {1U, 2U}) {
      const std::vector<double> x = RandomMotion(problem, seed, hops ? 0.15 : 0.6);
      for (const bool adaptive : {false, true}) {
        Rollout rollout(problem, 1e-3);
        if (adaptive) rollout.Use(StepsFor(problem, x));
        const Gradients adjoint = GradientsOf(rollout, x);
        const Gradients forward = GradientsOf(
            ForwardSensitivity(problem, adaptive ? AdaptiveSteps(problem) : StepSettings{}), x);
        ASSERT_TRUE(adjoint.result.finite);
        ASSERT_EQ(adjoint.result.penetration_excess > -1, hops);
        for (Eigen::Index row = 0; row < (hops ? 3 : 2); ++row) {
          EXPECT_LT((adjoint.gradient.row(row) - forward.gradient.row(row)).cwiseAbs().maxCoeff(),
                    1e-8 * forward.gradient.row(row).cwiseAbs().maxCoeff())
              << "row " << row << (adaptive ? " adaptive" : " fixed") << (hops ? " hopper" : "");
        }
        const double scale = adjoint.gradient.row(0).cwiseAbs().maxCoeff();
        for (std::size_t k = 0; k < x.size(); ++k) {
          const auto cost_at = [&](double by) {
            std::vector<double> beside = x;
            beside[k] += by;
            return rollout.Run(beside).cost;
          };
          EXPECT_NEAR(adjoint.gradient(0, static_cast<Eigen::Index>(k)),
                      (cost_at(1e-5) - cost_at(-1e-5)) / 2e-5, 1e-5 * scale)
              << k << (hops ? " hopper" : "");
        }
      }
    }
  }
}

TEST(Passive, TheTwinsSpringSwingsAsThePlans) {
  const Problem problem = Pendulum();
  const std::vector<double> x = RandomMotion(problem, 2, 0.6);
  const auto path = PositionSpline(problem, x, 0);
  TwinConfig config;
  config.step_ns = 5'000;
  config.held = false;
  SimulatedMotorConfig motor;
  motor.torque_max_nm = 1000;
  FollowingDrive drive(motor, [&](double t) {
    const auto at = path.Evaluate(std::min(t, problem.duration_s));
    return std::pair(at.value, t < problem.duration_s ? at.first : 0.0);
  });
  SimulatedBus bus;
  Twin twin(problem.scene, PoseAt(problem.start_q, problem.scene.robot), config, bus, {&drive});
  double furthest = 0;
  Rollout(problem, 1e-3).Visit(x, 0, [&](const MotionSample& at) {
    twin.AdvanceTo(std::llround(1e9 * at.time_s));
    ASSERT_EQ(twin.state().passive_positions_rad.size(), 1U);
    EXPECT_NEAR(twin.state().passive_positions_rad[0], at.q[1], 2e-3) << at.time_s;
    furthest = std::max(furthest, std::abs(at.q[1] - 0.2));
  });
  EXPECT_GT(furthest, 0.2);
}

/// The motion of the solved pendulum, made once.
struct Solved {
  Task task = ParsePendulumTask(kPendulumTask);
  SolveOutcome outcome = Solve(task.problem, {});
};
const Solved& SolvedPendulum() {
  static const Solved solved;
  return solved;
}

TEST(Passive, ASolvedMotionLeavesTheSprungTipCalmThatAStraightOneLetsSwing) {
  const Problem& problem = SolvedPendulum().task.problem;
  ASSERT_FALSE(SolvedPendulum().outcome.solutions.empty());
  const std::vector<double>& x = SolvedPendulum().outcome.solutions.front().x;
  const auto sway = [&](const std::vector<double>& parameters) {
    double speed = 0;  // of the wrist in the last tenth of a second
    Rollout(problem, 1e-4).Visit(parameters, 0, [&](const MotionSample& at) {
      if (at.time_s > 0.9) speed = std::max(speed, std::abs(at.qd[1]));
    });
    return speed;
  };
  const std::vector<double> straight = RandomMotion(problem, 1, 0);
  EXPECT_LT(sway(x), 0.25 * sway(straight));
  EXPECT_TRUE(LookAgain(problem, x).acceptable()) << LookAgain(problem, x).Objections();
}

/// The pendulum with a wrist that stops there.
std::string PendulumWithStops(const std::string& limits) {
  return Replaced(kPendulum, "lower=\"-2\" upper=\"2\"", limits);
}

TEST(Passive, AMotionThatLeadsAJointBeyondItsStopIsRefusedWithTheJointAndWhereItIs) {
  const Problem& problem = SolvedPendulum().task.problem;
  const std::vector<double>& x = SolvedPendulum().outcome.solutions.front().x;
  double lowest = 1, lowest_s = 0;
  Rollout(problem, 1e-4).Visit(x, 0, [&](const MotionSample& at) {
    if (at.q[1] >= lowest) return;
    lowest = at.q[1];
    lowest_s = at.time_s;
  });
  ASSERT_LT(lowest, 0.1) << "below where it starts";
  const auto look = [&](double stop) {
    const std::string robot = PendulumWithStops(fmt::format("lower=\"{}\" upper=\"2\"", stop));
    return LookAgain(ParseTask(kPendulumTask, "task.toml", robot, "pendulum.urdf").problem, x);
  };
  EXPECT_TRUE(look(lowest - 1e-3).acceptable());
  const SecondLook beyond = look(lowest + 1e-3);
  EXPECT_FALSE(beyond.acceptable());
  EXPECT_NEAR(beyond.passive_excess, 1e-3, 1e-5);
  EXPECT_NEAR(beyond.passive_time_s, lowest_s, 2e-3);
  EXPECT_THAT(beyond.Objections(),
              AllOf(HasSubstr("the joint without a motor 'wrist' is at "),
                    HasSubstr(fmt::format("beyond its limit of {:.4g} rad", lowest + 1e-3)),
                    HasSubstr("no stop is simulated")));
}

TEST(Passive, AChainEndsWhereAJointGoesBeyondItsStop) {
  const Solved& solved = SolvedPendulum();
  std::string text =
      ToToml(MakePrimitiveFile(solved.task, solved.outcome, solved.outcome.solutions.front()));
  PrimitiveFile file = ParsePrimitive(text, "pendulum.toml");
  file.provenance.robot_urdf = PendulumWithStops("lower=\"0.25\" upper=\"2\"");
  file.provenance.robot_hash = HashOfText(file.provenance.robot_urdf);
  text = ToToml(file);
  const SimulatedMotion motion(
      LoadMotion("pendulum.toml", [&](const std::string&) { return text; }));
  const ChainOutcome chain = SimulateChain(motion, {}, {});
  ASSERT_TRUE(chain.failure);
  EXPECT_EQ(chain.failure->cause, ChainFailure::Cause::kStop);
  EXPECT_THAT(chain.failure->text, HasSubstr("'wrist' is at "));
}

/// How low the wrist comes in the twin while the shoulder swings to and fro for 2 s.
double LowestWristInTwin(const Problem& problem, const TwinConfig& config) {
  SimulatedMotorConfig motor;
  motor.torque_max_nm = 1000;
  FollowingDrive drive(motor, [](double t) {
    return std::pair(-0.4 + 0.5 * std::sin(9 * t), 4.5 * std::cos(9 * t));
  });
  SimulatedBus bus;
  Twin twin(problem.scene, PoseAt(problem.start_q, problem.scene.robot), config, bus, {&drive});
  double lowest = 1;
  for (std::int64_t ms = 1; ms <= 2000; ++ms) {
    twin.AdvanceTo(ms * 1'000'000);
    const TwinState state = twin.state();
    lowest = std::min(lowest, state.passive_positions_rad[0]);
    if (std::abs(state.joint_positions_rad[0]) < 1.2) continue;
    ADD_FAILURE() << "the shoulder is at " << state.joint_positions_rad[0] << " after " << ms;
    break;
  }
  return lowest;
}

TEST(Passive, InTheTwinAStopHoldsAJointWithinItsLimits) {
  const auto lowest_of = [](const std::string& robot) {
    TwinConfig config;
    config.step_ns = 5'000;
    config.held = false;
    return LowestWristInTwin(ParseTask(kPendulumTask, "task.toml", robot, "pendulum.urdf").problem,
                             config);
  };
  EXPECT_LT(lowest_of(kPendulum), -0.1);
  const double stopped = lowest_of(PendulumWithStops("lower=\"0.0\" upper=\"2\""));
  EXPECT_LT(stopped, 0) << "it meets it";
  EXPECT_GT(stopped, -0.02);
}

TEST(Passive, InTheTwinAStopIsNoHarderThanItsStepsBear) {
  // A tip of 10 g, whose moment of inertia is a thousandth of that of a rotor. It swings into its
  // stop, in the twin's own steps.
  std::string robot = PendulumWithStops("lower=\"0.0\" upper=\"2\"");
  robot = Replaced(robot, "mass value=\"0.2\"", "mass value=\"0.01\"");
  robot = Replaced(robot, "ixx=\"1e-3\" ixy=\"0\" ixz=\"0\" iyy=\"1e-3\" iyz=\"0\" izz=\"1e-4\"",
                   "ixx=\"1e-6\" ixy=\"0\" ixz=\"0\" iyy=\"1e-6\" iyz=\"0\" izz=\"1e-6\"");
  robot = Replaced(robot, "xyz=\"0 0 -0.10\"", "xyz=\"0 0 -0.01\"");
  std::string task =
      Replaced(kPendulumTask, "stiffness_nm_per_rad = 1.5", "stiffness_nm_per_rad = 0.0");
  task = Replaced(task, "damping_nm_s_per_rad = 0.01", "damping_nm_s_per_rad = 1e-4");
  TwinConfig config;
  config.held = false;
  const double lowest =
      LowestWristInTwin(ParseTask(task, "task.toml", robot, "pendulum.urdf").problem, config);
  EXPECT_LT(lowest, 0) << "it meets it";
  EXPECT_GT(lowest, -0.1);
}

TEST(Passive, ASpringThatIsSlackBeyondAStopIsRefusedOnReadingWhereTheStartIsThere) {
  const std::string robot = PendulumWithStops("lower=\"-2\" upper=\"0.15\"");
  try {
    ParseTask(Replaced(kPendulumTask, ", wrist = 0.3", ""), "task.toml", robot, "pendulum.urdf");
    FAIL() << "it is taken";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("passive.wrist.rest_rad: is 0.2, where the joint starts"));
  }
}

TEST(Passive, APrimitiveKeepsWhereItsPassiveJointsStartAndEndAndAChainPlaysItAlike) {
  const Solved& solved = SolvedPendulum();
  const PrimitiveFile made =
      MakePrimitiveFile(solved.task, solved.outcome, solved.outcome.solutions.front());
  const PrimitiveFile file = ParsePrimitive(ToToml(made), "pendulum.toml");
  ASSERT_EQ(file.entry.passive_positions_rad, (std::vector<double>{0.3}));
  ASSERT_EQ(file.exit.passive_positions_rad.size(), 1U);
  EXPECT_EQ(file.exit.passive_positions_rad, made.exit.passive_positions_rad);
  EXPECT_EQ(file.primitive.joint_count, 1);
  EXPECT_EQ(TaskOf(file).problem.start_q, solved.task.problem.start_q);
  // Where it comes to hang 2 s later: moments of weight and spring cancel there.
  const double q = file.exit.passive_positions_rad[0];
  EXPECT_NEAR(-0.2 * kG * 0.1 * std::sin(0.9 + q) - 1.5 * (q - 0.2), 0, 5e-3);
  double last = 0;
  std::string written = ToToml(made);
  const SimulatedMotion motion(
      LoadMotion("pendulum.toml", [&](const std::string&) { return written; }));
  ChainOptions options;
  options.last_hold_s = 2;
  const ChainOutcome chain =
      SimulateChain(motion, options, [&](int, const MotionSample& at) { last = at.q[1]; });
  EXPECT_FALSE(chain.failure) << chain.failure->text;
  EXPECT_NEAR(last, q, 1e-3);
  // A hash over the file: another start of the tip is another motion.
  EXPECT_THROW(ParsePrimitive(Replaced(written, "passive_positions_rad = [0.3",
                                       "passive_positions_rad = [0.4"),
                              "pendulum.toml"),
               FileError);
}

std::string PassiveMistake(const std::string& task) {
  try {
    Pendulum(task);
  } catch (const FileError& error) {
    return error.what();
  }
  return "taken";
}

TEST(Passive, WhatAPassiveJointCannotBeIsRefusedByName) {
  EXPECT_THAT(PassiveMistake(Replaced(kPendulumTask, "[passive.wrist]", "[passive.elbow]")),
              HasSubstr("passive.elbow: is not a joint of the robot; its joints: shoulder, wrist"));
  EXPECT_THAT(
      PassiveMistake(Replaced(kPendulumTask, "shoulder = 0.9", "shoulder = 0.9, wrist = 0")),
      HasSubstr("end.joints_rad.wrist: has no motor that could bring it there"));
  EXPECT_THAT(PassiveMistake(Replaced(kPendulumTask, "stiffness_nm_per_rad = 1.5",
                                      "stiffness_nm_per_rad = -1.5")),
              HasSubstr("passive.wrist.stiffness_nm_per_rad: is -1.5; allowed: from 0"));
  EXPECT_THAT(PassiveMistake(Replaced(kPendulumTask, "wrist = 0.3", "wrist = 2.5")),
              HasSubstr("start.joints_rad.wrist: is 2.5; allowed: from -2 ... 2"));
  EXPECT_THAT(PassiveMistake(kPendulumTask + "[passive.shoulder]\n"),
              HasSubstr("passive: leaves no joint with a motor"));
  EXPECT_THAT(PassiveMistake(kPendulumTask + "[motor.wrist]\ndry_friction_nm = 0.1\n"),
              HasSubstr("motor.wrist: is in [passive], so it has no motor"));
  EXPECT_THAT(PassiveMistake(kPendulumTask + "[limits.wrist]\ntorque_max_nm = 1.0\n"),
              HasSubstr("limits.wrist: is in [passive], so it has no motor to limit"));
}

TEST(Passive, ShapesThatAPassiveJointMovesAreLookedAtInSimulationsOnly) {
  std::string task = testing::ReadFile(testing::SourcePath("tests/data/tasks/hop.toml"));
  const std::string robot = testing::ReadFile(testing::SourcePath("tests/data/robots/hopper.urdf"));
  const auto parse = [&](const std::string& text) {
    return ParseTask(text, "hop.toml", robot, "hopper.urdf").problem;
  };
  const Problem driven = parse(task);
  EXPECT_THAT(driven.scene.self_contact.pairs, ::testing::SizeIs(::testing::Gt(0)));
  task = Replaced(task, "knee = -1.0, ", "", "[end]");
  task = Replaced(task, "[start]",
                  "[passive.knee]\nstiffness_nm_per_rad = 20.0\n\n[start]\nz_m = 1.0");
  const Problem problem = parse(task);
  EXPECT_EQ(problem.joints.size(), 2U);
  EXPECT_EQ(problem.start_q[4], -1.0);
  // The trunk is beyond the knee, seen from the foot.
  EXPECT_THAT(problem.scene.self_contact.pairs, ::testing::IsEmpty());
  EXPECT_EQ(problem.scene.self_contact.simulated, driven.scene.self_contact.pairs);
  const Problem without = parse(task + "\n[self_contact]\nleave_out = [[\"foot\", \"trunk\"]]\n");
  EXPECT_LT(without.scene.self_contact.simulated.size(),
            problem.scene.self_contact.simulated.size());
}

TEST(Passive, LanesRefuseAPassiveJointByNameAndNoChainOfAnglesHasIt) {
  const Problem problem = Hopper();
  try {
    MakeLaneScene(problem.scene, {});
    FAIL() << "lanes take it";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("the joint 'leg' has no motor"));
  }
  std::vector<std::string> links;
  for (const LinkChain& chain : LinkChainsOf(Pendulum().scene.robot)) links.push_back(chain.link);
  EXPECT_THAT(links, ::testing::ElementsAre("arm"));
}

}  // namespace
}  // namespace tumbler
