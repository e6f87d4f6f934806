// Robots that differ from the model: how each is played, in the twin and in lanes.

#include "offline/studies/trial.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "offline/studies/certify.h"
#include "offline/studies/checkpoint.h"
#include "offline/studies/drop.h"
#include "offline/studies/lane_trials.h"
#include "offline/studies/look_ticks.h"
#include "offline/studies/robustness_page.h"
#include "offline/studies/study.h"
#include "tests/support/files.h"
#include "tests/support/robustness_study.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;
using ::testing::HasSubstr;

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

TEST(LaneTrials, RobotsWithWrongZerosRestAtTheStartAsInTheTwin) {
  RobustnessStudy study = StudyOf("nominal/handstand.toml");
  study.spreads = {.mass = 0, .friction = 0, .stiffness = 0, .damping = 0, .zero_rad = 0.01};
  const RobustnessResult twin = RunStudy(study, 64, 1);
  EXPECT_GE(twin.stands().count, 8);
  EXPECT_LE(twin.stands().count, 56) << "some have to fall for this to say anything";
  study.lanes = true;
  EXPECT_GE(Compare(twin, RunStudy(study, 64, 1)).standing.count, 62);
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

}  // namespace
}  // namespace tumbler
