// A robot with a joint without a motor, on a fixed root, from its task to the share of robots: what
// is asked of a point of a link and in the motion is judged in the twin, in lanes and in the chain.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/json.h"
#include "common/primitive_hash.h"
#include "common/primitive_toml.h"
#include "offline/chain/chain.h"
#include "offline/rehearsal/robustness/lane_trials.h"
#include "offline/rehearsal/robustness/study.h"
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
      const testing::Outcome found = RunProgram({"tumbler-optimize", folder / (name + "_task.toml"),
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
      RunProgram({"tumbler-run", "sim", Whip("fixed"), "--json", folder / "run.json"});
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
      RunProgram({"tumbler-run", "sim", testing::SourcePath("primitives/hopper/hopper.toml"),
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

}  // namespace
}  // namespace tumbler
