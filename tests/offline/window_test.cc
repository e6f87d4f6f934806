// On which ground the model itself is as asked: the scan, and the windows of motions.

#include "offline/studies/window.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "common/files/program.h"
#include "offline/studies/study.h"
#include "tests/support/files.h"
#include "tests/support/program.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

std::string Shipped(const std::string& name) { return testing::SourcePath("primitives/" + name); }

/// A scan that takes a fraction of the time, for tests to which its ends do not matter.
constexpr WindowScan kCoarse{.steps = 4, .parts = 2, .map_mu = 4, .map_stiffness = 2};

/// A scan of a number that is as asked within `from` to `to`, and beyond `again`.
Scan ScanOf(double from, double to, double again = 1e9) {
  return ScanAround(1, {0.05, 20}, 24, 9, [&](const std::vector<double>& values) {
    std::vector<bool> stand;
    for (const double value : values)
      stand.push_back((from <= value && value <= to) || value >= again);
    return stand;
  });
}

TEST(Scan, FindsBothEndsToTwoPerCentWhereverTheyAre) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> logarithm(std::log(0.06), std::log(16.0));
  for (int i = 0; i < 200; ++i) {
    const double from = std::exp(-std::abs(logarithm(random))) * 0.99;
    const double to = std::exp(std::abs(logarithm(random))) * 1.01;
    if (from < 0.05 || to > 20) continue;
    const Scan scan = ScanOf(from, to);
    EXPECT_GE(scan.ends[0], from);
    EXPECT_LE(scan.ends[1], to);
    ASSERT_TRUE(scan.beyond[0] && scan.beyond[1]);
    EXPECT_LT(*scan.beyond[0], from);
    EXPECT_GT(*scan.beyond[1], to);
    EXPECT_LT(scan.ends[0] / *scan.beyond[0], 1.02);
    EXPECT_LT(*scan.beyond[1] / scan.ends[1], 1.02);
  }
}

TEST(Scan, HasNothingBeyondAWindowThatReachesTheLimit) {
  const Scan wide = ScanOf(0.01, 100);
  EXPECT_EQ(wide.ends[0], 0.05);
  EXPECT_EQ(wide.ends[1], 20);
  EXPECT_FALSE(wide.beyond[0] || wide.beyond[1]);
  const Scan low = ScanOf(0.01, 2);
  EXPECT_EQ(low.ends[0], 0.05);
  EXPECT_TRUE(low.beyond[1]);
}

TEST(Scan, StopsAtAGapAndSaysWhatIsAsAskedBehindIt) {
  const Scan scan = ScanOf(0.5, 2, 10);
  EXPECT_LE(scan.ends[1], 2);
  ASSERT_FALSE(scan.again.empty());
  EXPECT_GE(scan.again.front(), 10);
  EXPECT_EQ(scan.again.back(), 20);
  EXPECT_TRUE(ScanOf(0.5, 2).again.empty());
}

TEST(Scan, OfAModelThatIsAloneAsAskedIsTheModel) {
  const Scan scan = ScanOf(1, 1);
  EXPECT_EQ(scan.ends[0], 1);
  EXPECT_EQ(scan.ends[1], 1);
}

TEST(Window, OfTheHandstandEndsInLanesWhereItDoesInTheTwin) {
  RobustnessStudy study;
  study.motion = Shipped("handstand.toml");
  const WindowResult result = FindWindows(study, 2);
  EXPECT_TRUE(result.study.lanes);
  ASSERT_EQ(result.windows.size(), kGroundProperties.size());
  const PropertyWindow& friction = result.windows[0];
  EXPECT_EQ(friction.model, 0.3);
  EXPECT_NEAR(friction.ends[1], 0.6, 0.1) << "more friction fells it";
  ASSERT_TRUE(friction.beyond[1]);
  EXPECT_TRUE(friction.beyond[1]->outcome.fails());
  Trials twin(study);
  int ends = 0;
  for (const PropertyWindow& window : result.windows) {
    const auto stands_at = [&](double value) {
      RobotVariation robot = twin.Model();
      robot.*window.property.factor = value / window.model;
      return twin.Play(robot).stands();
    };
    for (std::size_t side = 0; side < 2; ++side) {
      if (!window.beyond[side]) {
        EXPECT_TRUE(stands_at(window.ends[side]))
            << "the limit of the scan: " << window.property.name << " " << window.ends[side];
        continue;
      }
      ++ends;
      const double outwards = side == 0 ? 0.95 : 1.05;
      EXPECT_TRUE(stands_at(window.ends[side] / outwards))
          << window.property.name << " " << window.ends[side];
      EXPECT_FALSE(stands_at(window.beyond[side]->value * outwards))
          << window.property.name << " " << window.beyond[side]->value;
    }
  }
  EXPECT_GE(ends, 2);
  ASSERT_TRUE(result.map);
  EXPECT_EQ(result.map->verdicts.size(), result.map->stiffness_n_per_m.size());
  EXPECT_EQ(result.map->verdicts[0].size(), result.map->mu.size());
}

TEST(Window, IsThatOfTheModelWhateverRobotsTheStudyIsOfAndOfAnyNumberOfThreads) {
  RobustnessStudy study;
  study.motion = Shipped("nominal/downstand.toml");
  const Json once = ToJson(FindWindows(study, 1, kCoarse));
  study.seed = 9;
  study.spreads.friction = GroundSpread::Between{0.1, 2};
  EXPECT_EQ(ToJson(FindWindows(study, 2, kCoarse)), once);
}

TEST(Window, OfAMotionThatLanesDoNotHaveIsFoundInTheTwinAndSaysSo) {
  RobustnessStudy study;
  study.motion = Shipped("nominal/downstand.toml");
  study.twin = Shipped("robots/tumbler_twin.toml");
  const WindowResult result = FindWindows(study, 2, {.steps = 1, .parts = 1});
  EXPECT_FALSE(result.study.lanes);
  EXPECT_FALSE(result.map);
  EXPECT_THAT(ToText(result), HasSubstr("lanes do not simulate what twin files ask for"));
  EXPECT_THAT(WindowLines(WindowOf(result)).front().second, HasSubstr("in the twin"));
}

TEST(Window, OfAModelThatIsNotAsAskedIsNoneAndNothingIsCertified) {
  const testing::TemporaryFolder folder;
  const std::string motion = folder / "handstand.toml", drives = folder / "drives.toml";
  testing::WriteFile(motion, testing::ReadFile(Shipped("handstand.toml")));
  std::string soft = testing::ReadFile(Shipped("robots/tumbler_drives.toml"));
  for (const auto& [from, to] : {std::pair<std::string, std::string>{"kp_nm_per_rad = 40.0", "1.0"},
                                 {"kd_nm_s_per_rad = 5.0", "0.5"}}) {
    const std::string key = from.substr(0, from.find("= ") + 2);
    for (std::size_t at = 0; (at = soft.find(from, at)) != std::string::npos; ++at)
      soft.replace(at, from.size(), key + to);
  }
  testing::WriteFile(drives, soft);
  const std::string before = testing::ReadFile(motion);
  const testing::Outcome outcome = testing::RunProgram(
      {"tumbler robustness", motion, "--window", "--drives", drives, "--certify"});
  EXPECT_EQ(outcome.exit_code, 4) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("the model itself is not as asked, so there is no window"));
  EXPECT_THAT(outcome.text, HasSubstr("nothing was certified"));
  EXPECT_EQ(testing::ReadFile(motion), before);
}

TEST(Window, GoesIntoThePrimitiveAndOnItsPageAndANewerOneTakesItsPlace) {
  const testing::TemporaryFolder folder;
  const std::string motion = folder / "downstand.toml";
  PrimitiveFile before = LoadPrimitive(Shipped("nominal/downstand.toml"));
  before.window.reset();
  testing::WriteFile(motion, ToToml(before));
  RobustnessStudy study;
  study.motion = motion;
  for (const double hold_s : {2.0, 2.5}) {
    study.run.hold_s = hold_s;
    EXPECT_EQ(CertifyWindow(FindWindows(study, 2, kCoarse)), motion);
    const PrimitiveFile after = LoadPrimitive(motion);
    ASSERT_TRUE(after.window);
    EXPECT_EQ(after.window->hold_s, hold_s);
    EXPECT_LE(after.window->mu[0], 0.3);
    EXPECT_GE(after.window->mu[1], 0.3);
    EXPECT_EQ(after.robustness.size(), before.robustness.size());
    PrimitiveFile without = after;
    without.window.reset();
    EXPECT_EQ(ContentHash(without), ContentHash(before)) << "the rest is as it was";
  }
  const testing::Outcome page =
      testing::RunProgram({"tumbler view", motion, "--out", folder / "page"});
  EXPECT_EQ(page.exit_code, 0) << page.text;
  EXPECT_THAT(testing::ReadFile(folder / "page/index.html"), HasSubstr("as asked with stiffness"));
}

TEST(Window, IsNotWrittenIntoAMotionThatWasReplacedSince) {
  const testing::TemporaryFolder folder;
  RobustnessStudy study;
  study.motion = folder / "downstand.toml";
  testing::WriteFile(study.motion, testing::ReadFile(Shipped("nominal/downstand.toml")));
  const WindowResult result = FindWindows(study, 2, kCoarse);
  const std::string other = testing::ReadFile(Shipped("downstand.toml"));
  testing::WriteFile(study.motion, other);
  EXPECT_THROW(CertifyWindow(result), Refused);
  EXPECT_EQ(testing::ReadFile(study.motion), other);
}

TEST(Window, OfASequenceIsThatOfTheWholeAndIsNotWrittenIntoItsPrimitives) {
  const testing::Outcome refused =
      testing::RunProgram({"tumbler robustness", Shipped("nominal/gait.toml"), "--window",
                           "--cycles", "1", "--certify"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.text, HasSubstr("--certify: a window is written into a primitive"));
  RobustnessStudy gait;
  gait.motion = Shipped("nominal/gait.toml");
  gait.run.cycles = 1;
  const WindowResult result = FindWindows(gait, 2, kCoarse);
  ASSERT_FALSE(result.windows.empty()) << ToText(result);
  EXPECT_THAT(ToText(result), HasSubstr("1 cycles"));
  EXPECT_THROW(CertifyWindow(result), Refused);
}

TEST(Window, IsShownOfThePrimitivesOfASequence) {
  const testing::TemporaryFolder folder;
  for (const auto& entry : std::filesystem::directory_iterator(Shipped("nominal"))) {
    std::filesystem::copy(entry.path(),
                          std::filesystem::path(folder / "") / entry.path().filename());
  }
  PrimitiveFile handstand = LoadPrimitive(folder / "handstand.toml");
  GroundWindow& window = handstand.window.emplace();
  window.mu = window.mu_scanned = {0.2, 0.4};
  window.stiffness_n_per_m = window.stiffness_scanned_n_per_m = {1e4, 1e5};
  window.damping_n_s_per_m = window.damping_scanned_n_s_per_m = {50, 200};
  testing::WriteFile(folder / "handstand.toml", ToToml(handstand));
  const testing::Outcome chain =
      testing::RunProgram({"tumbler chain", "check", folder / "gait.toml"});
  EXPECT_EQ(chain.exit_code, 0) << chain.text;
  EXPECT_THAT(chain.text,
              HasSubstr("as asked with friction: 0.2 or less to 0.4 or more; in lanes"));
}

TEST(Window, IsInEveryShippedMotionThatTouchesTheGround) {
  for (const char* const name :
       {"handstand", "handstand_wide", "handstand_sensor", "handstand_sensor_mirrored", "downstand",
        "downstand_back", "downstand_back_mirrored", "roll", "roll_sensor", "stand", "rise",
        "rise_from_leg1", "rise_from_leg2", "nominal/handstand", "nominal/downstand",
        "nominal/roll", "hopper/hop_up"}) {
    EXPECT_TRUE(LoadPrimitive(Shipped(std::string(name) + ".toml")).window) << name;
  }
}

TEST(Window, OfTheWideHandstandGoesFromSlipperyToStickyAndFromSoftToHardGround) {
  const GroundWindow shipped = *LoadPrimitive(Shipped("handstand_wide.toml")).window;
  EXPECT_LT(shipped.mu[0], 0.12);
  EXPECT_GT(shipped.mu[1], 1.0);
  EXPECT_LT(shipped.stiffness_n_per_m[0], 1e4);
  EXPECT_GT(shipped.stiffness_n_per_m[1], 3.5e5);
  // Found again, each on its own.
  RobustnessStudy study;
  study.motion = Shipped("handstand_wide.toml");
  const WindowResult result = FindWindows(study, 2);
  ASSERT_EQ(result.windows.size(), 3U) << ToText(result);
  EXPECT_EQ(result.windows[0].ends, shipped.mu);
  EXPECT_EQ(result.windows[1].ends, shipped.stiffness_n_per_m);
  EXPECT_EQ(result.windows[2].ends, shipped.damping_n_s_per_m);
}

TEST(Window, TakesNoOptionsThatAreAboutRobots) {
  for (const std::vector<std::string>& more : {std::vector<std::string>{"--robots", "10"},
                                               {"--friction", "0.1..1"},
                                               {"--drops"},
                                               {"--scale", "2"},
                                               {"--push", "2"}}) {
    std::vector<std::string> command = {"tumbler robustness", Shipped("handstand.toml"),
                                        "--window"};
    command.insert(command.end(), more.begin(), more.end());
    const testing::Outcome refused = testing::RunProgram(command);
    EXPECT_EQ(refused.exit_code, 1) << more[0];
    EXPECT_THAT(refused.text, HasSubstr("leave out " + more[0]));
  }
}

TEST(Window, OfARobotWithoutGroundIsRefused) {
  const testing::Outcome refused =
      testing::RunProgram({"tumbler robustness", Shipped("acrobot/acrobot.toml"), "--window",
                           "--drives", Shipped("acrobot/drives.toml")});
  EXPECT_EQ(refused.exit_code, 2) << refused.text;
  EXPECT_THAT(refused.text, HasSubstr("there is no ground in its task"));
}

}  // namespace
}  // namespace tumbler
