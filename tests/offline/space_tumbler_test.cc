// The shipped handstand in space: where feet have a width it stands, and where they have none the
// robot falls sideways.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/certify/driven_motion.h"
#include "offline/problem/space_quantity.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/packet.h"
#include "offline/scene/root_chart.h"
#include "offline/scene/stepper.h"
#include "offline/scene/variation.h"
#include "offline/solve/guess.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using testing::ReadFile;
using testing::SourcePath;

const PrimitiveFile& TheHandstand() {
  static const PrimitiveFile file = LoadPrimitive(SourcePath("primitives/handstand.toml"));
  return file;
}

/// The task of the shipped handstand for a robot in space.
/// @param ground  its stiffness and damping, as parts of the plane's.
std::string HandstandTask(double ground) {
  const Primitive<double>& primitive = TheHandstand().primitive;
  return "format = \"tumbler-task\"\nversion = 1\nname = \"handstand\"\nrobot = \"tumbler.urdf\"\n"
         "root = \"floating\"\nduration_s = " +
         std::to_string(primitive.duration_s) + "\nsettle_s = 1.5\n" +
         R"([start]
joints_rad = { leg1 = -1.5707963267948966, leg2 = 1.5707963267948966 }
[end]
joints_rad = { leg1 = 0.0, leg2 = 0.0 }
[spline]
control_points = 12
[limits]
acceleration_max_rad_s2 = 400.0
rotor_inertia_kg_m2 = 0.001
[[cost]]
term = "terminal"
of = "misalignment"
axis = [1.0, 0.0, 0.0]
along = [0.0, 0.0, 1.0]
when = "settled"
weight = 10.0
[contact]
d_on_m = 0.01
d_off_m = 0.0075
mu = 0.3
v_max_m_per_s = 0.05
stiffness_n_per_m = )" +
         std::to_string(2.5e4 * ground) + "\ndamping_n_s_per_m = " + std::to_string(100 * ground) +
         R"(
[[obstacle]]
name = "ground"
point_m = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
[drives]
kp_nm_per_rad = 40.0
kd_nm_s_per_rad = 5.0
)";
}

Problem Handstand(const std::string& robot, double ground) {
  return ParseTask(HandstandTask(ground), "handstand.toml",
                   ReadFile(SourcePath("primitives/robots/" + robot)), robot,
                   TaskSpaces::kPlaneAndSpace)
      .problem;
}

/// How far robots are from their handstand after 3 s, as 2 sin(angle / 2).
std::vector<double> PlayedMisalignments(const Problem& problem,
                                        std::span<const PlayedRobot<Spatial>> played) {
  const std::vector<double> x = ParametersOf(TheHandstand().primitive);
  std::vector<JointMotion<double>::Spline> feed_forward;
  for (const JointMotion<double>& motion : TheHandstand().primitive.motions())
    feed_forward.push_back(motion.torque);
  const DrivenMotion motion{&problem, &x, feed_forward, problem.duration_s + 3};
  constexpr double kFallen = 2;
  std::vector<double> last(played.size(), kFallen);
  for (std::size_t first = 0; first < played.size(); first += Packet::kLanes) {
    const auto some = played.subspan(first, std::min(Packet::kLanes, played.size() - first));
    const std::vector<bool> plausible = PlayThroughDrivesInSpace(
        {&motion, 1}, some, [&](std::size_t i, std::size_t, const DrivenSample& at) {
          last[first + i] = problem.cost.front().Value({at.q, at.qd, {}, at.axes});
          return true;
        });
    for (std::size_t i = 0; i < some.size(); ++i)
      if (!plausible[i]) last[first + i] = kFallen;
  }
  return last;
}

double PlayedMisalignment(const Problem& problem, const PlayedRobot<Spatial>& played) {
  return PlayedMisalignments(problem, {&played, 1}).front();
}

PlayedRobot<Spatial> RobotOf(const Problem& problem, std::uint64_t index) {
  Spreads spreads;  // masses 5 %, ground 20 %
  const SpaceScene& model = problem.space->scene;
  PlayedRobot<Spatial> played = NominalInSpace(problem, {});
  played.scene = Varied(model, DrawRobot(model, spreads, 1, 7, index));
  return played;
}

TEST(HandstandInSpace, OfFiftyRobotsOnFeetThatAreFourCentimetresWideAllStand) {
  // In the plane two spheres beside each other are one: on half the ground each they are as stiff.
  const Problem problem = Handstand("tumbler_wide_feet.urdf", 0.5);
  std::vector<PlayedRobot<Spatial>> robots;
  for (std::uint64_t i = 0; i < 50; ++i) robots.push_back(RobotOf(problem, i));
  EXPECT_THAT(PlayedMisalignments(problem, robots), ::testing::Each(::testing::Lt(0.05)));
}

TEST(HandstandInSpace, StandsAPushFromTheSide) {
  const Problem problem = Handstand("tumbler_wide_feet.urdf", 0.5);
  PlayedRobot<Spatial> played = NominalInSpace(problem, {});
  played.push = RootPush<Spatial>{problem.duration_s + 1, 0.1, SpaceVector(0, 1.4, 0)};
  EXPECT_LT(PlayedMisalignment(problem, played), 0.05);  // 0.14 N s
  played.push->force_n = SpaceVector(0, 20, 0);
  EXPECT_GT(PlayedMisalignment(problem, played), 0.5);
}

TEST(HandstandInSpace, FallsSidewaysWhereFeetHaveNoWidth) {
  const Problem problem = Handstand("tumbler.urdf", 1);
  PlayedRobot<Spatial> played = NominalInSpace(problem, {});
  played.push = RootPush<Spatial>{0.2, 0.1, SpaceVector(0, 0.01, 0)};  // a breath
  EXPECT_GT(PlayedMisalignment(problem, played), 0.5);
}

TEST(StepsInSpace, ARobotThatTurnsOnTheSpotComesToRestAtTheStepInUse) {
  const Problem problem = Handstand("tumbler_wide_feet.urdf", 0.5);
  SpaceDynamics robot(problem.space->scene);
  RootChart<Spatial> chart;
  chart.axes = problem.space->start_orientation;
  robot.Use(chart);
  SpaceDynamics::State y = robot.AtRest(problem.start_q);
  const std::size_t free = robot.free.size();
  y[free + 5] = 0.05;  // yaw [rad/s]
  for (int step = 0; step < static_cast<int>(3 / problem.solver.step_s); ++step) {
    StepRungeKutta<kClassical>(y, 2 * free, problem.solver.step_s,
                               [&](int, const SpaceDynamics::State& y_s, double* k) {
                                 robot.SetFree(y_s);
                                 robot.TouchAndSolve();
                                 robot.TakeSlope(k);
                                 return true;
                               });
    chart.MoveOn(&y[3], &y[free + 3]);
    robot.Use(chart);
  }
  double fastest = 0;
  for (std::size_t i = 0; i < free; ++i) fastest = std::max(fastest, std::abs(y[free + i]));
  EXPECT_LT(fastest, 1e-6);
}

}  // namespace
}  // namespace tumbler
