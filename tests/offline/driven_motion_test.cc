// A motion as drives play it that give way, compared with the twin, which has drives, bus and
// rounding as well.

#include "offline/certify/driven_motion.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "offline/certify/second_look.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/solver.h"
#include "offline/studies/trial.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Replaced;

std::vector<JointMotion<double>::Spline> FeedForwards(const Problem& problem,
                                                      const std::vector<double>& x) {
  const TorqueSamples torques = Summarize(problem, x).torques;
  std::vector<JointMotion<double>::Spline> splines;
  for (std::size_t j = 0; j < problem.joints.size(); ++j)
    splines.push_back(FeedForward(problem, torques, j));
  return splines;
}

TEST(DrivenMotion, IsThatOfATwinWithExactEncodersToTwoMillirad) {
  // What encoders round changes how the robot rocks by some 2 mrad more.
  const testing::TemporaryFolder folder;
  testing::WriteFile(
      folder / "twin.toml",
      "format = \"tumbler-twin\"\nversion = 1\n[motor]\nencoder_counts_per_turn = 0\n");
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/nominal/handstand.toml");
  study.twin = folder / "twin.toml";
  const Trials trials(study);
  const std::vector<ScriptTick>& ticks = trials.script().ticks;
  const auto first = std::ranges::find(ticks, ExecutorState::kRunning, &ScriptTick::state);
  ASSERT_NE(first, ticks.end());

  const SimulatedMotion& motion = trials.motion();
  const Problem& problem = motion.ProblemOf(0);
  const std::vector<double> x = testing::FreeControlPoints(motion.file().primitives[0].primitive);
  const double until_s = problem.duration_s + 1.5;
  double worst_rad = 0;
  std::size_t compared = 0;
  EXPECT_TRUE(PlayThroughDrives(problem, x, FeedForwards(problem, x), {}, until_s,
                                [&](double time_s, std::span<const double> q) {
                                  const double tick = time_s / trials.script().tick_s;
                                  if (std::abs(tick - std::round(tick)) > 1e-3) return true;
                                  const auto at = static_cast<std::ptrdiff_t>(std::round(tick));
                                  if (at >= ticks.end() - first) return true;
                                  worst_rad =
                                      std::max(worst_rad, std::abs(q[2] - first[at].pitch_rad));
                                  ++compared;
                                  return true;
                                }));
  EXPECT_GT(compared, 2000U);
  EXPECT_LT(worst_rad, 2e-3);
}

TEST(DrivenMotion, BeginsAsTheDisturbanceSays) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  const Problem problem = TaskOf(file).problem;
  const std::vector<double> x = testing::FreeControlPoints(file.primitive);
  const std::vector<JointMotion<double>::Spline> feed_forward = FeedForwards(problem, x);
  const auto positions_after = [&](double until_s, const Disturbance& disturbance) {
    std::vector<double> last;
    EXPECT_TRUE(PlayThroughDrives(problem, x, feed_forward, disturbance, until_s,
                                  [&](double /*time_s*/, std::span<const double> q) {
                                    last.assign(q.begin(), q.end());
                                    return true;
                                  }));
    return last;
  };
  const std::vector<double> level = positions_after(1e-6, {});
  EXPECT_EQ(level, problem.start_q);
  const std::vector<double> leaning = positions_after(1e-6, {.lean_rad = 2e-3});
  EXPECT_EQ(leaning[2], level[2] + 2e-3);
  EXPECT_EQ(leaning[3], level[3]);
  // A floor that rises to the right carries more of a robot's weight to the left.
  EXPECT_LT(positions_after(0.05, {.slope_rad = 0.1})[0], positions_after(0.05, {})[0] - 1e-4);
  EXPECT_EQ(positions_after(1e-6, {.slope_rad = 0.1}), level);
}

TEST(DrivenMotion, OfRobotsInLanesIsThatOfEachAlone) {
  for (const char* motion : {"nominal/handstand.toml", "nominal/roll.toml"}) {
    const PrimitiveFile file =
        LoadPrimitive(testing::SourcePath(std::string("primitives/") + motion));
    const Problem problem = TaskOf(file).problem;
    const std::vector<double> x = testing::FreeControlPoints(file.primitive);
    const std::vector<JointMotion<double>::Spline> feed_forward = FeedForwards(problem, x);
    const double until_s = problem.duration_s + 3;
    std::array<std::vector<std::vector<double>>, kDisturbances.size()> in_lanes;
    const std::vector<bool> plausible =
        PlayThroughDrives(problem, x, feed_forward, kDisturbances, until_s,
                          [&](std::size_t which, double /*time_s*/, std::span<const double> q) {
                            in_lanes[which].emplace_back(q.begin(), q.end());
                            return which != 1 || in_lanes[which].size() < 100;
                          });
    EXPECT_EQ(plausible, std::vector<bool>(kDisturbances.size(), true));
    EXPECT_EQ(in_lanes[1].size(), 100U) << "who is not asked for more gets none";
    for (std::size_t i = 0; i < kDisturbances.size(); ++i) {
      double worst = 0;
      std::size_t compared = 0;
      PlayThroughDrives(problem, x, feed_forward, kDisturbances[i], until_s,
                        [&](double time_s, std::span<const double> q) {
                          const double tick = time_s / 1e-3;
                          const auto at = static_cast<std::size_t>(std::lround(tick));
                          if (std::abs(tick - std::round(tick)) > 1e-3) return true;
                          if (at >= in_lanes[i].size()) return true;
                          for (std::size_t d = 0; d < q.size(); ++d)
                            worst = std::max(worst, std::abs(q[d] - in_lanes[i][at][d]));
                          ++compared;
                          return true;
                        });
      // Once the robot is calm, steps of one alone may begin beside the milliseconds.
      EXPECT_GE(compared, std::min<std::size_t>(in_lanes[i].size(), 2000));
      EXPECT_LT(worst, 1e-6) << motion << i;
    }
  }
}

TEST(DrivenMotion, WhereLanesDoNotHaveTheSceneRobotsArePlayedOneAfterTheOther) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  Problem problem = TaskOf(file).problem;
  const std::vector<double> x = testing::FreeControlPoints(file.primitive);
  const std::vector<JointMotion<double>::Spline> feed_forward = FeedForwards(problem, x);
  problem.scene.motors.resize(problem.joints.size());  // motors that are known to lose nothing
  std::array<std::vector<double>, 2> last, alone;
  const std::array<Disturbance, 2> disturbances = {kDisturbances[0], kDisturbances[3]};
  PlayThroughDrives(problem, x, feed_forward, disturbances, 0.1,
                    [&](std::size_t which, double /*time_s*/, std::span<const double> q) {
                      last[which].assign(q.begin(), q.end());
                      return true;
                    });
  for (std::size_t i = 0; i < 2; ++i) {
    PlayThroughDrives(problem, x, feed_forward, disturbances[i], 0.1,
                      [&](double /*time_s*/, std::span<const double> q) {
                        alone[i].assign(q.begin(), q.end());
                        return true;
                      });
    EXPECT_EQ(last[i], alone[i]);
  }
}

/// The shipped robot with a box of 40 mm, and so wide along the ground, as each foot.
std::string WithBoxFeet(const std::string& width_m) {
  const auto shape = [](const std::string& side, const std::string& at,
                        const std::string& geometry) {
    return fmt::format("<origin xyz=\"{}{}\"/>\n      <geometry>{}</geometry>", side, at, geometry);
  };
  const std::string ball = "<sphere radius=\"0.01\"/>";
  std::string robot = testing::ShippedRobot();
  for (const std::string side : {"", "-"}) {
    const std::string box = fmt::format("<box size=\"0.04 0.03 {}\"/>", width_m);
    robot = Replaced(robot, shape(side, "0.20 0 0.04", ball), shape(side, "0.19 0 0", box));
    // The other one disappears in the box.
    robot = Replaced(robot, shape(side, "0.20 0 -0.04", ball), shape(side, "0.19 0 0", ball));
  }
  return robot;
}

/// m g h of the robot on its foot is 6 N m/rad, which two contacts of 25 kN/m, 12.5 mm to either
/// side of the middle, resist with 8 N m/rad; but only until one lifts, some 25 mrad from upright.
TEST(DrivenMotion, FeetOnWhichARobotStandsWithExactJointsButFallsWithDrivesAreRefused) {
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "robot.urdf", WithBoxFeet("0.025"));
  testing::WriteFile(
      folder / "task.toml",
      Replaced(testing::ReadFile(testing::SourcePath("primitives/tasks/nominal/handstand.toml")),
               "../../robots/tumbler.urdf", "robot.urdf"));
  Task task = LoadTask(folder / "task.toml");
  const SolveOutcome outcome = Solve(task.problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  const Solution& solution = outcome.solutions.front();
  ASSERT_TRUE(solution.feasible());

  const SecondLook look = LookAgain(task.problem, solution.x);
  for (const PurposeFigure& figure : look.purpose) EXPECT_TRUE(figure.met()) << figure.name();
  EXPECT_FALSE(look.acceptable());
  EXPECT_THAT(look.Objections(), HasSubstr("through drives of 200 N m/rad and 4 N m s/rad, the "
                                           "robot is not where it is asked to be"));

  // What is refused falls.
  RobustnessStudy study;
  study.motion = folder / "motion.toml";
  study.scale = 0;
  study.run.hold_s = 20;
  testing::WriteFile(study.motion, ToToml(MakePrimitiveFile(task, outcome, solution)));
  EXPECT_EQ(Trials(study).Play(0).verdict, TrialOutcome::Verdict::kFell);
}

TEST(DrivenMotion, AStepThatLandsOnAnEdgeIsRefusedThoughItStandsOnSlopingFloors) {
  const PrimitiveFile file =
      LoadPrimitive(testing::SourcePath("tests/data/primitives/step_onto_an_edge.toml"));
  const Problem problem = TaskOf(file).problem;
  const SecondLook look = LookAgain(problem, testing::FreeControlPoints(file.primitive));
  for (const PurposeFigure& figure : look.purpose) EXPECT_TRUE(figure.met()) << figure.name();
  ASSERT_TRUE(look.leaving);
  EXPECT_EQ(look.leaving->disturbance.slope_rad, 0) << "it stands on those floors";
  EXPECT_THAT(look.Objections(), ::testing::StartsWith("from a start that leans by"));
}

TEST(DrivenMotion, TheDrivesAreThoseOfTheTaskAndGoIntoThePrimitive) {
  const std::string text =
      testing::ReadFile(testing::SourcePath("primitives/tasks/nominal/handstand.toml"));
  const auto parse = [&](const std::string& added) {
    return ParseTask(text + added, "task.toml", testing::ShippedRobot(), "robot.urdf");
  };
  EXPECT_EQ(parse("").problem.drive_gains(), (DriveGains{200, 4}));
  EXPECT_EQ(parse("\n[robust]\nkp_nm_per_rad = 60\n").problem.drive_gains(), (DriveGains{60, 5}));
  const Task soft = parse("\n[drives]\nkp_nm_per_rad = 10\nkd_nm_s_per_rad = 1\n");

  const PrimitiveFile nominal =
      LoadPrimitive(testing::SourcePath("primitives/nominal/handstand.toml"));
  EXPECT_FALSE(nominal.drives);
  Solution solution;
  solution.x = testing::FreeControlPoints(nominal.primitive);
  const PrimitiveFile made = MakePrimitiveFile(soft, {}, solution);
  ASSERT_TRUE(made.drives);
  EXPECT_EQ(*made.drives, (DriveGains{10, 1}));
  EXPECT_TRUE(LookAgain(parse("").problem, solution.x).acceptable());
  EXPECT_THAT(LookAgain(soft.problem, solution.x).Objections(),
              HasSubstr("through drives of 10 N m/rad and 1 N m s/rad"));
}

}  // namespace
}  // namespace tumbler
