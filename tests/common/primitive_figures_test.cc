// What a primitive says of robots and of ground that were tried.

#include "common/files/primitive_toml.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

#include "common/files/primitive_hash.h"
#include "common/files/primitive_limits.h"
#include "common/files/share.h"
#include "common/files/toml_reader.h"
#include "tests/support/complete_primitive.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

RobustnessFigure ExampleFigure() {
  RobustnessFigure figure;
  figure.motion = "wave";
  figure.stand = 97;
  figure.robots = 100;
  const Share share = ShareOf(97, 100);
  figure.share_95_low = share.low;
  figure.share_95_high = share.high;
  figure.seed = 5;
  figure.spreads = "--mass 0.05";
  figure.drives_file = "drives.toml";
  figure.drives_hash = HashOfText("drives");
  return figure;
}

TEST(PrimitiveToml, AFigureOfRobotsIsReadBackAndPartOfTheHash) {
  PrimitiveFile file = testing::PrimitiveExample();
  file.robustness = {ExampleFigure()};
  const PrimitiveFile read = ParsePrimitive(ToToml(file), "p.toml");
  ASSERT_EQ(read.robustness.size(), 1U);
  EXPECT_EQ(read.robustness[0].stand, 97);
  EXPECT_EQ(read.robustness[0].seed, 5U);
  EXPECT_EQ(read.robustness[0].share_95_low, file.robustness[0].share_95_low);
  EXPECT_EQ(ToText(read.robustness[0]),
            "wave: 97 of 100 robots: 97.0 % (95 %: 91.5 ... 99.0 %); scale 1 (--mass 0.05), seed "
            "5, in the twin, drives.toml");
  EXPECT_NE(ContentHash(file), ContentHash(testing::PrimitiveExample()));
  EXPECT_THROW(ParsePrimitive(testing::Replaced(ToToml(file), "seed = 5", "seed = 6"), "p.toml"),
               FileError);
}

TEST(PrimitiveToml, AFigureOfRobotsThatContradictsItselfIsRefused) {
  const auto refusal = [](const RobustnessFigure& figure) {
    PrimitiveFile file = testing::PrimitiveExample();
    file.robustness = {figure};
    std::string said = "taken";
    try {
      ToToml(file);
    } catch (const std::invalid_argument& error) {
      said = error.what();
    }
    return said;
  };
  EXPECT_EQ(refusal(ExampleFigure()), "taken");
  RobustnessFigure more = ExampleFigure();
  more.stand = 101;
  EXPECT_THAT(refusal(more), HasSubstr("stand: is 101; allowed: up to robots, which is 100"));
  RobustnessFigure better = ExampleFigure();
  better.share_95_low = 0.96;
  EXPECT_THAT(refusal(better), HasSubstr("share_95_low: is 0.96, but the interval of stand"));
  RobustnessFigure none = ExampleFigure();
  none.robots = 0;
  EXPECT_THAT(refusal(none), HasSubstr("robots: is 0"));
  RobustnessFigure nameless = ExampleFigure();
  nameless.drives_file = "";
  EXPECT_THAT(refusal(nameless), HasSubstr("drives_hash"));
}

TEST(PrimitiveToml, AChangeByHandTakesTheFiguresOfRobotsAway) {
  PrimitiveFile file = testing::PrimitiveExample();
  file.robustness = {ExampleFigure()};
  const std::string edited = testing::Replaced(ToToml(file), "-0.4375", "-0.4376");
  EXPECT_TRUE(ParsePrimitive(SignEdited(edited, "p.toml", "wider"), "p.toml").robustness.empty());
}

GroundWindow ExampleWindow() {
  GroundWindow window;
  window.mu = {0.12, 0.61};
  window.mu_scanned = {0.05, 2};
  window.stiffness_n_per_m = {1250, 31000};
  window.stiffness_scanned_n_per_m = {1250, 5e5};
  window.damping_n_s_per_m = {5, 2000};
  window.damping_scanned_n_s_per_m = {5, 2000};
  window.hold_s = 2;
  return window;
}

TEST(PrimitiveToml, AWindowOfTheGroundIsReadBackAndPartOfTheHash) {
  PrimitiveFile file = testing::PrimitiveExample();
  EXPECT_FALSE(ParsePrimitive(ToToml(file), "p.toml").window) << "nobody has to look";
  file.window = ExampleWindow();
  const PrimitiveFile read = ParsePrimitive(ToToml(file), "p.toml");
  ASSERT_TRUE(read.window);
  EXPECT_EQ(read.window->mu, file.window->mu);
  EXPECT_EQ(read.window->damping_scanned_n_s_per_m, file.window->damping_scanned_n_s_per_m);
  EXPECT_EQ(read.window->where, RobustnessFigure::Where::kLanes);
  EXPECT_NE(ContentHash(file), ContentHash(testing::PrimitiveExample()));
  EXPECT_THROW(ParsePrimitive(testing::Replaced(ToToml(file), "0.61", "0.62"), "p.toml"),
               FileError);
}

TEST(PrimitiveToml, AnEndOfAWindowAtTheScansLimitIsSaidToReachAtLeastSoFar) {
  const auto lines = WindowLines(ExampleWindow());
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0].second, "0.12 to 0.61; in lanes, default drives");
  EXPECT_EQ(lines[1].second, "1250 or less to 31000 N/m; in lanes, default drives");
  EXPECT_EQ(lines[2].second, "5 or less to 2000 or more N s/m; in lanes, default drives");
}

TEST(PrimitiveToml, AWindowThatContradictsItselfIsRefused) {
  const auto refusal = [](const std::function<void(GroundWindow&)>& change) {
    PrimitiveFile file = testing::PrimitiveExample();
    file.window = ExampleWindow();
    change(*file.window);
    std::string said = "taken";
    try {
      ToToml(file);
    } catch (const std::invalid_argument& error) {
      said = error.what();
    }
    return said;
  };
  EXPECT_EQ(refusal([](GroundWindow&) {}), "taken");
  EXPECT_THAT(refusal([](GroundWindow& window) { window.mu[1] = 2.5; }),
              HasSubstr("window.mu: goes from 0.12 to 2.5; allowed: upwards, within what was "
                        "scanned, which is 0.05 to 2"));
  EXPECT_THAT(refusal([](GroundWindow& window) { std::swap(window.mu[0], window.mu[1]); }),
              HasSubstr("window.mu: goes from 0.61 to 0.12"));
  EXPECT_THAT(refusal([](GroundWindow& window) { window.stiffness_n_per_m[0] = 1000; }),
              HasSubstr("window.stiffness_n_per_m: goes from 1000"));
  EXPECT_THAT(refusal([](GroundWindow& window) { window.damping_n_s_per_m[0] = 0; }),
              HasSubstr("damping_n_s_per_m"));
  EXPECT_THAT(refusal([](GroundWindow& window) { window.drives_file = "drives.toml"; }),
              HasSubstr("window.drives_hash"));
}

TEST(PrimitiveToml, AChangeByHandTakesTheWindowAway) {
  PrimitiveFile file = testing::PrimitiveExample();
  file.window = ExampleWindow();
  const std::string edited = testing::Replaced(ToToml(file), "-0.4375", "-0.4376");
  EXPECT_FALSE(ParsePrimitive(SignEdited(edited, "p.toml", "wider"), "p.toml").window);
}

}  // namespace
}  // namespace tumbler
