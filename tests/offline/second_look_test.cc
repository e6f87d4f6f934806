// The second look at a motion: what a finer simulation makes of it, and whether it does what its
// task asks for.

#include "offline/certify/second_look.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "common/files/sequence_toml.h"
#include "offline/problem/simulated_motion.h"
#include "offline/problem/task_toml.h"
#include "offline/solve/rollout.h"
#include "offline/solve/solver.h"
#include "tests/support/crossing_legs.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::QuickTask;
using testing::Replaced;
using testing::ShippedRobot;

Problem ProblemOf(const std::string& task) {
  return ParseTask(task, "task.toml", ShippedRobot(), "robot.urdf").problem;
}

/// The legs go straight from start to end.
std::vector<double> Straight(const Problem& problem) {
  std::vector<double> x;
  for (const ActuatedJoint& joint : problem.joints) {
    const int free = joint.free_points();
    for (int i = 1; i <= free; ++i)
      x.push_back(joint.start_rad + i * (joint.end_rad - joint.start_rad) / (free + 1));
  }
  return x;
}

TEST(SecondLook, HoldsEachTargetBesideItsResultAlsoTwoSecondsLater) {
  const Problem problem = ProblemOf(QuickTask());
  const SecondLook look = LookAgain(problem, Straight(problem));
  std::vector<std::string> names;
  for (const PurposeFigure& figure : look.purpose) names.push_back(figure.name());
  EXPECT_THAT(names,
              ::testing::ElementsAre("pitch, settled", "pitch, 2 s later", "pitch_rate, 2 s later",
                                     "speed of the root, 2 s later"));
  EXPECT_TRUE(look.acceptable()) << look.Objections();
  EXPECT_EQ(look.Objections(), "");
}

TEST(SecondLook, AMotionThatHardlyMovesTheRobotMissesATargetFarAway) {
  const Problem problem = ProblemOf(Replaced(QuickTask(), "target = 0.0", "target = 1.5"));
  const SecondLook look = LookAgain(problem, Straight(problem));
  EXPECT_FALSE(look.acceptable());
  EXPECT_THAT(look.Objections(), HasSubstr("pitch, settled: asked 1.5, got "));
  EXPECT_THAT(look.Objections(), HasSubstr("rad (within 0.05)"));
}

TEST(SecondLook, AToleranceOfTheTaskDecides) {
  const auto met = [](const std::string& tolerance) {
    const Problem problem =
        ProblemOf(Replaced(QuickTask(), "target = 0.0", "target = 1.5\ntolerance = " + tolerance));
    return LookAgain(problem, Straight(problem)).acceptable();
  };
  EXPECT_FALSE(met("1.3"));
  EXPECT_TRUE(met("1.7"));
}

TEST(SecondLook, TermsWithoutWeightOrTargetAskForNothing) {
  std::string text = Replaced(QuickTask(), "weight = 10.0", "weight = 0.0");
  text = Replaced(text, "target = 0.0", "target = 1.5");
  const Problem problem = ProblemOf(text);
  const SecondLook look = LookAgain(problem, Straight(problem));
  ASSERT_EQ(look.purpose.size(), 2U);
  EXPECT_EQ(look.purpose[0].name(), "pitch_rate, 2 s later");
  EXPECT_TRUE(look.acceptable()) << look.Objections();
}

TEST(SecondLook, AMotionThatIsNotToEndAtRestIsNotAskedToRest) {
  const Problem problem = ProblemOf(
      Replaced(QuickTask(), "when = \"settled\"\nweight = 1.0", "when = \"end\"\nweight = 1.0"));
  EXPECT_FALSE(EndsAtRest(problem));
  for (const PurposeFigure& figure : LookAgain(problem, Straight(problem)).purpose)
    EXPECT_THAT(figure.name(), ::testing::Not(HasSubstr("later")));
}

/// A robot of 1.8 kg with its mass 0.35 m above a foot falls with m g h = 6 N m/rad. Two contacts
/// of k = 25 kN/m resist that with 2 k b^2, which is 5 N m/rad where they are b = 10 mm from the
/// middle, and 80 N m/rad with the 40 mm of the shipped robot.
TEST(SecondLook, ARobotThatBalancesOnItsFootForAWhileDoesNotStay) {
  std::string robot = ShippedRobot();
  const auto origin = [](double x, double z) {
    return fmt::format("<origin xyz=\"{:.2f} 0 {:.2f}\"/>", x, z);
  };
  for (const double x : {0.2, -0.2}) {
    for (const double side : {1, -1})
      robot = Replaced(robot, origin(x, 0.04 * side), origin(x, 0.01 * side));
  }
  const std::string task =
      testing::ReadFile(testing::SourcePath("primitives/tasks/nominal/handstand.toml"));
  Problem problem = ParseTask(task, "task.toml", robot, "robot.urdf").problem;
  problem.search.seed = 1;
  const SolveOutcome outcome = Solve(problem, {});
  ASSERT_FALSE(outcome.solutions.empty());
  ASSERT_TRUE(outcome.solutions.front().feasible());
  const SecondLook look = LookAgain(problem, outcome.solutions.front().x);
  for (const PurposeFigure& figure : look.purpose) EXPECT_TRUE(figure.met()) << figure.name();
  ASSERT_TRUE(look.leaving);
  EXPECT_GE(look.leaving->after_s, 2);
  EXPECT_LT(look.leaving->after_s, kStays_s);
  EXPECT_EQ(look.leaving->figure.of, PurposeTarget::Of::kPitch);
  EXPECT_FALSE(look.leaving->figure.met());
  EXPECT_FALSE(look.acceptable());
  EXPECT_THAT(look.Objections(), HasSubstr("the robot is not where it is asked to be 2.0 s after"));
}

TEST(SecondLook, SaysWhatARobotLeavesWithWhichDisturbanceAndThroughWhichDrives) {
  SecondLook look;
  look.drives = {60, 5};
  look.leaving = {2.5, {{.target = 1.5, .tolerance = 0.05}, 1.25}, {.lean_rad = -5e-4}};
  EXPECT_FALSE(look.acceptable());
  EXPECT_EQ(
      look.Objections(),
      "from a start that leans by -0.5 mrad and through drives of 60 N m/rad and 5 N m s/rad, "
      "the robot is not where it is asked to be 2.5 s after the end: pitch: asked 1.5, got "
      "1.25 rad (within 0.05)");
  look.leaving->disturbance = {.slope_rad = 2e-3};
  EXPECT_THAT(look.Objections(), HasSubstr("on a floor that slopes by 2 mrad and through drives"));
  look.drives.reset();
  EXPECT_THAT(look.Objections(), ::testing::StartsWith("the robot is not where"));
}

TEST(SecondLook, FindsTheLegsNearestApproachThatGeometryByHandFinds) {
  // Both legs are 0.2 m long and hang on joints 0.3 m apart; at home they are parallel, and each
  // foot has spheres of 10 mm 40 mm to either side.
  const Problem problem = ProblemOf(Replaced(
      QuickTask(), "[[obstacle]]", "[self_contact]\nshapes = \"collision\"\n[[obstacle]]"));
  std::vector<double> x;
  for (const ActuatedJoint& joint : problem.joints)
    x.insert(x.end(), static_cast<std::size_t>(joint.free_points()), joint.start_rad);
  const SecondLook look = LookAgain(problem, x);
  // The legs end 1.2 and 1.3 rad from straight out, which is where the feet are farthest apart;
  // while they hang straight down, the inner spheres are 0.3 - 2 * 0.04 - 2 * 0.01 apart.
  EXPECT_NEAR(look.self_clearance_m, 0.2, 1e-6);
  EXPECT_THAT(look.self_clearance_of,
              ::testing::AllOf(HasSubstr("leg1_link"), HasSubstr("leg2_link")));
}

TEST(SecondLook, SeesLegsThatPassThroughEachOther) {
  Problem problem = ProblemOf(QuickTask());
  std::vector<double> x;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    // Both legs swing inwards, until they cross.
    const double inwards = problem.joints[j].start_rad > 0 ? 2.6 : -2.6;
    x.insert(x.end(), static_cast<std::size_t>(problem.joints[j].free_points()), inwards);
  }
  const SecondLook look = LookAgain(problem, x);
  EXPECT_LT(look.self_clearance_m, 0);
  EXPECT_GT(look.self_clearance_time_s, 0);
  EXPECT_LT(look.self_clearance_time_s, problem.duration_s);
}

/// The second look at a shipped primitive, from the texts that it carries.
SecondLook LookAtShipped(const std::string& name, double refinement = kRefinement) {
  const std::string path = testing::SourcePath("primitives/" + name + ".toml");
  const SimulatedMotion motion(LoadMotion(path));
  const Problem& problem = motion.ProblemOf(0);
  const PrimitiveFile file = LoadPrimitive(path);
  return LookAgain(problem, testing::FreeControlPoints(file.primitive), refinement);
}

TEST(SecondLook, NominalMotionsDoWhatTheirTasksAskFor) {
  for (const std::string name : {"handstand", "downstand", "roll"}) {
    const SecondLook look = LookAtShipped("nominal/" + name);
    EXPECT_TRUE(look.acceptable()) << name << ": " << look.Objections();
    const PrimitiveFile file =
        LoadPrimitive(testing::SourcePath("primitives/nominal/" + name + ".toml"));
    ASSERT_EQ(file.purpose.size(), look.purpose.size()) << name;
    for (std::size_t i = 0; i < look.purpose.size(); ++i) {
      EXPECT_EQ(file.purpose[i].name(), look.purpose[i].name()) << name;
      EXPECT_EQ(file.purpose[i].target, look.purpose[i].target) << name;
      EXPECT_EQ(file.purpose[i].tolerance, look.purpose[i].tolerance) << name;
      EXPECT_NEAR(file.purpose[i].result, look.purpose[i].result, 1e-6) << name;
    }
  }
}

TEST(SecondLook, ShippedMotionsKeepTorquesAndClearanceAtAStep64TimesFiner) {
  for (const char* name :
       {"handstand", "handstand_wide", "handstand_sensor", "handstand_sensor_mirrored", "downstand",
        "downstand_back", "downstand_back_mirrored", "roll", "roll_sensor", "stand", "rise",
        "rise_from_leg1", "rise_from_leg2", "nominal/handstand", "nominal/downstand",
        "nominal/roll"}) {
    const SecondLook look = LookAtShipped(name, 64);
    EXPECT_LT(look.peak_torque_nm, 8.0) << name;
    EXPECT_LT(look.torque_excess, 0) << name;
    EXPECT_GE(look.clearance_m, 0.005) << name;
    EXPECT_GE(look.self_clearance_m, look.clearance_m) << name << ": " << look.self_clearance_of;
  }
}

TEST(SecondLook, RefusesARollWhoseLegsGoThroughEachOther) {
  const Problem problem = LoadTask(testing::SourcePath("tests/data/tasks/long_roll.toml")).problem;
  const SecondLook look = LookAgain(problem, CrossingRoll());
  EXPECT_NEAR(look.self_clearance_m, -0.01928, 1e-5);
  EXPECT_NEAR(look.self_clearance_time_s, 0.6125, 1e-3);
  EXPECT_FALSE(look.acceptable());
  EXPECT_THAT(look.Objections(),
              HasSubstr("the robot's own shapes leg1_link/1 and leg2_link/0 overlap by 19.3 mm at "
                        "0.61"));
}

TEST(SecondLook, RefusesShapesThatComeNearerThanTheClearance) {
  SecondLook look;
  look.clearance_m = 0.005;
  look.self_clearance_m = 0.0051;
  look.self_clearance_of = "a and b";
  look.self_clearance_time_s = 0.25;
  EXPECT_TRUE(look.acceptable());
  look.self_clearance_m = 0.0049;
  EXPECT_FALSE(look.acceptable());
  EXPECT_EQ(look.Objections(),
            "the robot's own shapes a and b come as near as 4.9 mm at 0.250 s, and have to stay "
            "5 mm apart");
}

TEST(SecondLook, RefusesATorqueAboveItsLimitAndAContactThroughTheLayer) {
  SecondLook look;
  look.layer_m = 0.006;
  look.torque_excess = -0.001;
  look.peak_penetration_m = 0.0059;
  EXPECT_TRUE(look.acceptable());
  look.torque_excess = 0.015;
  EXPECT_FALSE(look.acceptable());
  EXPECT_EQ(look.Objections(), "a torque is 1.5 % above its limit");
  look.torque_excess = 0.66;
  EXPECT_FALSE(look.acceptable());
  EXPECT_EQ(look.Objections(), "a torque is 66 % above its limit");
  look.torque_excess = -0.1;
  look.peak_penetration_m = 0.00646;
  EXPECT_FALSE(look.acceptable());
  EXPECT_EQ(look.Objections(), "a contact goes 6.46 mm deep, through the layer of 6.00 mm");
}

TEST(SecondLook, ASettlePhaseThatIsLongerThanTheLookGoesOnIsJudgedAtItsEndOnly) {
  const Problem problem = ProblemOf(Replaced(QuickTask(), "settle_s = 0.1", "settle_s = 3.0"));
  std::vector<std::string> names;
  for (const PurposeFigure& figure : LookAgain(problem, Straight(problem)).purpose)
    names.push_back(figure.name());
  EXPECT_THAT(names, ::testing::ElementsAre("pitch, settled", "pitch_rate, settled",
                                            "speed of the root, settled"));
}

TEST(SecondLook, AResultThatIsNotANumberMisses) {
  PurposeFigure figure;
  figure.tolerance = 10;
  EXPECT_TRUE(figure.met());
  figure.result = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(figure.met());
}

TEST(SecondLook, SeesTheTorqueOfAnImpactAtLeastAsWellAsTheSolversStep) {
  // The finer step has all instants of the solver's among its own, up to its own error.
  const Problem problem = ProblemOf(QuickTask());
  const std::vector<double> x = Straight(problem);
  double coarse = 0;
  Rollout(problem, problem.solver.step_s).Visit(x, 0, [&](const MotionSample& sample) {
    for (const double torque : sample.torque) coarse = std::max(coarse, std::abs(torque));
  });
  EXPECT_GT(LookAgain(problem, x).peak_torque_nm, 0.99 * coarse);
}

}  // namespace
}  // namespace tumbler
