// A robot with a joint without a motor, on a fixed root, from its task to the share of robots: what
// is asked of a point of a link and in the motion is judged in the twin, in lanes and in the chain.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_hash.h"
#include "common/files/primitive_toml.h"
#include "offline/certify/chain.h"
#include "offline/pages/robot_paths.h"
#include "offline/pages/run_data.h"
#include "offline/pages/truth.h"
#include "offline/pages/viewed_robot.h"
#include "offline/studies/lane_trials.h"
#include "offline/studies/study.h"
#include "offline/twin/posture.h"
#include "tests/support/bad_inputs.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Replaced;
using testing::RunProgram;

/// The same robot on a bar, where its upper rod is the root.
std::string OnABar(std::string robot) {
  const std::size_t from = robot.find("  <link name=\"world\"/>"),
                    to = robot.find("  <link name=\"upper\">");
  return robot.erase(from, to - from);
}

/// Motions of the whip on a fixed root and on a bar, found once.
struct Whips {
  Whips() {
    const std::string task = testing::ReadFile(testing::SourcePath("tests/data/tasks/whip.toml"));
    const std::string robot = testing::ReadFile(testing::SourcePath("tests/data/robots/whip.urdf"));
    testing::WriteFile(folder / "whip.urdf", robot);
    testing::WriteFile(folder / "bar.urdf", OnABar(robot));
    testing::WriteFile(folder / "fixed_task.toml", Replaced(task, "../robots/whip", "whip"));
    std::string bar = Replaced(task, "../robots/whip", "bar");
    bar = Replaced(bar, "root = \"fixed\"\nobstacle = []", "root = \"hinge-y\"");
    bar = Replaced(bar, "[passive.pin]\ndamping_nm_s_per_rad", "[bar]\nfriction_nm_s_per_rad");
    bar = Replaced(bar, "[start]\n", "[start]\nx_m = 0.0\nz_m = 0.0\npitch_rad = 0.0\n");
    testing::WriteFile(folder / "bar_task.toml", bar);
    for (const std::string name : {"fixed", "bar"}) {
      const testing::Outcome found = RunProgram({"tumbler optimize", folder / (name + "_task.toml"),
                                                 "--quiet", "--out", folder / (name + ".toml")});
      EXPECT_EQ(found.exit_code, 0) << found.text;
    }
  }
  testing::TemporaryFolder folder;
};

std::string Whip(const std::string& root) {
  static const Whips whips;
  return whips.folder / (root + ".toml");
}

RobustnessStudy StudyOf(const std::string& root) {
  RobustnessStudy study;
  study.motion = Whip(root);
  study.scale = 1.5;
  return study;
}

TEST(Whip, ARunIsJudgedByItsTipAlsoBeforeTheMotionEnds) {
  const testing::TemporaryFolder folder;
  const testing::Outcome run =
      RunProgram({"tumbler run", "sim", Whip("fixed"), "--json", folder / "run.json"});
  EXPECT_EQ(run.exit_code, 0) << run.text;
  EXPECT_THAT(run.text,
              AllOf(HasSubstr("root fixed: as asked\n"),
                    HasSubstr("point_x of lower at (0, -0.2), at 0.9 s: asked 0.12, got "),
                    HasSubstr("point_x_rate of lower at (0, -0.2), settled: asked 0, got ")));
  const Json json = Json::Parse(testing::ReadFile(folder / "run.json")).value();
  EXPECT_EQ(json["as_asked"], true);
  EXPECT_EQ(json["purpose_met"], true);
  EXPECT_NEAR(json["passages"][0]["purpose"][0]["after_s"].number(), 0.9 - 1.2, 1e-3);
}

TEST(Whip, ARunThatEndsBeforeItCanBeJudgedIsNoSuccess) {
  // The rate is asked for where it has settled.
  const testing::Outcome run =
      RunProgram({"tumbler run", "sim", testing::SourcePath("primitives/hopper/hopper.toml"),
                  "--hold-s", "0"});
  EXPECT_EQ(run.exit_code, 4) << run.text;
  EXPECT_THAT(run.text, HasSubstr(": not judged, the run ended before\n"));
}

TEST(Whip, RobotsOnAFixedRootAndOnABarAreTheSameAndJudgedAlike) {
  const RobustnessResult fixed = RunStudy(StudyOf("fixed"), 40, 2);
  const RobustnessResult bar = RunStudy(StudyOf("bar"), 40, 2);
  const Share share = fixed.stands(), same = bar.stands();
  EXPECT_EQ(share.of, 40);
  EXPECT_EQ(same.of, 40);
  EXPECT_GT(share.count, 4) << ToText(fixed);
  EXPECT_LT(share.count, 36) << ToText(fixed);
  EXPECT_GE(share.value(), same.low) << ToText(fixed) << ToText(bar);
  EXPECT_LE(share.value(), same.high) << ToText(fixed) << ToText(bar);
}

TEST(Whip, LanesAndTwinAgreeOnPointsAndTimes) {
  RobustnessStudy study = StudyOf("bar");
  const RobustnessResult twin = RunStudy(study, 40, 2);
  study.lanes = true;
  const Agreement agreement = Compare(twin, RunStudy(study, 40, 2));
  EXPECT_GE(agreement.standing.count, 38) << ToText(agreement);
}

TEST(Whip, AChainJudgesThePurposeOfEachMotion) {
  for (const std::string root : {"fixed", "bar"}) {
    const std::string text = testing::ReadFile(Whip(root));
    const auto play = [](const std::string& primitive, double last_hold_s) {
      const SimulatedMotion motion(
          LoadMotion("whip.toml", [&](const std::string& /*path*/) { return primitive; }));
      ChainOptions options;
      options.last_hold_s = last_hold_s;
      return SimulateChain(motion, options);
    };
    const ChainOutcome chain = play(text, 2);
    ASSERT_FALSE(chain.failure) << chain.failure->text;
    ASSERT_EQ(chain.passages.at(0).purpose.size(), 2U);
    for (const JudgedTarget& judged : chain.passages[0].purpose) {
      EXPECT_EQ(judged.met(), true) << judged.name();
      EXPECT_NEAR(*judged.result, judged.target.target, 0.5 * judged.target.tolerance)
          << judged.name();
    }
    EXPECT_EQ(play(text, 0).CountJudged().not_judged, 1) << "it ends before it has settled";
    PrimitiveFile heavier = ParsePrimitive(text, "whip.toml");
    heavier.provenance.robot_urdf =
        Replaced(heavier.provenance.robot_urdf, "mass value=\"0.2\"", "mass value=\"0.21\"");
    heavier.provenance.robot_hash = HashOfText(heavier.provenance.robot_urdf);
    const ChainOutcome missed = play(ToToml(heavier), 2);
    ASSERT_TRUE(missed.failure);
    EXPECT_EQ(missed.failure->cause, ChainFailure::Cause::kPurpose);
    EXPECT_THAT(missed.failure->text, AllOf(HasSubstr("point_x of lower"), HasSubstr(": MISSED")));
  }
}

/// A run of the whip on a fixed root, with its record.
struct Recorded {
  Recorded() {
    const testing::Outcome run = RunProgram({"tumbler run", "sim", Whip("fixed"), "--record",
                                             folder / "run.rec", "--json", folder / "run.json"});
    EXPECT_EQ(run.exit_code, 0) << run.text;
  }
  testing::TemporaryFolder folder;
};
const Recorded& TheRun() {
  static const Recorded run;
  return run;
}

TEST(WhipsTruth, TheTipIsDrawnWhereItWasJudged) {
  const Json json = Json::Parse(testing::ReadFile(TheRun().folder / "run.json")).value();
  const double judged_m = json["passages"][0]["purpose"][0]["result"].number();
  const RunData run = ReadRun(TheRun().folder / "run.rec", "");
  ASSERT_EQ(run.passive_names, std::vector<std::string>{"pin"});
  ASSERT_EQ(run.scene.links.size(), 3U);  // the fixed root first
  EXPECT_EQ(run.scene.links[2].name, "lower");
  const auto at = std::ranges::find_if(
      run.truth, [](const ReportSample& sample) { return sample.time_s > 0.9 - 1e-6; });
  ASSERT_NE(at, run.truth.end());
  const auto tip_m = [](const ReportSample& sample) {
    const auto& [x, z, pitch] = sample.link_poses[2];
    return x + 0.2 * std::sin(pitch);
  };
  // There is a truth every 5 ms, in which the tip moves by some millimetres.
  EXPECT_NEAR(tip_m(*at), judged_m, 0.01);
  EXPECT_NEAR(at->link_poses[1][2], at->passive_positions_rad.at(0), 1e-9);
  double most_rad = 0;
  for (const ReportSample& sample : run.truth)
    most_rad = std::max(most_rad, std::abs(sample.passive_positions_rad.at(0)));
  EXPECT_GT(most_rad, 0.2) << "it swings";
}

TEST(WhipsTruth, ATableOfItHasTheJointWithoutAMotor) {
  const std::string csv = TheRun().folder / "truth.csv";
  EXPECT_EQ(
      RunProgram({"tumbler record", TheRun().folder / "run.rec", "--truth-csv", csv}).exit_code, 0);
  const std::string text = testing::ReadFile(csv);
  EXPECT_THAT(text.substr(0, text.find('\n')),
              HasSubstr("elbow_torque_nm,pin_position_rad,pin_velocity_rad_s,pin_torque_nm"));
}

TEST(WhipsTruth, ATruthWithoutTheJointIsOfARobotThatHangsAsAtTheStart) {
  truth_t truth{};
  truth.joints.resize(1);
  truth.joints[0].name = "elbow";
  EXPECT_TRUE(PassiveOf(truth, {"pin"}).empty());
  RobotPaths paths(LoadMotion(Whip("fixed")));
  const std::vector<double> elbow = {0.0};
  EXPECT_EQ(paths.Pose({}, elbow, PassiveOf(truth, {"pin"})).link_poses[1][2], 0);
  truth.joints.push_back(truth.joints[0]);
  truth.joints[1].name = "pin";
  truth.joints[1].position_rad = 1.25;
  EXPECT_EQ(paths.Pose({}, elbow, PassiveOf(truth, {"pin"})).link_poses[1][2], 1.25);
}

TEST(WhipsTruth, AViewOfTheRunDrawsItsRodsAsTheyAre) {
  ViewedRobot robot(LoadMotion(Whip("fixed")));
  state_t state{};
  state.joints.resize(1);
  state.joint_count = 1;
  state.primitive_time_s = 0.9F;
  state.state = static_cast<std::int8_t>(ExecutorState::kRunning);
  robot.Take(state);
  const double planned = robot.Poses()[1][2].number();
  EXPECT_GT(std::abs(planned), 0.1) << "as the plan has it";
  truth_t truth{};
  truth.joints.resize(2);
  truth.joints[0].name = "elbow";
  truth.joints[1].name = "pin";
  truth.joints[1].position_rad = 3;
  truth.joint_count = 2;
  robot.Take(truth);
  EXPECT_EQ(robot.Poses()[1][2].number(), 3);
  EXPECT_EQ(robot.Poses()[2][1].number(), std::round(1e4 * -0.2 * std::cos(3.0)) / 1e4);
}

TEST(WhipsTruth, ARobotThatSwingsDoesNotRest) {
  // Without torque its elbow comes to rest long before its pin does.
  const SimulatedMotion motion(LoadMotion(Whip("fixed")));
  PostureWatch watch(motion.file(), {}, StartOf(motion.file()));
  TwinState state;
  state.joint_positions_rad = state.joint_velocities_rad_s = {0};
  state.passive_positions_rad = {0};
  state.passive_velocities_rad_s = {0.5};
  const auto look = [&](int ms) {
    for (int i = 0; i < ms; ++i) {
      state.time_ns += 1'000'000;
      watch.Observe(state, {}, {true, false});
    }
  };
  look(500);
  EXPECT_EQ(watch.resting_as(), "");
  EXPECT_TRUE(watch.events().empty());
  state.passive_velocities_rad_s = {0};
  look(500);
  EXPECT_NE(watch.resting_as(), "");
  state.passive_positions_rad = {3};
  look(500);
  EXPECT_EQ(watch.resting_as(), "") << "it stands on its head";
  EXPECT_EQ(watch.falls(), 0) << "which is no fall";
}

}  // namespace
}  // namespace tumbler
