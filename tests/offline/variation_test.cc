// Robots that differ from the model: what is drawn.

#include "offline/scene/variation.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/task_toml.h"
#include "offline/studies/study.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"
#include "tests/support/robustness_study.h"

namespace tumbler {
namespace {

TEST(Variation, ARobotDependsOnSeedAndNumberAlone) {
  const RobotVariation a = DrawRobot(TumblerScene(), {}, 1, 5, 7);
  const RobotVariation b = DrawRobot(TumblerScene(), {}, 1, 5, 7);
  EXPECT_EQ(a.friction, b.friction);
  EXPECT_EQ(a.links[2].mass, b.links[2].mass);
  std::set<double> seen;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    for (std::uint64_t index = 0; index < 20; ++index)
      seen.insert(DrawRobot(TumblerScene(), {}, 1, seed, index).links[0].mass);
  }
  EXPECT_EQ(seen.size(), 400U);
}

TEST(Variation, RobotsHaveTheSpreadsThatWereAskedFor) {
  const Spreads spreads{.mass = 0.05, .length = 0.01, .friction = 0.2, .slope_rad = 0.02};
  double mass = 0, length = 0, friction = 0, slope = 0, product = 0;
  constexpr int kRobots = 4000;
  for (int i = 0; i < kRobots; ++i) {
    const RobotVariation v =
        DrawRobot(TumblerScene(), spreads, 1, 1, static_cast<std::uint64_t>(i));
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
    const RobotVariation v = DrawRobot(TumblerScene(), {.mass = 0.9, .friction = 1}, 3, 1, i);
    EXPECT_GE(v.friction, 0.05);
    EXPECT_GE(v.links[0].mass, 0.05);
  }
}

/// Friction, stiffness and damping of many robots, as they are on their ground.
std::vector<ContactLaw> GroundsOf(const Spreads& spreads, double scale) {
  std::vector<ContactLaw> grounds;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const RobotVariation v = DrawRobot(TumblerScene(), spreads, scale, 3, i);
    grounds.push_back(Varied(TumblerScene(), v).contact);
  }
  return grounds;
}

TEST(Variation, ARangeOfFrictionIsUniformAndOneOfStiffnessIsSoInItsLogarithm) {
  const Spreads spreads{.friction = GroundSpread::Between{0.15, 1},
                        .stiffness = GroundSpread::Between{1e4, 1e6},
                        .damping = GroundSpread::EitherWay{10}};
  const double damping = TumblerScene().contact.damping_n_s_per_m;
  double mu = 0, stiffness = 0, either = 0, square = 0;
  int robots = 0;
  for (const ContactLaw& ground : GroundsOf(spreads, 1)) {
    EXPECT_GE(ground.mu, 0.15 - 1e-12);
    EXPECT_LE(ground.mu, 1 + 1e-12);
    EXPECT_GE(ground.stiffness_n_per_m, 1e4 * (1 - 1e-12));
    EXPECT_LE(ground.stiffness_n_per_m, 1e6 * (1 + 1e-12));
    const double tens = std::log10(ground.damping_n_s_per_m / damping);
    EXPECT_LE(std::abs(tens), 1 + 1e-12);
    mu += ground.mu;
    stiffness += std::log10(ground.stiffness_n_per_m);
    either += tens;
    square += tens * tens;
    ++robots;
  }
  // The means' standard errors are 0.0055, 0.013 and 0.013.
  EXPECT_NEAR(mu / robots, 0.575, 0.02);
  EXPECT_NEAR(stiffness / robots, 5, 0.045);
  EXPECT_NEAR(either / robots, 0, 0.045);
  EXPECT_NEAR(square / robots, 1.0 / 3, 0.03);
}

TEST(Variation, TheScaleOfARangeIsOfFactorsAroundTheModelWhichHasNone) {
  const Spreads spreads{.friction = GroundSpread::Between{0.15, 1},
                        .stiffness = GroundSpread::EitherWay{4}};
  const std::vector<ContactLaw> once = GroundsOf(spreads, 1), twice = GroundsOf(spreads, 2);
  const ContactLaw model = TumblerScene().contact;
  for (const ContactLaw& ground : GroundsOf(spreads, 0)) EXPECT_EQ(ground, model);
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_NEAR(twice[i].mu, once[i].mu * once[i].mu / model.mu, 1e-9);
    EXPECT_NEAR(std::log(twice[i].stiffness_n_per_m / model.stiffness_n_per_m),
                2 * std::log(once[i].stiffness_n_per_m / model.stiffness_n_per_m), 1e-9);
  }
}

TEST(Variation, ARangeTellsHowFarFromItsMiddleInStandardDeviations) {
  const Spreads spreads{
      .mass = 0, .friction = GroundSpread::EitherWay{3}, .stiffness = 0, .damping = 0};
  double square = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const RobotVariation v = DrawRobot(TumblerScene(), spreads, 1, 3, i);
    ASSERT_EQ(v.deviates.size(), 1U);
    EXPECT_EQ(v.deviates[0].name, "friction");
    EXPECT_NEAR(std::log(v.friction) / std::log(3.0), v.deviates[0].sigma / std::sqrt(3.0), 1e-12);
    square += v.deviates[0].sigma * v.deviates[0].sigma;
  }
  EXPECT_NEAR(square / 2000, 1, 0.08);
}

TEST(GroundSpread, ReadsWhatItWritesAndRefusesTheRest) {
  for (const GroundSpread& spread :
       {GroundSpread(0.25), GroundSpread(GroundSpread::Between{0.15, 1}),
        GroundSpread(GroundSpread::EitherWay{10})}) {
    EXPECT_EQ(ParseGroundSpread(ToText(spread)), spread) << ToText(spread);
    EXPECT_EQ(MistakeIn(spread, kFrictionSpreadLimits), "") << ToText(spread);
  }
  for (const char* text : {"", "x", "..", "0.2..", "..1", "0.2..1..2", "x2x", "0.2 ", "1,5"})
    EXPECT_FALSE(ParseGroundSpread(text)) << text;
  for (const char* text :
       {"-0.1", "1.1", "nan", "0..1", "1..0.2", "0.2..11", "x1", "x101", "xnan"}) {
    const std::optional<GroundSpread> read = ParseGroundSpread(text);
    ASSERT_TRUE(read) << text;
    EXPECT_THAT(MistakeIn(*read, kFrictionSpreadLimits), HasSubstr("allowed: a number from 0 to 1"))
        << text;
  }
}

TEST(GroundSpread, HardGroundTakesFinerStepsInLanes) {
  const ContactLaw model = TumblerScene().contact;
  EXPECT_EQ(FinerStepsFor(model, {}, 2), 1) << "as ever";
  EXPECT_EQ(FinerStepsFor(model, {.stiffness = GroundSpread::EitherWay{10}}, 1), 2);
  EXPECT_EQ(FinerStepsFor(model, {.damping = GroundSpread::EitherWay{10}}, 1), 4);
  EXPECT_EQ(FinerStepsFor(model, {.friction = GroundSpread::EitherWay{10}}, 1), 1);
}

TEST(Variation, AVariedSceneHasTheRobotInEveryPart) {
  const Scene scene = HandstandProblem().scene;
  RobotVariation v = DrawRobot(scene, {}, 0, 1, 0);
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

TEST(Variation, OfARobotThatIsFixedToTheWorldIsInWhatMoves) {
  const Scene scene = LoadTask(testing::SourcePath("tests/data/tasks/arm.toml")).problem.scene;
  ASSERT_EQ(scene.robot.root_dofs, 0);
  const Spreads more{.length = 0.1, .start_rad = 0.02, .start_rate_rad_s = 0.5};
  const RobotVariation v = DrawRobot(scene, more, 1, 1, 0);
  ASSERT_EQ(v.links.size(), 1U);
  EXPECT_EQ(v.StartPositions(scene.robot), std::vector<double>{v.joints[0].start_rad});
  EXPECT_EQ(v.StartRates(scene.robot), std::vector<double>{v.joints[0].start_rate_rad_s});
  const Scene varied = Varied(scene, v);
  const Dof<Plane>& before = scene.robot.tree.dofs[0];
  const Dof<Plane>& after = varied.robot.tree.dofs[0];
  EXPECT_NE(after.mass_kg, before.mass_kg);
  EXPECT_DOUBLE_EQ(after.mass_kg, v.links[0].mass * before.mass_kg);
  EXPECT_EQ(after.offset, before.offset) << "the wall and its joint are where they were";
  ASSERT_FALSE(scene.robot.own_shapes.empty());
  for (std::size_t i = 0; i < scene.robot.own_shapes.size(); ++i) {
    const OwnShape& own = scene.robot.own_shapes[i];
    EXPECT_DOUBLE_EQ(varied.robot.own_shapes[i].shape.centre.x(),
                     (own.body < 0 ? 1 : v.links[0].length) * own.shape.centre.x())
        << own.name;
  }
}

TEST(Variation, WhatJointsDelayAndStartHaveOfItLeavesTheRestOfTheRobotAsItIs) {
  const RobotVariation plain = DrawRobot(TumblerScene(), {}, 1, 5, 7);
  const Spreads more{.delay_s = 1e-4, .zero_rad = 0.01, .start_rad = 0.02, .start_rate_rad_s = 0.5};
  double late = 0;
  for (std::uint64_t i = 0; i < 50; ++i) {
    const RobotVariation v = DrawRobot(TumblerScene(), more, 1, 5, i);
    EXPECT_GE(v.delay_s, 0) << "no setpoint is early";
    late += v.delay_s / 50;
    if (i != 7) continue;
    EXPECT_EQ(v.links[1].mass, plain.links[1].mass);
    EXPECT_EQ(v.damping, plain.damping);
    EXPECT_NE(v.joints[0].zero_rad, v.joints[1].zero_rad);
    EXPECT_EQ(v.StartPositions(Tumbler())[2], 0) << "joints alone are elsewhere";
    EXPECT_EQ(v.StartPositions(Tumbler())[4], v.joints[1].start_rad);
    EXPECT_EQ(v.StartRates(Tumbler())[2], v.start_pitch_rate_rad_s);
    EXPECT_EQ(v.deviates.size(), plain.deviates.size() + 8);
  }
  EXPECT_NEAR(late, 0.8e-4, 0.3e-4);
}

}  // namespace
}  // namespace tumbler
