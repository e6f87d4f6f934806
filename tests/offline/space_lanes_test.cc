// Robots in space in the lanes of packets that play a motion through drives: what each does alone.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/certify/driven_motion.h"
#include "offline/certify/space_trial.h"
#include "offline/problem/task_toml.h"
#include "offline/scene/packet.h"
#include "offline/scene/variation.h"
#include "offline/solve/guess.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

/// A shipped motion, and robots that differ from its model.
struct Shipped {
  explicit Shipped(const std::string& path)
      : file(LoadPrimitive(testing::SourcePath("primitives/" + path))),
        problem(TaskOf(file, TaskSpaces::kPlaneAndSpace).problem),
        x(ParametersOf(file.primitive)) {
    for (const JointMotion<double>& motion : file.primitive.motions())
      feed_forward.push_back(motion.torque);
    Spreads spreads;
    spreads.mass = 0.05;
    spreads.friction = 0.2;
    spreads.slope_rad = 0.01;
    const SpaceScene& model = problem.space->scene;
    for (std::size_t i = 0; i < Packet::kLanes; ++i) {
      PlayedRobot<Spatial> robot{
          Varied(model, DrawRobot(model, spreads, 1, 7, static_cast<std::uint64_t>(i))),
          problem.drive_gains()};
      robot.lean_rad = 0.002 * static_cast<double>(i);
      // A little before a look, whatever rounding makes of a step's time.
      if (i % 2 == 1) robot.push = RootPush<Spatial>{0.05 - 1e-7, 0.02, SpaceVector(1, -4, 2)};
      robots.push_back(std::move(robot));
    }
  }

  PrimitiveFile file;
  Problem problem;
  std::vector<double> x;
  std::vector<JointMotion<double>::Spline> feed_forward;
  std::vector<PlayedRobot<Spatial>> robots;
};

/// Positions, velocities and axes of a robot at a time.
std::vector<double> NumbersOf(const DrivenSample& at) {
  std::vector<double> numbers(at.q.begin(), at.q.end());
  numbers.insert(numbers.end(), at.qd.begin(), at.qd.end());
  for (int i = 0; i < 9; ++i) numbers.push_back((*at.axes)(i / 3, i % 3));
  return numbers;
}

/// A motion, and the period of its setpoints.
struct DrivenCase {
  const char* motion;
  double period_s;
  friend void PrintTo(const DrivenCase& of, std::ostream* os) {
    *os << of.motion << " every " << of.period_s << " s";
  }
};

class DrivenLanesInSpace : public ::testing::TestWithParam<DrivenCase> {};

/// So much that contact asks for no shorter steps: those of robots that differ would.
constexpr double kHeavy_kg = 1e6;

// Both take the same steps: a quarter of the solver's, in equal parts of the period, so that
// setpoints change between them. The classical method's sums and the dynamics are rounded
// otherwise, and contact amplifies that.
TEST_P(DrivenLanesInSpace, DoWhatEachRobotDoesAlone) {
  Shipped shipped(GetParam().motion);
  const double period_s = GetParam().period_s;
  const double look_s = period_s / std::ceil(period_s / 1e-3 - 1e-6);
  for (PlayedRobot<Spatial>& robot : shipped.robots) {
    robot.period_s = period_s;
    // Lanes are pushed from look to look.
    if (robot.push) robot.push->start_s = 50 * look_s - 1e-7;
    if (robot.push) robot.push->duration_s = 20 * look_s;
  }
  const DrivenMotion motion{&shipped.problem, &shipped.x, shipped.feed_forward, 0.25, kHeavy_kg};
  std::vector<std::vector<std::vector<double>>> seen(shipped.robots.size());
  const std::vector<bool> plausible =
      PlayThroughDrivesInSpace({&motion, 1}, shipped.robots,
                               [&seen](std::size_t which, std::size_t, const DrivenSample& at) {
                                 seen[which].push_back(NumbersOf(at));
                                 return true;
                               });
  EXPECT_EQ(plausible, std::vector<bool>(shipped.robots.size(), true));
  for (const std::size_t i : {0U, 3U, 6U}) {
    std::size_t look = 0;
    double largest = 0;
    const auto compare = [&](std::size_t, const DrivenSample& at) {
      if (std::abs(at.time_s - look_s * static_cast<double>(look)) > 1e-9) return true;
      const std::vector<double> alone = NumbersOf(at);
      for (std::size_t k = 0; k < alone.size(); ++k)
        largest = std::max(largest, std::abs(alone[k] - seen[i].at(look)[k]));
      ++look;
      return true;
    };
    EXPECT_TRUE(PlayThroughDrivesInSpace({&motion, 1}, shipped.robots[i], compare));
    EXPECT_EQ(look, seen[i].size());
    EXPECT_LT(largest, 1e-8) << "robot " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Motions, DrivenLanesInSpace,
                         ::testing::Values(DrivenCase{"solo12/get_up.toml", 1e-3},
                                           DrivenCase{"solo12/get_up.toml", 1.0 / 290},
                                           DrivenCase{"solo8/walk.toml", 1e-3}));

// A second motion begins where the first has left the robot.
TEST(DrivenLanesInSpace, PlayMotionsOneAfterTheOther) {
  const Shipped shipped("solo8/walk.toml");
  const DrivenMotion walk{&shipped.problem, &shipped.x, shipped.feed_forward, 0.1, kHeavy_kg};
  const std::vector<DrivenMotion> twice = {walk, walk};
  constexpr double kLook_s = 0.05;  // of the second motion
  const auto is_then = [](std::size_t motion, const DrivenSample& at) {
    return motion == 1 && std::abs(at.time_s - kLook_s) < 1e-9;
  };
  std::vector<std::vector<double>> seen(2);
  const auto robots = std::span(shipped.robots).first(2);
  PlayThroughDrivesInSpace(twice, robots,
                           [&](std::size_t which, std::size_t motion, const DrivenSample& at) {
                             if (is_then(motion, at)) seen[which] = NumbersOf(at);
                             return true;
                           });
  for (std::size_t i = 0; i < robots.size(); ++i) {
    std::vector<double> alone;
    PlayThroughDrivesInSpace(twice, robots[i], [&](std::size_t motion, const DrivenSample& at) {
      if (is_then(motion, at)) alone = NumbersOf(at);
      return true;
    });
    ASSERT_FALSE(alone.empty());
    ASSERT_EQ(seen[i].size(), alone.size());
    for (std::size_t k = 0; k < alone.size(); ++k) EXPECT_NEAR(seen[i][k], alone[k], 1e-8) << k;
  }
  EXPECT_NE(seen[0], seen[1]);
}

TEST(DrivenLanesInSpace, GoOnForThoseOfWhichTheVisitorSaysSo) {
  const Shipped shipped("solo8/walk.toml");
  const DrivenMotion walk{&shipped.problem, &shipped.x, shipped.feed_forward, 0.05};
  std::vector<int> looks(shipped.robots.size());
  PlayThroughDrivesInSpace({&walk, 1}, shipped.robots,
                           [&looks](std::size_t which, std::size_t, const DrivenSample&) {
                             return ++looks[which] < static_cast<int>(10 * (which + 1));
                           });
  EXPECT_EQ(looks, (std::vector<int>{10, 20, 30, 40, 50, 50, 50, 50}));
}

// A foot that slides under torques asks for shorter steps than one that a path moves, and hard
// ground for shorter ones than its task's.
struct Ground {
  const char* name;
  const char* motion;
  GroundSpread friction, stiffness;
  double hold_s;
  friend void PrintTo(const Ground& ground, std::ostream* out) { *out << ground.name; }
};
class StepsThroughDrives : public ::testing::TestWithParam<Ground> {};

TEST_P(StepsThroughDrives, AreShortEnoughForTheGroundAndForHowLongARobotIsHeld) {
  const Shipped shipped(GetParam().motion);
  const SpaceScene& model = shipped.problem.space->scene;
  Spreads spreads;
  spreads.mass = 0.05;
  spreads.friction = GetParam().friction;
  spreads.stiffness = GetParam().stiffness;
  spreads.damping = 0;
  std::vector<PlayedRobot<Spatial>> robots;
  for (std::uint64_t i = 0; i < Packet::kLanes; ++i) {
    PlayedRobot<Spatial> robot{Varied(model, DrawRobot(model, spreads, 1, 3, i)),
                               shipped.problem.drive_gains()};
    robot.period_s = 3.4e-3;
    robots.push_back(std::move(robot));
  }
  // With a mass that contact does not ask for shorter steps with, they are the task's.
  const auto as_asked = [&](double finer, double lightest_kg) {
    Problem problem = shipped.problem;
    problem.solver.step_s /= finer;
    std::ptrdiff_t count = 0;
    const auto targets = DueTargetsInSpace(problem, shipped.file.purpose);
    JudgedMotion motion{&problem, &shipped.x, shipped.feed_forward, targets, GetParam().hold_s};
    motion.lightest_kg = lightest_kg;
    for (const SpaceTrial& trial : TryInSpace({&motion, 1}, robots))
      count += trial.as_asked() ? 1 : 0;
    return count;
  };
  const std::ptrdiff_t by_contact = as_asked(1, 0);
  EXPECT_EQ(by_contact, as_asked(4, 0));
  EXPECT_NE(by_contact, as_asked(1, kHeavy_kg));
}

INSTANTIATE_TEST_SUITE_P(
    On, StepsThroughDrives,
    ::testing::Values(Ground{"theTasksGround", "solo12/walk.toml", 0.2, 0.2, 10},
                      Ground{"rough", "solo8/walk.toml", GroundSpread::Between{5, 10}, 0.2, 0},
                      Ground{"hard", "solo12/walk.toml", 0.2, GroundSpread::Between{1e5, 1e6}, 0}),
    [](const auto& ground) { return ground.param.name; });

}  // namespace
}  // namespace tumbler
