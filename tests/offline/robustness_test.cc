// Robots that differ from the model: what is drawn, how each is played, and what is said of them.

#include "offline/studies/study.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <functional>
#include <numeric>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/toml_reader.h"
#include "offline/problem/task_toml.h"
#include "offline/studies/certify.h"
#include "offline/studies/checkpoint.h"
#include "offline/studies/drop.h"
#include "offline/studies/lane_trials.h"
#include "offline/studies/look_ticks.h"
#include "offline/studies/robustness_page.h"
#include "tests/support/files.h"
#include "tests/support/handstand.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;
using ::testing::HasSubstr;

const Scene& TumblerScene() {
  static const Scene scene = HandstandProblem().scene;
  return scene;
}
const PlanarRobot& Tumbler() { return TumblerScene().robot; }

RobustnessStudy StudyOf(const std::string& motion) {
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/" + motion);
  return study;
}

/// With the drives of the example that have a sensor, and what that sensor does wrong.
RobustnessStudy SensorStudyOf(const std::string& motion) {
  RobustnessStudy study = StudyOf(motion);
  study.drives = testing::SourcePath("primitives/robots/tumbler_drives_sensor.toml");
  study.twin = testing::SourcePath("primitives/robots/tumbler_twin_sensor.toml");
  return study;
}

std::string Written(const testing::TemporaryFolder& folder, const std::string& name,
                    const std::string& text) {
  std::string path = folder / name;
  testing::WriteFile(path, text);
  return path;
}

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

TEST(Share, TheIntervalIsThatOfWilson) {
  const Share share = ShareOf(97, 100);  // [W27]; R's binom.confint gives the same
  EXPECT_NEAR(share.low, 0.9155, 5e-4);
  EXPECT_NEAR(share.high, 0.9897, 5e-4);
  EXPECT_EQ(ShareOf(10, 10).high, 1);
  EXPECT_NEAR(ShareOf(10, 10).low, 0.7225, 5e-4);
  EXPECT_EQ(ShareOf(0, 10).low, 0);
}

TEST(Trials, TheModelItselfStandsAfterTheNominalHandstand) {
  RobustnessStudy study = StudyOf("nominal/handstand.toml");
  study.scale = 0;
  Trials trials(study);
  const TrialOutcome outcome = trials.Play(0);
  EXPECT_EQ(outcome.verdict, Verdict::kStands) << outcome.reason;
  EXPECT_EQ(outcome.motions, 1);
}

TEST(Trials, RobotsThatTheNominalHandstandLosesStandAfterTheShippedOne) {
  RobustnessStudy nominal = StudyOf("nominal/handstand.toml");
  RobustnessStudy robust = StudyOf("handstand.toml");
  nominal.seed = robust.seed = 31;
  nominal.scale = robust.scale = 2;
  const RobustnessResult lost = RunStudy(nominal, 16, 1), kept = RunStudy(robust, 16, 1);
  EXPECT_LE(lost.stands().count, 8);
  EXPECT_GE(kept.stands().count, 14);
}

TEST(Trials, TheModelGoesThroughACycleOfTheGait) {
  RobustnessStudy study = StudyOf("gait.toml");
  study.scale = 0;
  study.run.cycles = 1;
  const TrialOutcome outcome = Trials(study).Play(0);
  EXPECT_EQ(outcome.verdict, Verdict::kStands) << outcome.in << ": " << outcome.reason;
  EXPECT_EQ(outcome.motions, 2);
}

TEST(Trials, ARobotWithoutFrictionFallsAndTheNodeIsNamed) {
  RobustnessStudy study = StudyOf("nominal/handstand.toml");
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
  RobustnessStudy study = StudyOf("nominal/handstand.toml");
  const testing::TemporaryFolder folder;
  study.twin = Written(folder, "weak.toml",
                       "format = \"tumbler-twin\"\nversion = 1\n[motor]\ntorque_max_nm = 0.3\n");
  study.scale = 0;
  EXPECT_NE(Trials(study).Play(0).verdict, Verdict::kStands);
}

TEST(Trials, RobotsHaveTheDrivesThatTheTwinFileNamesUnlessOthersAreGiven) {
  const testing::TemporaryFolder folder;
  const std::string soft = "primitives/robots/tumbler_drives.toml";
  std::string limp = testing::ReadFile(testing::SourcePath(soft));
  for (const std::string gain : {"kp_nm_per_rad = 40.0", "kd_nm_s_per_rad = 5.0"}) {
    ASSERT_NE(limp.find(gain), std::string::npos) << gain;
    for (std::size_t at = limp.find(gain); at != std::string::npos; at = limp.find(gain, at))
      limp.replace(at, gain.size(), gain.substr(0, gain.find(" = ")) + " = 0.5");
  }
  const std::string head = "format = \"tumbler-twin\"\nversion = 1\n";
  RobustnessStudy study = StudyOf("handstand.toml");
  study.scale = 0;
  study.drives = Written(folder, "limp.toml", limp);
  study.twin = Written(folder, "bare.toml", head);
  EXPECT_NE(Trials(study).Play(0).verdict, Verdict::kStands);
  const std::string given = IdentityOf(study);
  study.drives = "";
  EXPECT_EQ(Trials(study).Play(0).verdict, Verdict::kStands);
  study.twin = Written(folder, "named.toml", head + "drives = \"limp.toml\"\n");
  EXPECT_NE(Trials(study).Play(0).verdict, Verdict::kStands);
  EXPECT_NE(IdentityOf(study), given) << "the twin file is another one";
  study.drives = testing::SourcePath(soft);
  EXPECT_EQ(Trials(study).Play(0).verdict, Verdict::kStands);
}

/// A study of which about a third does not stand.
RobustnessStudy HardStudy() {
  RobustnessStudy study = StudyOf("handstand.toml");
  study.scale = 2.5;
  study.seed = 17;
  return study;
}

TEST(LaneTrials, LanesAndTwinAgreeOnWhichRobotsStand) {
  RobustnessStudy study = HardStudy();
  const RobustnessResult twin = RunStudy(study, 64, 1);
  study.lanes = true;
  const RobustnessResult lanes = RunStudy(study, 64, 1);
  EXPECT_GE(twin.stands().count, 16);
  EXPECT_LE(twin.stands().count, 60) << "robots have to fall, too, for this to say anything";
  const Agreement agreement = Compare(twin, lanes);
  EXPECT_GE(agreement.standing.count, 60) << ToText(agreement);
}

TEST(LaneTrials, ARobotIsTheSameInWhicheverLaneAndBesideWhomever) {
  RobustnessStudy study = HardStudy();
  const LaneTrials lanes(study);
  const std::array<std::uint64_t, 3> few{9, 3, 21};
  const std::array<std::uint64_t, 8> many{21, 1, 2, 4, 9, 5, 6, 3};
  const auto a = lanes.Play(few), b = lanes.Play(many);
  ASSERT_EQ(a.size(), 3U);
  EXPECT_EQ(CheckpointLine(9, a[0]), CheckpointLine(9, b[4]));
  EXPECT_EQ(CheckpointLine(3, a[1]), CheckpointLine(3, b[7]));
  EXPECT_EQ(CheckpointLine(21, a[2]), CheckpointLine(21, b[0]));
}

TEST(LaneTrials, JudgesThatLookNowAndThenSayOfEveryRobotWhatThoseSayThatLookInAllTicks) {
  int failed = 0, compared = 0;
  for (const char* motion : {"gait.toml", "nominal/handstand.toml"}) {
    RobustnessStudy study = StudyOf(motion);
    study.run.cycles = 1;
    study.scale = 2;
    study.seed = 13;
    const LaneTrials always(study, 1, 1), now_and_then(study);
    for (std::uint64_t first = 0; first < 48; first += Packet::kLanes) {
      std::array<std::uint64_t, Packet::kLanes> which{};
      std::iota(which.begin(), which.end(), first);
      const auto a = always.Play(which), b = now_and_then.Play(which);
      for (std::size_t lane = 0; lane < which.size(); ++lane) {
        EXPECT_EQ(a[lane].verdict, b[lane].verdict) << which[lane] << a[lane].reason;
        EXPECT_EQ(a[lane].motions, b[lane].motions);
        EXPECT_EQ(a[lane].in, b[lane].in);
        EXPECT_NEAR(a[lane].left_s, b[lane].left_s, 0.004);
        failed += a[lane].fails() ? 1 : 0;
        EXPECT_EQ(a[lane].reason, b[lane].reason);
        compared += a[lane].verdict == Verdict::kAmiss ? 1 : 0;
      }
    }
  }
  EXPECT_GT(failed, 20);
  EXPECT_GT(compared, 0);
}

TEST(LookTicks, AreThoseInWhichTheTwinsJudgesJudgeAndFewMore) {
  RobustnessStudy study = StudyOf("gait.toml");
  study.run.cycles = 1;
  const Trials trials(study);
  const Script& script = trials.script();
  const std::vector<std::size_t> looks = LookTicks(script, trials.motion().file(), 4);
  EXPECT_EQ(looks.front(), 0U);
  EXPECT_EQ(looks.back(), script.ticks.size());
  EXPECT_LT(looks.size(), script.ticks.size() / 2);
  EXPECT_TRUE(std::ranges::is_sorted(looks));
  for (std::size_t k = 1; k < script.ticks.size(); ++k) {
    const bool changes = script.ticks[k].state != script.ticks[k - 1].state ||
                         script.ticks[k].node != script.ticks[k - 1].node;
    EXPECT_TRUE(!changes || std::ranges::binary_search(looks, k)) << k;
  }
  EXPECT_EQ(LookTicks(script, trials.motion().file(), 1).size(), script.ticks.size() + 1);
}

TEST(LaneTrials, AStartThatTurnsTooFastIsAFallInLanesAndTwin) {
  for (const bool in_lanes : {false, true}) {
    RobustnessStudy study = HardStudy();
    study.spreads = {.mass = 0, .friction = 0, .stiffness = 0, .damping = 0};
    study.lanes = in_lanes;
    EXPECT_EQ(RunStudy(study, 3, 1).stands().count, 3) << in_lanes;
    study.spreads.start_rate_rad_s = 10;
    EXPECT_LE(RunStudy(study, 8, 1).stands().count, 4) << in_lanes;
  }
}

TEST(LaneTrials, LateSetpointsAndWrongZerosActInLanesAsInTheTwin) {
  RobustnessStudy study = HardStudy();
  study.scale = 1;
  study.spreads = {.mass = 0, .friction = 0, .stiffness = 0, .damping = 0, .delay_s = 0.002};
  std::array<int, 2> late{}, wrong{};
  for (const bool in_lanes : {false, true}) {
    study.lanes = in_lanes;
    late[in_lanes ? 1 : 0] = RunStudy(study, 16, 1).stands().count;
  }
  study.spreads.delay_s = 0;
  study.spreads.zero_rad = 0.1;
  for (const bool in_lanes : {false, true}) {
    study.lanes = in_lanes;
    wrong[in_lanes ? 1 : 0] = RunStudy(study, 16, 1).stands().count;
  }
  EXPECT_LT(wrong[0], 14);
  EXPECT_NEAR(late[0], late[1], 2);
  EXPECT_NEAR(wrong[0], wrong[1], 2);
}

TEST(LaneTrials, RobotsThatRockTooLongComeToRestInALongerHold) {
  RobustnessStudy study = StudyOf("nominal/handstand.toml");
  study.seed = 77;
  study.lanes = true;
  const RobustnessResult early = RunStudy(study, 1000, 1);
  ASSERT_GT(early.Count(Verdict::kAmiss), 2);
  study.run.hold_s = 8;
  const RobustnessResult late = RunStudy(study, 1000, 1);
  EXPECT_EQ(late.stands().count, early.stands().count)
      << "when a motion is judged does not depend on the hold";
  EXPECT_LT(early.AmissAtRest(), early.Count(Verdict::kAmiss));
  EXPECT_EQ(late.AmissAtRest(), late.Count(Verdict::kAmiss));
}

TEST(LaneTrials, ATwinFileIsRefused) {
  RobustnessStudy study = HardStudy();
  const testing::TemporaryFolder folder;
  study.twin = Written(folder, "twin.toml", "format = \"tumbler-twin\"\nversion = 1\n");
  EXPECT_THROW(LaneTrials{study}, std::runtime_error);
}

TEST(Trials, APushComesInTheHoldAndIsSurvivedOrNot) {
  RobustnessStudy study = StudyOf("handstand.toml");
  study.run.hold_s = 6;
  study.push_n = 0.01;
  EXPECT_EQ(RunStudy(study, 3, 1).stands().count, 3) << "a breath";
  study.push_n = 60;
  const RobustnessResult hard = RunStudy(study, 3, 1);
  EXPECT_EQ(hard.stands().count, 0);
  for (const TrialOutcome& trial : hard.trials) EXPECT_GT(trial.left_s, 3) << "in the hold";
  EXPECT_NE(ToText(hard).find("pushed with 60 N"), std::string::npos);
  study.run.hold_s = 2;
  EXPECT_THROW(Trials{study}, std::runtime_error) << "no time for a push";
  study.run.hold_s = 6;
  study.lanes = true;
  EXPECT_THROW(LaneTrials{study}, std::runtime_error) << "lanes have none";
}

TEST(Trials, AHandstandWithASensorKeepsStandingWherePushesFellTheOneWithout) {
  RobustnessStudy study = SensorStudyOf("handstand_sensor.toml");
  study.run.hold_s = 8;
  study.push_n = 5;
  constexpr int kRobots = 6;
  EXPECT_EQ(RunStudy(study, kRobots, 1).stands().count, kRobots);
  study.motion = testing::SourcePath("primitives/handstand.toml");
  EXPECT_LE(RunStudy(study, kRobots, 1).stands().count, 1);
}

TEST(Trials, TheRollWithASensorIsAsAskedOnARobotThatTheOneWithoutLoses) {
  RobustnessStudy with = SensorStudyOf("roll_sensor.toml"), without = SensorStudyOf("roll.toml");
  for (RobustnessStudy* const study : {&with, &without}) {
    study->scale = 2;
    study->seed = 1795682183;
  }
  EXPECT_TRUE(Trials(with).Play(70).stands());
  EXPECT_FALSE(Trials(without).Play(70).stands());
  constexpr int kRobots = 6;
  EXPECT_EQ(RunStudy(with, kRobots, 1).stands().count, kRobots);
  EXPECT_EQ(RunStudy(without, kRobots, 1).stands().count, kRobots);
}

TEST(Trials, SensorsFailOnlyWhereThereAreSome) {
  RobustnessStudy study = StudyOf("handstand.toml");
  study.sensor_faults = true;
  EXPECT_THROW(Trials{study}, std::runtime_error);
  const testing::TemporaryFolder folder;
  study.drives =
      Written(folder, "drives.toml",
              testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")) +
                  "\n[sensor]\nprotocol = \"xsens-mti\"\nlink = \"middle\"\n");
  EXPECT_EQ(RunStudy(study, 5, 1).stands().count, 5) << "the motion has no feedback";
}

TEST(Drops, AreOfOneSeedApartFromEachOtherWithinTheLimitsAndAboveTheGround) {
  const SimulatedMotion motion(LoadMotion(StudyOf("get_up.toml").motion));
  const Scene& scene = motion.scene();
  double low_rad = 9, high_rad = -9;
  for (std::uint64_t index = 0; index < 200; ++index) {
    const Drop drop = DrawDrop(scene, {5, index, 0});
    const Drop again = DrawDrop(scene, {5, index, 0});
    EXPECT_EQ(drop.pose.joint_positions_rad, again.pose.joint_positions_rad);
    EXPECT_EQ(drop.rates, again.rates);
    EXPECT_NE(drop.pose.root_pitch_rad, DrawDrop(scene, {5, index, 1}).pose.root_pitch_rad);
    EXPECT_NE(drop.pose.root_pitch_rad, DrawDrop(scene, {6, index, 0}).pose.root_pitch_rad);
    EXPECT_FALSE(LiesInItself(scene, drop.pose.joint_positions_rad));
    for (const double joint : drop.pose.joint_positions_rad) EXPECT_LE(std::abs(joint), 2.9);
    // Its root is an end of nothing: 30 mm of the middle's spheres are the least that is below it.
    EXPECT_GT(drop.pose.root_z_m, 0.02);
    low_rad = std::min(low_rad, drop.pose.root_pitch_rad);
    high_rad = std::max(high_rad, drop.pose.root_pitch_rad);
  }
  EXPECT_LT(low_rad, -3);
  EXPECT_GT(high_rad, 3);
  EXPECT_TRUE(LiesInItself(scene, {-2.9, 2.8})) << "both legs along the middle, on one side";
  EXPECT_FALSE(LiesInItself(scene, {-2.9, -2.8})) << "on both sides, each on its stop";
}

TEST(Certify, RefusesAMotionThatWasReplacedWhileItWasPlayed) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study;
  study.motion = folder / "motion.toml";
  study.lanes = true;
  testing::WriteFile(study.motion,
                     testing::ReadFile(testing::SourcePath("primitives/handstand.toml")));
  const RobustnessResult result = RunStudy(study, 8, 1);
  const std::string other = testing::ReadFile(testing::SourcePath("primitives/downstand.toml"));
  testing::WriteFile(study.motion, other);
  EXPECT_THROW(Certify(result), Refused);
  EXPECT_EQ(testing::ReadFile(study.motion), other);
}

TEST(Drops, ARobotThatLiesGetsUpAndGoesOnWithTheGait) {
  RobustnessStudy study = StudyOf("gait.toml");
  study.drives = testing::SourcePath("primitives/robots/tumbler_drives_sensor.toml");
  study.run.cycles = 1;
  study.drops = true;
  study.seed = 21;
  const RobustnessResult result = RunStudy(study, 3, 1);
  EXPECT_EQ(result.stands().count, 3);
  for (const TrialOutcome& trial : result.trials)
    EXPECT_EQ(trial.motions, trial.begun == "handstand" ? 2 : 3) << trial.begun;
}

TEST(Falls, RobotsThatFallGetUpAndAreAsAskedInTheEndAndNoneOfThemCountsAsStanding) {
  RobustnessStudy study = SensorStudyOf("gait_sensor.toml");
  study.run.cycles = 2;
  study.scale = 2;
  study.seed = 1795656634;
  const std::string identity = IdentityOf(study);
  RobustnessStudy gets_up = study;
  gets_up.run.get_ups = 2;
  EXPECT_NE(IdentityOf(gets_up), identity);
  Trials without(study), with(gets_up);
  RobustnessResult result{"gait", gets_up, "", {}};
  for (const std::uint64_t index : {0U, 72U, 93U}) {
    const TrialOutcome falls = without.Play(index);
    const TrialOutcome up = result.trials.emplace_back(with.Play(index));
    EXPECT_EQ(falls.stands(), index == 0);
    EXPECT_EQ(up.stands(), index == 0);
    if (index == 0) continue;
    EXPECT_EQ(falls.verdict, Verdict::kFell);
    EXPECT_EQ(up.verdict, Verdict::kGotUp) << up.reason;
    EXPECT_EQ(up.in, falls.in);
    EXPECT_EQ(up.motions, index == 93 ? 6 : 5)
        << "the cycles', those in which it fell, and those in which it got up";
    EXPECT_THAT(up.reason, HasSubstr("it got up 1 time"));
  }
  EXPECT_THAT(ToText(result), HasSubstr("gait: 1 of 3 robots are as asked after every motion"));
  EXPECT_THAT(ToText(result), HasSubstr("  3 are as asked in the end"));
  EXPECT_THAT(RobustnessPage(result), HasSubstr("<p>3 are as asked in the end, those that got up"));
  EXPECT_EQ(ToJson(result)["verdicts"]["got up"].integer(), 2);
  study.run.get_ups = 1;
  study.drives.clear();
  study.twin.clear();
  EXPECT_THROW(Trials{study}, Refused) << "nobody tells how it lies";
}

TEST(Falls, WhereARobotFellFirstIsSaidWhateverItDoesAfterwards) {
  RobustnessStudy study = SensorStudyOf("gait_sensor.toml");
  study.run.cycles = 2;
  study.scale = 2;
  study.seed = 4711;
  RobustnessStudy gets_up = study;
  gets_up.run.get_ups = 2;
  const TrialOutcome falls = Trials(study).Play(12), up = Trials(gets_up).Play(12);
  EXPECT_EQ(falls.in, "handstand");
  EXPECT_EQ(up.in, falls.in);
  EXPECT_EQ(up.left_s, falls.left_s);
  EXPECT_GT(up.motions, falls.motions);
}

TEST(Drops, RobotsGetUpHoweverTheyLieByTheirSensorAndWithoutItOnlyFromTheStart) {
  RobustnessStudy study = SensorStudyOf("get_up.toml");
  study.drops = true;
  study.seed = 3;
  constexpr int kRobots = 12;
  const RobustnessResult up = RunStudy(study, kRobots, 1);
  EXPECT_EQ(up.stands().count, kRobots);
  int began = 0;
  for (const TrialOutcome& trial : up.trials) {
    EXPECT_EQ(trial.motions, 1);
    EXPECT_GE(trial.drops, 1);
    if (trial.begun != "stand") ++began;
  }
  EXPECT_GT(began, 0);
  int robots = 0;
  for (const Lies& lies : up.HowTheyLay()) robots += lies.robots;
  EXPECT_EQ(robots, kRobots);
  EXPECT_NE(ToText(up).find("lay at"), std::string::npos);
  EXPECT_EQ(ToJson(up)["lay"].size(), up.HowTheyLay().size());
  EXPECT_EQ(ToText(up), ToText(RunStudy(study, kRobots, 2)));

  study.drives.clear();
  study.twin.clear();
  const RobustnessResult blind = RunStudy(study, kRobots, 1);
  for (int i = 0; i < kRobots; ++i) {
    const auto index = static_cast<std::size_t>(i);
    EXPECT_EQ(blind.trials[index].begun, "stand");
    EXPECT_EQ(blind.trials[index].stands(), up.trials[index].begun == "stand") << i;
  }
}

TEST(Checkpoint, RobotsThatArePushedAreOtherRobots) {
  RobustnessStudy study = StudyOf("handstand.toml");
  const std::string calm = IdentityOf(study);
  study.push_n = 5;
  const std::string pushed = IdentityOf(study);
  study.sensor_faults = true;
  EXPECT_NE(calm, pushed);
  EXPECT_NE(pushed, IdentityOf(study));
  study.drops = true;
  EXPECT_NE(IdentityOf(study), pushed);
}

TEST(DepartureWatch, ARobotThatComesBackHasNotLeft) {
  const auto seen = [](const std::vector<double>& off_rad) {
    DepartureWatch watch;
    ScriptTick tick;
    tick.node = 2;
    tick.state = ExecutorState::kRunning;
    for (const double off : off_rad) watch.Observe(tick, off);
    return watch;
  };
  EXPECT_EQ(seen({0, 0.1, 0.15, 0.1}).node(), -1);
  EXPECT_EQ(seen({0, 0.1, 0.3, 0.05}).node(), -1);
  EXPECT_EQ(seen({0, 0.1, 0.3, 0.15}).node(), 2) << "it is not back";
  EXPECT_EQ(seen({0, 0.1, 0.3, 0.15}).ticks(), 2);
  EXPECT_EQ(seen({0, 0.3, 0.05, 0.1, -0.4, 2}).ticks(), 4) << "when it left for good counts";
  EXPECT_EQ(seen({0, std::nan("")}).ticks(), 1);
}

TEST(Trials, AFallIsAtATimeOfItsMotion) {
  RobustnessStudy study = StudyOf("nominal/handstand.toml");
  study.seed = 35;
  study.scale = 2;
  int fell = 0;
  for (const TrialOutcome& trial : RunStudy(study, 8, 1).trials) {
    if (trial.verdict != Verdict::kFell) continue;
    ++fell;
    EXPECT_EQ(trial.in, "handstand");
    EXPECT_GT(trial.left_s, 0.1);
    EXPECT_LT(trial.left_s, 4);
  }
  EXPECT_GT(fell, 0);
}

std::string Refusal(const std::function<void()>& work) {
  try {
    work();
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

RobustnessResult Planned(const RobustnessStudy& study, const WorkPlan& plan) {
  const WorkDone work = RunStudy(study, plan, Processes());
  EXPECT_TRUE(work.result);
  return work.result.value_or(RobustnessResult{});
}

TEST(Checkpoint, AWorkInPartsGivesTheBytesOfTheWhole) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  const std::string whole = ToJson(RunStudy(study, 20, 1)).Dump(2);
  WorkPlan part;
  part.robots = 20;
  part.shards = 3;
  for (part.shard = 1; part.shard <= 3; ++part.shard) {
    part.checkpoint = folder / ("part" + std::to_string(part.shard));
    const WorkDone work = RunStudy(study, part, Processes());
    EXPECT_FALSE(work.result) << "the other parts are not known here";
    EXPECT_EQ(work.known, part.shard <= 2 ? 7 : 6);
  }
  WorkPlan merged;
  merged.robots = 20;
  merged.merged = {folder / "part3", folder / "part1", folder / "part2"};
  EXPECT_EQ(ToJson(Planned(study, merged)).Dump(2), whole);
  // One part is missing: its robots are played again.
  merged.merged.pop_back();
  EXPECT_EQ(ToJson(Planned(study, merged)).Dump(2), whole);
}

TEST(Checkpoint, WhatIsThereIsNotPlayedAgainAndABrokenLastLineIs) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  WorkPlan plan;
  plan.robots = 12;
  plan.checkpoint = folder / "robots";
  const std::string whole = ToJson(Planned(study, plan)).Dump(2);
  const std::string lines = testing::ReadFile(plan.checkpoint);
  EXPECT_EQ(ToJson(Planned(study, plan)).Dump(2), whole);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines) << "nothing had to be added";
  testing::WriteFile(plan.checkpoint, lines.substr(0, lines.size() - 30));
  EXPECT_EQ(ToJson(Planned(study, plan)).Dump(2), whole);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines);
  // What a file says of a robot is taken from there.
  testing::WriteFile(
      plan.checkpoint,
      lines.substr(0, lines.find('\n') + 1) +
          "{\"robot\":0,\"verdict\":\"overlap\",\"motions\":1,\"in\":\"x\","
          "\"reason\":\"y\",\"left_s\":0.5,\"rests\":false,\"drops\":0,\"lies_rad\":0.0,"
          "\"begun\":\"\"}\n");
  EXPECT_EQ(Planned(study, plan).trials[0].verdict, Verdict::kOverlap);
}

TEST(Checkpoint, TwoStudiesDoNotWriteIntoOneFileAtOnce) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  WorkPlan plan;
  plan.robots = 8;
  plan.checkpoint = folder / "robots";
  Planned(study, plan);
  const std::string lines = testing::ReadFile(plan.checkpoint);
  plan.robots = 16;
  {
    const WriterLock other(plan.checkpoint);
    EXPECT_NE(Refusal([&] { Planned(study, plan); }).find("is being written by another program"),
              std::string::npos);
    EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines);
  }
  EXPECT_EQ(Planned(study, plan).trials.size(), 16U);
}

TEST(Checkpoint, AFileOfOtherRobotsOrNoneIsRefusedAndLeftAsItIs) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study = HardStudy();
  study.lanes = true;
  WorkPlan plan;
  plan.robots = 8;
  plan.checkpoint = folder / "robots";
  Planned(study, plan);
  const std::string lines = testing::ReadFile(plan.checkpoint);
  RobustnessStudy other = study;
  other.seed = 18;
  EXPECT_NE(Refusal([&] { Planned(other, plan); }).find("about other robots"), std::string::npos);
  other = study;
  other.spreads.zero_rad = 0.01;
  EXPECT_NE(Refusal([&] { Planned(other, plan); }).find("about other robots"), std::string::npos);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), lines);
  testing::WriteFile(plan.checkpoint, "some notes");
  EXPECT_NE(Refusal([&] { Planned(study, plan); }).find("no checkpoint"), std::string::npos);
  EXPECT_EQ(testing::ReadFile(plan.checkpoint), "some notes");
  testing::WriteFile(plan.checkpoint, lines.substr(0, lines.find('\n') + 1) + "{\"robot\":1}\n");
  EXPECT_NE(Refusal([&] { Planned(study, plan); }).find(":2: is not the outcome"),
            std::string::npos)
      << Refusal([&] { Planned(study, plan); });
  // Numbers that are too large for their kind, two lines that became one, and other members.
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"\"motions\":1,", "\"motions\":4294967297,"},
           {"\"robot\":", "\"robot\":59,\"robot\":"},
           {"\"rests\":", "\"note\":1,\"rests\":"}}) {
    const std::size_t at = lines.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    std::string edited = lines;
    edited.replace(at, from.size(), to);
    testing::WriteFile(plan.checkpoint, edited);
    EXPECT_NE(Refusal([&] { Planned(study, plan); }).find(": is not the outcome"),
              std::string::npos)
        << to;
  }
}

TEST(RobustnessStudy, ThreadsChangeNotAByte) {
  const RobustnessStudy study = StudyOf("nominal/handstand.toml");
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
    trial.variation = DrawRobot(TumblerScene(), {}, 1, 3, i);
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

TEST(RobustnessStudy, WhatHasNoInfluenceIsNotSaidToTellOfFewFailures) {
  Spreads many;
  for (double Spreads::*spread :
       {&Spreads::inertia, &Spreads::length, &Spreads::gain, &Spreads::torque_limit,
        &Spreads::start_rad, &Spreads::start_rate_rad_s})
    many.*spread = 1e-9;
  int studies = 0, wrong = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    for (const std::uint64_t failures : {1U, 2U, 5U}) {
      RobustnessResult result;
      for (std::uint64_t i = 0; i < 200; ++i) {
        TrialOutcome trial;
        trial.variation = DrawRobot(TumblerScene(), many, 1, seed, i);
        if (i < failures) trial.verdict = Verdict::kFell;  // whatever it is like
        result.trials.push_back(trial);
      }
      const auto influences = result.Influences();
      ++studies;
      if (std::any_of(influences.begin(), influences.end(),
                      [](const Influence& influence) { return influence.telling(); }))
        ++wrong;
    }
  }
  EXPECT_LE(wrong, studies / 50) << "of " << studies;
}

TEST(RobustnessStudy, WhatCannotBeJudgedInTheHoldIsRefused) {
  RobustnessStudy study;
  study.motion = testing::SourcePath("primitives/hopper/hopper.toml");
  study.run.hold_s = 0;
  EXPECT_THROW(Trials trials(study), Refused);
  study.lanes = true;
  EXPECT_THROW(LaneTrials trials(study), Refused);
}

TEST(RobustnessStudy, RobotsThatWereNotJudgedAreInNoShareAndInNoCertificate) {
  RobustnessResult result;
  result.name = "motion";
  result.study.motion = testing::SourcePath("primitives/nominal/handstand.toml");
  result.trials.resize(10);
  result.trials[0].verdict = Verdict::kAmiss;
  result.trials[1].verdict = result.trials[2].verdict = Verdict::kNotJudged;
  result.trials[1].reason = result.trials[2].reason = "nobody looked";
  EXPECT_EQ(result.stands().count, 7);
  EXPECT_EQ(result.stands().of, 8);
  const std::string text = ToText(result);
  EXPECT_THAT(text, HasSubstr("7 of 8 robots that were judged are as asked after every motion"));
  EXPECT_THAT(text, HasSubstr("2 robots were not judged: nobody looked"));
  const Json json = ToJson(result);
  EXPECT_EQ(json["robots"].number(), 10);
  EXPECT_EQ(json["judged"].number(), 8);
  EXPECT_EQ(json["not_as_asked"].size(), 1U);
  EXPECT_EQ(json["not_judged"].size(), 2U);
  EXPECT_EQ(json["verdicts"]["not judged"].number(), 2);
  const std::string page = RobustnessPage(result);
  EXPECT_THAT(page, HasSubstr("7 of 8 robots that were judged are as asked"));
  EXPECT_THAT(page, HasSubstr("2 robots were not judged: nobody looked"));
  result.files = HashOfFiles(result.study);
  EXPECT_THROW(Certify(result), Refused);
  for (TrialOutcome& trial : result.trials) trial.verdict = Verdict::kNotJudged;
  EXPECT_THAT(ToText(result), HasSubstr("motion: none of 10 robots was judged"));
  EXPECT_THAT(RobustnessPage(result), HasSubstr("<p class=share>not judged</p>"));
}

TEST(RobustnessStudy, OfRobotsThatWereDroppedNobodySaysThatTheyKeptToTheModelsWay) {
  RobustnessResult result;
  result.study.drops = true;
  TrialOutcome trial;
  trial.verdict = Verdict::kFell;
  trial.in = "handstand";
  result.trials = {trial};
  EXPECT_NE(ToText(result).find("    handstand: 1\n"), std::string::npos) << ToText(result);
  EXPECT_EQ(ToText(result).find("kept to it"), std::string::npos);
  EXPECT_EQ(ToJson(result)["where"].size(), 0U);
}

TEST(RobustnessStudy, TheMapHasEveryRobotInACellOfItsOwn) {
  RobustnessResult result;
  for (std::uint64_t i = 0; i < 400; ++i) {
    TrialOutcome trial;
    trial.variation = DrawRobot(TumblerScene(), {}, 1, 3, i);
    if (trial.variation.friction + trial.variation.damping < 1.7) trial.verdict = Verdict::kFell;
    result.trials.push_back(trial);
  }
  const auto map = result.Map();
  ASSERT_TRUE(map);
  EXPECT_EQ((std::set<std::string>{map->x, map->y}),
            (std::set<std::string>{"friction", "damping"}));
  int robots = 0, stand = 0;
  for (const auto& row : map->cells) {
    for (const auto& cell : row) {
      robots += cell.robots;
      stand += cell.stand;
    }
  }
  EXPECT_EQ(robots, 400);
  EXPECT_EQ(stand, result.stands().count);
  EXPECT_EQ(map->CellOf(-9), 0);
  EXPECT_EQ(map->CellOf(9), SuccessMap::kCells - 1);
  EXPECT_EQ(map->CellOf(0), SuccessMap::kCells / 2);
  EXPECT_NEAR(map->EdgeOf(1), -map->half_width, 1e-12);
  EXPECT_NEAR(map->EdgeOf(SuccessMap::kCells - 1), map->half_width, 1e-12);
  EXPECT_EQ(map->CellOf(map->EdgeOf(3) + 1e-9), 3);
  const auto& low = map->cells[1][1];
  const auto& high = map->cells[SuccessMap::kCells - 2][SuccessMap::kCells - 2];
  EXPECT_EQ(low.stand, 0);
  EXPECT_EQ(high.stand, high.robots);
}

TEST(RobustnessPage, ShowsShareMapAndEveryRobotAndTakesNamesAsText) {
  RobustnessResult result;
  result.name = "<b>&";
  for (std::uint64_t i = 0; i < 60; ++i) {
    TrialOutcome trial;
    trial.variation = DrawRobot(TumblerScene(), {}, 1, 3, i);
    if (trial.variation.friction < 0.85) {
      trial.verdict = Verdict::kFell;
      trial.in = "hand<stand";
      trial.left_s = 0.4;
    }
    result.trials.push_back(trial);
  }
  const std::string page = RobustnessPage(result);
  const auto count = [&page](const std::string& part) {
    int found = 0;
    for (auto at = page.find(part); at != std::string::npos; at = page.find(part, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("<circle"), 60);
  EXPECT_EQ(count("<line class=fell"), result.Count(Verdict::kFell)) << "a stroke for each fall";
  EXPECT_EQ(count("<rect"), SuccessMap::kCells * SuccessMap::kCells);
  EXPECT_EQ(count("<b>"), 0);
  EXPECT_GT(count("&lt;b&gt;&amp;"), 0);
  EXPECT_GT(count("hand&lt;stand"), 0);
  EXPECT_EQ(count("<script"), 0);
  EXPECT_GT(count("friction [standard deviations]"), 0);
}

/// A study that the program takes, with its JSON on standard output.
std::string LaneStudy(const std::string& more) {
  return "tumbler robustness " + testing::SourcePath("primitives/handstand.toml") +
         " --lanes --scale 2.5 --seed 17 --robots 2000 --json - " + more + " 2>/dev/null";
}

TEST(RobustnessProgram, AWorkThatWasKilledAndGoesOnHasTheSameBytes) {
  const testing::TemporaryFolder folder;
  const std::string checkpoint = folder / "robots";
  const testing::Outcome whole = testing::RunInShell(LaneStudy(""));
  ASSERT_EQ(whole.exit_code, 0);
  for (int kills = 0; kills < 2; ++kills) {
    // Ended as soon as there is more in the file than there was.
    const testing::Outcome killed = testing::RunInShell(fmt::format(
        "size=$(wc -l < {0} 2>/dev/null || echo 1); {1} >/dev/null & pid=$!; "
        "while [ \"$(wc -l < {0} 2>/dev/null || echo 0)\" -le $size ]; do sleep 0.01; done; "
        "kill -9 $pid; wait $pid; echo status $?",
        checkpoint, LaneStudy("--checkpoint " + checkpoint)));
    EXPECT_NE(killed.text.find("status 137"), std::string::npos) << killed.text;
  }
  const testing::Outcome resumed = testing::RunInShell(LaneStudy("--checkpoint " + checkpoint));
  EXPECT_EQ(resumed.exit_code, 0);
  EXPECT_EQ(resumed.text, whole.text);
}

TEST(RobustnessProgram, EndsAtAnInterruptSaysHowFarItCameAndGoesOnFromThere) {
  const testing::TemporaryFolder folder;
  const std::string checkpoint = folder / "robots";
  const std::string study = testing::SourcePath("primitives/handstand.toml") +
                            " --lanes --seed 17 --checkpoint " + checkpoint;
  testing::Program endless({"/bin/sh", "-c",
                            "exec " + testing::ProgramPath("tumbler robustness") +
                                " --robots 10000000 --json " + (folder / "x.json") + " " + study});
  ASSERT_TRUE(testing::Eventually([&] {
    return std::filesystem::exists(checkpoint) && std::filesystem::file_size(checkpoint) > 10'000;
  }));
  endless.Signal(SIGINT);
  EXPECT_EQ(endless.Wait(), 130) << endless.text();
  EXPECT_THAT(endless.text(),
              ::testing::HasSubstr("of 10000000 robots are known; " + checkpoint + " has them\n"));
  EXPECT_EQ(endless.text().find('\x1b'), std::string::npos) << "no terminal, no escapes";
  EXPECT_EQ(folder.Listing(), (std::set<std::string>{"robots"}));
  const testing::Outcome quiet =
      testing::RunInShell("tumbler robustness --quiet --robots 32 " + study);
  EXPECT_EQ(quiet.exit_code, 0) << quiet.text;
  EXPECT_EQ(quiet.text.find("/32 robots"), std::string::npos) << quiet.text;
}

TEST(RobustnessProgram, APartOfTheWorkNeedsAFileAndItsNumbers) {
  const std::string motion = testing::SourcePath("primitives/handstand.toml");
  for (const std::string shard : {"0/2", "3/2", "1", "1/", "1/2x", "-1/2"}) {
    const testing::Outcome outcome =
        testing::RunProgram({"tumbler robustness", motion, "--shard=" + shard});
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.text.find("--shard"), std::string::npos) << outcome.text;
  }
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler robustness", motion, "--shard", "1/2"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("--checkpoint"), std::string::npos) << outcome.text;
}

TEST(RobustnessProgram, TellsOnHowManyLanesAndTwinAgreeAndWritesThePage) {
  const testing::TemporaryFolder folder;
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler robustness", testing::SourcePath("primitives/handstand.toml"),
                           "--robots", "4", "--compare-lanes", "--report", folder / "page"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("lanes and twin agree whether"), std::string::npos) << outcome.text;
  EXPECT_NE(testing::ReadFile(folder / "page/index.html").find("<h2>Verdicts"), std::string::npos);
}

TEST(RobustnessProgram, PlaysAnArmOnAWallAndRefusesWhatTakesARobotThatMovesAbout) {
  const testing::TemporaryFolder folder;
  const std::string arm = folder / "arm.toml";
  const testing::Outcome found =
      testing::RunProgram({"tumbler optimize", testing::SourcePath("tests/data/tasks/arm.toml"),
                           "--quiet", "--out", arm});
  ASSERT_EQ(found.exit_code, 0) << found.text;
  // Its task asks for nothing that could be missed, and a fixed root has no pitch to compare.
  const std::string before = testing::ReadFile(arm);
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler robustness", arm, "--robots", "4", "--certify", "--json", folder / "arm.json"});
  EXPECT_EQ(outcome.exit_code, 4) << outcome.text;
  EXPECT_THAT(outcome.text,
              HasSubstr("none of 4 robots was judged\n  4 robots were not judged: its "
                        "task asks for nothing"));
  EXPECT_THAT(outcome.text, HasSubstr("nothing was certified"));
  EXPECT_THAT(outcome.text, ::testing::Not(HasSubstr("100.0 %")));
  EXPECT_EQ(testing::ReadFile(arm), before);
  const std::optional<Json> json = Json::Parse(testing::ReadFile(folder / "arm.json"));
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["judged"].number(), 0);
  EXPECT_TRUE((*json)["share"].is_null());
  EXPECT_EQ((*json)["not_judged"].size(), 4U);
  for (const std::string option : {"--push=2", "--drops", "--lanes"}) {
    const testing::Outcome refused =
        testing::RunProgram({"tumbler robustness", arm, "--robots", "1", option});
    EXPECT_EQ(refused.exit_code, 2) << refused.text;
    EXPECT_THAT(refused.text,
                HasSubstr(option == "--lanes" ? "cannot be simulated in lanes: the robot's root is "
                                                "fixed"
                                              : "leave out " + option.substr(0, option.find('='))));
  }
  testing::WriteFile(folder / "wave.toml",
                     "format = \"tumbler-sequence\"\nversion = 1\nname = \"wave\"\n"
                     "start = \"wave\"\nprimitives = { wave = \"arm.toml\" }\n"
                     "[[node]]\nname = \"wave\"\nprimitive = \"wave\"\nsafe = true\n");
  const testing::Outcome chain =
      testing::RunProgram({"tumbler chain", "simulate", folder / "wave.toml", "--json", "-"});
  EXPECT_THAT(chain.text, HasSubstr("\"fixed\"")) << "it is neither level nor upright";
  EXPECT_THAT(testing::RunProgram({"tumbler run", "sim", arm}).text,
              HasSubstr("without torque, 3 s later: the robot is limp where it is fixed to the "
                        "world, its joints at "));
}

TEST(RobustnessProgram, WhatARunWouldRefuseIsRefusedOfRobotsAndAbortsToo) {
  const testing::TemporaryFolder folder;
  const std::string motion = folder / "handstand.toml";
  const std::string text = testing::ReadFile(testing::SourcePath("primitives/handstand.toml"));
  testing::WriteFile(motion, text);
  const std::string drives =
      Written(folder, "drives.toml",
              testing::ReplacedAll(
                  testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives.toml")),
                  "torque_nm = [-18.0, 18.0]", "torque_nm = [-5.0, 5.0]"));
  testing::WriteFile(
      drives, testing::ReplacedAll(testing::ReadFile(drives), "[-12.5, 12.5]", "[-2.0, 2.0]"));
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"tumbler run", "sim", motion},
        {"tumbler robustness", motion, "--robots", "2", "--certify"},
        {"tumbler abort", motion, "--robots", "2", "--write"}}) {
    std::vector<std::string> with_drives = command;
    with_drives.insert(with_drives.end(), {"--drives", drives});
    const testing::Outcome refused = testing::RunProgram(with_drives);
    EXPECT_EQ(refused.exit_code, 2) << refused.text;
    EXPECT_THAT(refused.text, HasSubstr("torque limit is "));
    EXPECT_THAT(refused.text, HasSubstr("whose range is -5 ... 5 N m"));
    for (const char* joint : {"joint leg1: ", "joint leg2: "}) {
      for (const char* what : {"position limit is 2.9 rad", "torque limit is "})
        EXPECT_THAT(refused.text, HasSubstr(std::string(joint) + "the motion's " + what));
    }
  }
  EXPECT_EQ(testing::ReadFile(motion), text);
}

TEST(RobustnessProgram, APushTakesAModelThatStands) {
  const testing::TemporaryFolder folder;
  const std::string motion = testing::SourcePath("primitives/handstand.toml");
  const std::string twin = Written(
      folder, "twin.toml",
      fmt::format("format = \"tumbler-twin\"\nversion = 1\nmotion = \"{}\"\ndrives = \"{}\"\n"
                  "[motor]\ntorque_max_nm = 0.5\n",
                  motion, testing::SourcePath("primitives/robots/tumbler_drives.toml")));
  const testing::Outcome refused =
      testing::RunProgram({"tumbler robustness", motion, "--robots", "2", "--twin", twin, "--push",
                           "2", "--hold-s", "12"});
  EXPECT_EQ(refused.exit_code, 2) << refused.text;
  EXPECT_THAT(refused.text, HasSubstr("the model itself is not as asked, so there is no hold"));
}

TEST(RobustnessProgram, ARobotThatMayGetUpIsNotPushed) {
  const testing::Outcome refused = testing::RunProgram(
      {"tumbler robustness", testing::SourcePath("primitives/gait_sensor.toml"), "--robots", "1",
       "--cycles", "1", "--push", "2", "--get-ups", "1", "--drives",
       testing::SourcePath("primitives/robots/tumbler_drives_sensor.toml")});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.text, HasSubstr("--push: comes at a time in the model's hold"));
}

TEST(RobustnessProgram, PutsNoResultInThePlaceOfAnother) {
  const testing::TemporaryFolder folder;
  for (const auto& [json, why] :
       {std::pair(folder / "page/index.html", "is named for two results"),
        std::pair(folder / "page", "/page', which is a result, too, and no folder")}) {
    const testing::Outcome outcome =
        testing::RunProgram({"tumbler robustness", testing::SourcePath("primitives/handstand.toml"),
                             "--robots", "1", "--report", folder / "page", "--json", json});
    EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
    EXPECT_NE(outcome.text.find(why), std::string::npos) << outcome.text;
    EXPECT_FALSE(std::filesystem::exists(folder / "page"));
  }
}

TEST(RobustnessProgram, PrintsShareAndIntervalAndWritesThem) {
  const testing::TemporaryFolder folder;
  const std::string json_file = folder / "figures.json";
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler robustness", testing::SourcePath("primitives/nominal/handstand.toml"), "--robots",
       "1", "--scale", "0", "--json", json_file});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("1 of 1 robots are as asked"), std::string::npos) << outcome.text;
  const std::optional<Json> json = Json::Parse(testing::ReadFile(json_file));
  ASSERT_TRUE(json);
  EXPECT_EQ((*json)["robots"].number(), 1);
  EXPECT_EQ((*json)["as_asked"].number(), 1);
  EXPECT_EQ((*json)["spreads"]["mass"].number(), 0.05);
}

/// A folder with a gait's files, which a program may change.
std::string CopyOfTheGait(const testing::TemporaryFolder& folder) {
  for (const std::string name : {"gait", "handstand", "downstand_back", "roll", "rise",
                                 "rise_from_leg1", "rise_from_leg2"}) {
    Written(folder, name + ".toml",
            testing::ReadFile(testing::SourcePath("primitives/" + name + ".toml")));
  }
  return folder / "gait.toml";
}

/// What a primitive says of robots, of those with this seed.
std::vector<RobustnessFigure> FiguresIn(const std::string& path, std::uint64_t seed) {
  std::vector<RobustnessFigure> figures = LoadPrimitive(path).robustness;
  std::erase_if(figures, [seed](const RobustnessFigure& figure) { return figure.seed != seed; });
  return figures;
}

TEST(RobustnessProgram, ACertificateGetsTheShareAndANewerOneTakesItsPlace) {
  const testing::TemporaryFolder folder;
  CopyOfTheGait(folder);
  const std::string motion = folder / "handstand.toml";
  const Primitive<double> before = LoadPrimitive(motion).primitive;
  const auto certify = [&](const std::string& robots, const std::string& seed) {
    return testing::RunProgram({"tumbler robustness", motion, "--lanes", "--robots", robots,
                                "--seed", seed, "--mass", "0.07", "--certify"});
  };
  const testing::Outcome first = certify("8", "9001");
  EXPECT_EQ(first.exit_code, 0) << first.text;
  EXPECT_NE(first.text.find("wrote the share into " + motion), std::string::npos) << first.text;
  const std::vector<RobustnessFigure> figures = FiguresIn(motion, 9001);
  ASSERT_EQ(figures.size(), 1U);
  EXPECT_EQ(figures[0].robots, 8);
  EXPECT_EQ(figures[0].cycles, 0);
  EXPECT_EQ(figures[0].where, RobustnessFigure::Where::kLanes);
  EXPECT_NE(first.text.find(std::to_string(figures[0].stand) + " of 8 robots"), std::string::npos)
      << first.text;
  EXPECT_EQ(figures[0].spreads, "--mass 0.07 --friction 0.2 --stiffness 0.2 --damping 0.2");
  EXPECT_EQ(certify("16", "9002").exit_code, 0);
  EXPECT_TRUE(FiguresIn(motion, 9001).empty());
  ASSERT_EQ(FiguresIn(motion, 9002).size(), 1U);
  EXPECT_EQ(FiguresIn(motion, 9002)[0].robots, 16);
  const Primitive<double> after = LoadPrimitive(motion).primitive;
  for (std::size_t j = 0; j < before.motions().size(); ++j) {
    const auto points = before.motions()[j].position.control_points();
    const auto same = after.motions()[j].position.control_points();
    EXPECT_TRUE(std::equal(points.begin(), points.end(), same.begin(), same.end()));
  }
}

TEST(RobustnessProgram, TheShareOfAGaitGoesIntoThePrimitivesThatItPlaysWhichTheirProgramsShow) {
  const testing::TemporaryFolder folder;
  const std::string gait = CopyOfTheGait(folder);
  const testing::Outcome outcome =
      testing::RunProgram({"tumbler robustness", gait, "--lanes", "--robots", "1", "--scale", "0",
                           "--cycles", "1", "--seed", "9003", "--certify"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  // Neither a branch was taken, nor did a robot lie when its run began.
  for (const std::string name : {"roll", "rise", "rise_from_leg1", "rise_from_leg2"})
    EXPECT_TRUE(FiguresIn(folder / (name + ".toml"), 9003).empty()) << name;
  for (const std::string name : {"handstand", "downstand_back"}) {
    const std::vector<RobustnessFigure> figures = FiguresIn(folder / (name + ".toml"), 9003);
    ASSERT_EQ(figures.size(), 1U) << name;
    EXPECT_EQ(figures[0].motion, "gait");
    EXPECT_EQ(figures[0].cycles, 1);
    EXPECT_EQ(figures[0].stand, 1);
  }
  const testing::Outcome chain = testing::RunProgram({"tumbler chain", "check", gait});
  EXPECT_EQ(chain.exit_code, 0) << chain.text;
  EXPECT_NE(chain.text.find("downstand: robots as asked: gait, 1 cycles: 1 of 1 robots"),
            std::string::npos)
      << chain.text;
}

TEST(RobustnessProgram, NoCertificateIsWrittenOfWhatItHasNoPlaceFor) {
  const testing::TemporaryFolder folder;
  const std::string gait = CopyOfTheGait(folder);
  const std::string motion = folder / "handstand.toml";
  const std::string before = testing::ReadFile(motion);
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{motion, "--twin",
                                 testing::SourcePath("primitives/robots/tumbler_twin.toml")},
        std::vector<std::string>{gait, "--branch", "roll"}}) {
    std::vector<std::string> command = {"tumbler robustness", "--robots", "1", "--certify"};
    command.insert(command.end(), more.begin(), more.end());
    const testing::Outcome outcome = testing::RunProgram(command);
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_NE(outcome.text.find("--certify: "), std::string::npos) << outcome.text;
  }
  EXPECT_EQ(testing::ReadFile(motion), before);
}

TEST(RobustnessProgram, ARangeOfTheGroundIsInTheCertificateAndAWrongOneRefused) {
  const testing::TemporaryFolder folder;
  CopyOfTheGait(folder);
  const std::string motion = folder / "handstand.toml";
  const testing::Outcome done = testing::RunProgram(
      {"tumbler robustness", motion, "--lanes", "--robots", "8", "--seed", "9004", "--friction",
       "0.2..0.5", "--stiffness", "x2", "--damping", "0", "--certify"});
  EXPECT_EQ(done.exit_code, 0) << done.text;
  const std::vector<RobustnessFigure> figures = FiguresIn(motion, 9004);
  ASSERT_EQ(figures.size(), 1U);
  EXPECT_EQ(figures[0].spreads, "--mass 0.05 --friction 0.2..0.5 --stiffness x2");
  for (const std::string wrong : {"0.5..0.2", "x0.5", "some", "1.5"}) {
    const testing::Outcome refused = testing::RunProgram(
        {"tumbler robustness", motion, "--lanes", "--robots", "8", "--friction", wrong});
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.text, HasSubstr("--friction: ")) << wrong;
    EXPECT_THAT(refused.text, HasSubstr("allowed: a number from 0 to 1, a range of values"));
  }
}

TEST(RobustnessProgram, AGaitWithoutCyclesIsRefused) {
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler robustness", testing::SourcePath("primitives/nominal/gait.toml")});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("--cycles"), std::string::npos) << outcome.text;
}

}  // namespace
}  // namespace tumbler
