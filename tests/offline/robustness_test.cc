// Robots that differ from the model: what is drawn, how each is played, and what is said of them.

#include "offline/rehearsal/robustness/study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <set>
#include <string>

#include "common/json.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;

const PlanarRobot& Tumbler() {
  static const PlanarRobot robot = LoadTumbler();
  return robot;
}

RobustnessStudy StudyOf(const std::string& motion) {
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/" + motion);
  return study;
}

std::string Written(const testing::TemporaryFolder& folder, const std::string& name,
                    const std::string& text) {
  const std::string path = folder / name;
  testing::WriteFile(path, text);
  return path;
}

TEST(Variation, ARobotDependsOnSeedAndNumberAlone) {
  const RobotVariation a = DrawRobot(Tumbler(), {}, 1, 5, 7);
  const RobotVariation b = DrawRobot(Tumbler(), {}, 1, 5, 7);
  EXPECT_EQ(a.friction, b.friction);
  EXPECT_EQ(a.links[2].mass, b.links[2].mass);
  std::set<double> seen;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    for (std::uint64_t index = 0; index < 20; ++index)
      seen.insert(DrawRobot(Tumbler(), {}, 1, seed, index).links[0].mass);
  }
  EXPECT_EQ(seen.size(), 400U);
}

TEST(Variation, RobotsHaveTheSpreadsThatWereAskedFor) {
  const Spreads spreads{.mass = 0.05, .length = 0.01, .friction = 0.2, .slope_rad = 0.02};
  double mass = 0, length = 0, friction = 0, slope = 0, product = 0;
  constexpr int kRobots = 4000;
  for (int i = 0; i < kRobots; ++i) {
    const RobotVariation v = DrawRobot(Tumbler(), spreads, 1, 1, static_cast<std::uint64_t>(i));
    mass += std::pow(v.links[1].mass - 1, 2);
    length += std::pow(v.links[1].length - 1, 2);
    friction += std::pow(v.friction - 1, 2);
    slope += std::pow(v.slope_rad, 2);
    product += (v.links[1].mass - 1) * (v.links[2].mass - 1);
  }
  // The relative standard error of such a standard deviation is 1.1 %.
  EXPECT_NEAR(std::sqrt(mass / kRobots), 0.05, 0.002);
  EXPECT_NEAR(std::sqrt(length / kRobots), 0.01, 0.0004);
  EXPECT_NEAR(std::sqrt(friction / kRobots), 0.2, 0.008);
  EXPECT_NEAR(std::sqrt(slope / kRobots), 0.02, 0.0008);
  EXPECT_NEAR(product / kRobots, 0, 4 * 0.05 * 0.05 / std::sqrt(kRobots));
}

TEST(Variation, AFactorStaysAboveZeroHoweverWideTheSpread) {
  for (std::uint64_t i = 0; i < 500; ++i) {
    const RobotVariation v = DrawRobot(Tumbler(), {.mass = 0.9, .friction = 1}, 3, 1, i);
    EXPECT_GE(v.friction, 0.05);
    EXPECT_GE(v.links[0].mass, 0.05);
  }
}

TEST(Variation, AVariedSceneHasTheRobotInEveryPart) {
  const Scene scene = HandstandProblem().scene;
  RobotVariation v = DrawRobot(scene.robot, {}, 0, 1, 0);
  EXPECT_EQ(Varied(scene, v).contact, scene.contact);
  v.links[0].length = 1.1;
  v.links[1] = {.mass = 1.2, .inertia = 1.5, .length = 0.9, .mass_centre_m = 0.01};
  v.friction = 0.5;
  v.slope_rad = 0.1;
  const Scene varied = Varied(scene, v);
  const auto& before = scene.robot.tree.dofs;
  const auto& after = varied.robot.tree.dofs;
  EXPECT_DOUBLE_EQ(after[3].mass_kg, 1.2 * before[3].mass_kg);
  EXPECT_DOUBLE_EQ(after[3].inertia_kg_m2, 1.8 * before[3].inertia_kg_m2);
  EXPECT_DOUBLE_EQ(after[3].mass_centre.x(), 0.9 * before[3].mass_centre.x() + 0.01);
  EXPECT_DOUBLE_EQ(after[3].offset.x(), 1.1 * before[3].offset.x()) << "the middle link's length";
  EXPECT_DOUBLE_EQ(after[4].mass_kg, before[4].mass_kg);
  ASSERT_FALSE(scene.robot.own_shapes.empty());
  for (std::size_t i = 0; i < scene.robot.own_shapes.size(); ++i) {
    const OwnShape& own = scene.robot.own_shapes[i];
    const double length = v.links[static_cast<std::size_t>(own.body) - 2].length;
    EXPECT_DOUBLE_EQ(varied.robot.own_shapes[i].shape.centre.x(), length * own.shape.centre.x())
        << "the distance from itself is that of the varied robot: " << own.name;
  }
  EXPECT_DOUBLE_EQ(varied.contact.mu, 0.5 * scene.contact.mu);
  // Uphill to the right, the robot is drawn to the left.
  EXPECT_DOUBLE_EQ(varied.robot.tree.gravity.norm(), scene.robot.tree.gravity.norm());
  EXPECT_NEAR(varied.robot.tree.gravity.x(), scene.robot.tree.gravity.y() * std::sin(0.1), 1e-12);
}

TEST(Share, TheIntervalIsThatOfWilson) {
  const Share share = ShareOf(97, 100);  // [W27]; R's binom.confint gives the same
  EXPECT_NEAR(share.low, 0.9155, 5e-4);
  EXPECT_NEAR(share.high, 0.9897, 5e-4);
  EXPECT_EQ(ShareOf(10, 10).high, 1);
  EXPECT_NEAR(ShareOf(10, 10).low, 0.7225, 5e-4);
  EXPECT_EQ(ShareOf(0, 10).low, 0);
}

TEST(Trials, TheModelItselfStandsAfterTheShippedHandstand) {
  RobustnessStudy study = StudyOf("handstand.toml");
  study.scale = 0;
  Trials trials(study);
  const TrialOutcome outcome = trials.Play(0);
  EXPECT_EQ(outcome.verdict, Verdict::kStands) << outcome.reason;
  EXPECT_EQ(outcome.motions, 1);
}

TEST(Trials, RobotsThatTheShippedHandstandLosesStandAfterTheRobustOne) {
  RobustnessStudy nominal = StudyOf("handstand.toml");
  RobustnessStudy robust = StudyOf("robust/handstand.toml");
  robust.drives = testing::SourcePath("primitives/robust/drives.toml");
  nominal.seed = robust.seed = 31;
  const RobustnessResult lost = RunStudy(nominal, 8, 1), kept = RunStudy(robust, 8, 1);
  EXPECT_LE(lost.stands().count, 4);
  EXPECT_GE(kept.stands().count, 7);
}

TEST(Trials, TheModelGoesThroughACycleOfTheRobustGait) {
  RobustnessStudy study = StudyOf("robust/gait.toml");
  study.drives = testing::SourcePath("primitives/robust/drives.toml");
  study.scale = 0;
  study.run.cycles = 1;
  const TrialOutcome outcome = Trials(study).Play(0);
  EXPECT_EQ(outcome.verdict, Verdict::kStands) << outcome.in << ": " << outcome.reason;
  EXPECT_EQ(outcome.motions, 2);
}

TEST(Trials, ARobotWithoutFrictionFallsAndTheNodeIsNamed) {
  RobustnessStudy study = StudyOf("handstand.toml");
  const testing::TemporaryFolder folder;
  study.twin =
      Written(folder, "ice.toml", "format = \"tumbler-twin\"\nversion = 1\n[contact]\nmu = 0.01\n");
  study.scale = 0;
  Trials trials(study);
  const TrialOutcome outcome = trials.Play(0);
  EXPECT_EQ(outcome.verdict, Verdict::kFell);
  EXPECT_EQ(outcome.in, "handstand");
  EXPECT_FALSE(outcome.reason.empty());
}

TEST(Trials, MotorsThatGiveAlmostNothingAreAFaultOrAFall) {
  RobustnessStudy study = StudyOf("handstand.toml");
  const testing::TemporaryFolder folder;
  study.twin = Written(folder, "weak.toml",
                       "format = \"tumbler-twin\"\nversion = 1\n[motor]\ntorque_max_nm = 0.3\n");
  study.scale = 0;
  EXPECT_NE(Trials(study).Play(0).verdict, Verdict::kStands);
}

TEST(RobustnessStudy, ThreadsChangeNotAByte) {
  const RobustnessStudy study = StudyOf("handstand.toml");
  const RobustnessResult one = RunStudy(study, 6, 1);
  const RobustnessResult three = RunStudy(study, 6, 3);
  EXPECT_EQ(ToJson(one).Dump(2), ToJson(three).Dump(2));
  EXPECT_EQ(ToText(one), ToText(three));
  EXPECT_EQ(static_cast<int>(one.trials.size()), 6);
  // A robot is the same in a larger study.
  Trials trials(study);
  EXPECT_EQ(trials.Play(4).verdict, one.trials[4].verdict);
}

TEST(RobustnessStudy, WhatFailuresHaveInCommonComesFirst) {
  RobustnessResult result;
  for (std::uint64_t i = 0; i < 400; ++i) {
    TrialOutcome trial;
    trial.variation = DrawRobot(Tumbler(), {}, 1, 3, i);
    if (trial.variation.friction < 0.75) trial.verdict = Verdict::kFell;
    result.trials.push_back(trial);
  }
  const auto influences = result.Influences();
  ASSERT_FALSE(influences.empty());
  EXPECT_EQ(influences.front().name, "friction");
  EXPECT_LT(influences.front().mean_sigma, -1.2);
  EXPECT_GT(influences.front().significance, 3);
  EXPECT_LT(influences[1].significance, 3.5);
}

TEST(RobustnessProgram, PrintsShareAndIntervalAndWritesThem) {
  const testing::TemporaryFolder folder;
  const std::string json_file = folder / "figures.json";
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler-robustness", testing::SourcePath("primitives/handstand.toml"),
                           "--robots", "1", "--scale", "0", "--json", json_file});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("1 of 1 robots are as asked"), std::string::npos) << outcome.text;
  const std::optional<Json> json = Json::Parse(testing::ReadFile(json_file));
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["robots"].number(), 1);
  EXPECT_EQ((*json)["stand"].number(), 1);
  EXPECT_EQ((*json)["spreads"]["mass"].number(), 0.05);
}

TEST(RobustnessProgram, AGaitWithoutCyclesIsRefused) {
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler-robustness", testing::SourcePath("primitives/gait.toml")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("--cycles"), std::string::npos) << outcome.text;
}

}  // namespace
}  // namespace tumbler
