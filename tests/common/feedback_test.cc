#include "common/core/feedback.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/primitive_rounding.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"
#include "tests/support/files.h"
#include "tests/support/primitive_file.h"
#include "tests/support/random_feedback.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::Replaced;

PrimitiveFile WithFeedback(unsigned seed, int knots = 5) {
  PrimitiveFile file = testing::RandomPrimitiveFile({}, seed);
  testing::AddRandomFeedback(file, knots, seed);
  return file;
}

// ---- The law ------------------------------------------------------------------------------------

TEST(FeedbackLaw, FadesInWhileTheErrorIsKnownAndOutWhileItIsNotWithinZeroAndOne) {
  Feedback<double> feedback = WithFeedback(1).primitive.feedback;
  feedback.fade_in_s = 0.5;
  feedback.fade_out_s = 0.25;
  EXPECT_EQ(NextShare(feedback, 0.25, true, 0.125), 0.5);
  EXPECT_EQ(NextShare(feedback, 0.75, false, 0.125), 0.25);
  EXPECT_EQ(NextShare(feedback, 0.9, true, 0.125), 1);
  EXPECT_EQ(NextShare(feedback, 0.1, false, 0.125), 0);
}

/// A gain at a time, by its definition: the sum of hats.
double HatSum(const std::vector<double>& knots, const std::vector<double>& values, double time_s) {
  const double t = std::min(std::max(time_s, knots.front()), knots.back());
  double sum = 0;
  for (std::size_t i = 0; i < knots.size(); ++i) {
    double hat = 0;
    if (t == knots[i]) hat = 1;
    if (i > 0 && t > knots[i - 1] && t < knots[i])
      hat = (t - knots[i - 1]) / (knots[i] - knots[i - 1]);
    if (i + 1 < knots.size() && t > knots[i] && t < knots[i + 1])
      hat = (knots[i + 1] - t) / (knots[i + 1] - knots[i]);
    sum += hat * values[i];
  }
  return sum;
}

TEST(FeedbackLaw, GainsAreSumsOfHatsAtAllTimesWhateverTheGuess) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> time(-0.2, 1.5);
  for (int knots = 2; knots <= kMaxGainKnots; ++knots) {
    const PrimitiveFile file = WithFeedback(static_cast<unsigned>(knots), knots);
    const Feedback<double>& feedback = file.primitive.feedback;
    const Feedback<float> rounded = ToRuntime(file.primitive).feedback;
    const std::vector<double> times(feedback.knots().begin(), feedback.knots().end());
    const auto& gain = feedback.joints[1].angle_gain;
    const std::vector<double> values(gain.begin(), gain.begin() + knots);
    for (int i = 0; i < 200; ++i) {
      const double t = i < knots ? times[static_cast<std::size_t>(i)] : time(random);
      const double expected = HatSum(times, values, t);
      for (const int guess : {-1, 0, knots / 2, knots - 1, knots + 5}) {
        EXPECT_NEAR(GainAt(gain, FindGains(feedback, t, guess)), expected, 1e-12) << t;
        EXPECT_NEAR(static_cast<double>(GainAt(rounded.joints[1].angle_gain,
                                               FindGains(rounded, static_cast<float>(t), guess))),
                    expected, 2e-5)
            << t;
      }
    }
    EXPECT_EQ(FindGains(feedback, std::numeric_limits<double>::quiet_NaN(), 1).knot, 0);
  }
}

TEST(FeedbackLaw, AnErrorGoesOnThroughHalfATurn) {
  for (int turns = -3; turns <= 3; ++turns) {
    for (double error = -3.1; error < 3.1; error += 0.01) {
      const double angle = error + turns * 2 * std::numbers::pi;
      EXPECT_NEAR(WithoutTurns(angle), error, 1e-12);
      EXPECT_NEAR(static_cast<double>(WithoutTurns(static_cast<float>(angle))), error, 1e-5);
    }
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(WithoutTurns(nan)));
  EXPECT_GT(WithoutTurns(1e9), 1e8);  // Not an angle; the search for its turn ends all the same.
}

TEST(FeedbackLaw, TheCorrectionIsTheOneOfItsDefinition) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> number(-1, 1);
  const PrimitiveFile file = WithFeedback(8);
  const Feedback<double>& feedback = file.primitive.feedback;
  const Feedback<float> rounded = ToRuntime(file.primitive).feedback;
  const JointFeedback<double>& joint = feedback.joints[0];
  for (int i = 0; i < 1000; ++i) {
    const double t = 0.6 + 0.6 * number(random), error = number(random), rate = number(random);
    const double share = 0.5 + 0.5 * number(random), before = 0.25 * number(random);
    const auto place = FindGains(feedback, t, 0);
    const double sum =
        GainAt(joint.angle_gain, place) * error + GainAt(joint.rate_gain, place) * rate;
    const double wanted = share * std::clamp(sum, -0.25, 0.25);
    EXPECT_NEAR(WantedCorrection(joint, place, error, rate, share), wanted, 1e-15);
    const double next = before + std::clamp(wanted - before, -0.005, 0.005);
    EXPECT_NEAR(NextCorrection(before, wanted, 5.0, 0.001), next, 1e-15);
    const auto place_f = FindGains(rounded, static_cast<float>(t), 0);
    const float wanted_f = WantedCorrection(rounded.joints[0], place_f, static_cast<float>(error),
                                            static_cast<float>(rate), static_cast<float>(share));
    EXPECT_NEAR(static_cast<double>(wanted_f), wanted, 2e-6);
  }
}

TEST(FeedbackLaw, AnErrorAsksForAShareThatGrowsFromTheDeadZoneToItsEnd) {
  Feedback<double> feedback;
  EXPECT_EQ(ErrorShare(feedback, 0.0), 1) << "without a dead zone everything is corrected";
  EXPECT_EQ(ErrorShare(feedback, 1e-300), 1);
  feedback.error_min_rad = feedback.error_full_rad = 0.1;
  EXPECT_EQ(ErrorShare(feedback, 0.0999), 0);
  EXPECT_EQ(ErrorShare(feedback, -0.1), 1) << "a step where there is no ramp";
  feedback.error_full_rad = 0.3;
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_EQ(ErrorShare(feedback, sign * 0.1), 0);
    EXPECT_NEAR(ErrorShare(feedback, sign * 0.15), 0.25, 1e-15);
    EXPECT_NEAR(ErrorShare(feedback, sign * 0.2), 0.5, 1e-15);
    EXPECT_EQ(ErrorShare(feedback, sign * 0.3), 1);
    EXPECT_EQ(ErrorShare(feedback, sign * 3.0), 1);
  }
}

// ---- The file -----------------------------------------------------------------------------------

TEST(FeedbackFile, RoundTripsBitForBit) {
  for (const int knots : {2, 5, kMaxGainKnots}) {
    const PrimitiveFile file = WithFeedback(static_cast<unsigned>(knots) + 20, knots);
    const std::string text = ToToml(file);
    const PrimitiveFile read = ParsePrimitive(text, "p.toml");
    EXPECT_EQ(ToToml(read), text);
    const Feedback<double>& a = file.primitive.feedback;
    const Feedback<double>& b = read.primitive.feedback;
    EXPECT_EQ(a.link.view(), b.link.view());
    EXPECT_EQ(a.knot_count, b.knot_count);
    EXPECT_EQ(a.knots_s, b.knots_s);
    EXPECT_TRUE(std::ranges::equal(a.angle.control_points(), b.angle.control_points()));
    EXPECT_EQ(a.error_min_rad, b.error_min_rad);
    EXPECT_EQ(a.error_full_rad, b.error_full_rad);
    EXPECT_EQ(a.error_max_rad, b.error_max_rad);
    EXPECT_EQ(a.start_error_max_rad, b.start_error_max_rad);
    EXPECT_EQ(a.fade_in_s, b.fade_in_s);
    EXPECT_EQ(a.fade_out_s, b.fade_out_s);
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_EQ(a.joints[j].chain, b.joints[j].chain);
      EXPECT_EQ(a.joints[j].angle_gain, b.joints[j].angle_gain);
      EXPECT_EQ(a.joints[j].rate_gain, b.joints[j].rate_gain);
      EXPECT_EQ(a.joints[j].correction_max_rad, b.joints[j].correction_max_rad);
      EXPECT_EQ(a.joints[j].correction_rate_max_rad_s, b.joints[j].correction_rate_max_rad_s);
    }
    ASSERT_EQ(read.chains.size(), 2U);
    EXPECT_EQ(read.chains[1].joints, (std::vector<double>{0, 1}));
  }
}

TEST(FeedbackFile, WithoutFeedbackTheTextHasNoWordOfIt) {
  const PrimitiveFile file = testing::RandomPrimitiveFile({}, 1);
  EXPECT_EQ(ToToml(file).find("feedback"), std::string::npos);
  EXPECT_FALSE(ParsePrimitive(ToToml(file), "p.toml").primitive.feedback.present());
  EXPECT_FALSE(ToRuntime(file.primitive).feedback.present());
}

TEST(FeedbackFile, TheHashOfThePrimitiveCoversEveryNumberOfIt) {
  const std::string text = ToToml(WithFeedback(4));
  for (const char* const part :
       {"error_min_rad = 0.06", "error_full_rad = 0.1", "error_max_rad = 0.7", "fade_in_s = 0.0",
        "fade_out_s = 0.", "correction_max_rad = 0.2"}) {
    const std::string edited = Replaced(text, part, std::string(part) + "1");
    EXPECT_THROW(
        {
          try {
            ParsePrimitive(edited, "p.toml");
          } catch (const FileError& error) {
            EXPECT_THAT(error.what(), HasSubstr("content_hash"));
            throw;
          }
        },
        FileError)
        << part;
  }
}

TEST(FeedbackFile, IsRefusedWithTheKeyAndTheCause) {
  struct Refusal {
    std::string from, to, fragment;
  };
  const std::string text = ToToml(WithFeedback(6));
  const std::vector<Refusal> refusals = {
      {"link = \"last_link\"", "link = \"other\"", "feedback.link: is 'other'"},
      {"error_min_rad = 0.0625", "error_min_rad = 0.13", "to error_full_rad"},
      {"error_min_rad = 0.0625", "error_min_rad = -1", "feedback.error_min_rad"},
      {"error_full_rad = 0.125", "error_full_rad = 0.8", "to error_max_rad"},
      {"error_max_rad = 0.75", "error_max_rad = 4", "feedback.error_max_rad"},
      {"error_max_rad = 0.75", "error_max_rad = nan", "feedback.error_max_rad"},
      {"start_error_max_rad = 0.25", "start_error_max_rad = 0.8", "to error_max_rad"},
      {"fade_in_s = 0.05", "fade_in_s = 0", "feedback.fade_in_s"},
      {"fade_out_s = 0.1", "fade_out_s = inf", "feedback.fade_out_s"},
      {"knots_s = [\n  0.0, 0.3", "knots_s = [\n  0.1, 0.3", "knots_s: goes from 0.1"},
      {"knots_s = [\n  0.0, 0.3", "knots_s = [\n  0.0, 0.0", "knot 1 is 0.0"},
      {"knots_s = [\n  0.0, 0.3", "knots_s = [\n  0.0, 0.2, 0.3", "holds 5 numbers; expected 6"},
      {"name = \"joint1\"\nangle_gains", "name = \"joint2\"\nangle_gains",
       "feedback.joint[0].name"},
      {"angle_gains_rad_per_rad = [", "angle_gains_rad_per_rad = [ 21,",
       "feedback.joint[0].angle_gains_rad_per_rad"},
      {"rate_gains_rad_per_rad_s = [", "rate_gains_rad_per_rad_s = [ 1,",
       "holds 6 numbers; expected 5"},
      {"correction_max_rad = 0.25", "correction_max_rad = 1.5", "correction_max_rad"},
      {"correction_rate_max_rad_s = 5.0", "correction_rate_max_rad_s = 0",
       "correction_rate_max_rad_s"},
      {"joints = [0.0, 1.0]", "joints = [0.0, 0.5]", "allowed: 1, -1 or 0"},
      {"joints = [0.0, 1.0]", "joints = [1.0]", "holds 1 numbers; expected 2"},
      {"link = \"root_link\"", "link = \"last_link\"", "as of an earlier chain"},
      {"fade_in_s = 0.05", "fade_in = 0.05", "feedback.fade_in"},
  };
  for (const Refusal& refusal : refusals) {
    const std::string bad = Replaced(text, refusal.from, refusal.to);
    try {
      ParsePrimitive(bad, "p.toml");
      ADD_FAILURE() << refusal.to << " was accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(std::string(error.what()), HasSubstr(refusal.fragment));
      EXPECT_THAT(std::string(error.what()), ::testing::StartsWith("p.toml:"));
    }
  }
}

TEST(FeedbackFile, TheWriterRefusesWhatNoProgramWouldLoad) {
  const std::vector<std::function<void(PrimitiveFile&)>> damages = {
      [](auto& f) { f.primitive.feedback.knot_count = kMaxGainKnots + 1; },
      [](auto& f) { f.primitive.feedback.knot_count = -1; },
      [](auto& f) { f.primitive.feedback.knot_count = 1; },
      [](auto& f) { f.primitive.feedback.knots_s[1] = 0; },
      [](auto& f) {
        f.primitive.feedback.joints[0].angle_gain[0] = std::numeric_limits<double>::quiet_NaN();
      },
      [](auto& f) { f.chains.pop_back(); },
      [](auto& f) { f.primitive.feedback.link = {}; }};
  for (std::size_t i = 0; i < damages.size(); ++i) {
    PrimitiveFile file = WithFeedback(2);
    damages[i](file);
    EXPECT_THROW(ToToml(file), std::invalid_argument) << i;
  }
}

TEST(FeedbackToRuntime, RoundsEveryNumberToTheNearestFloatOrRefusesIt) {
  PrimitiveFile file = WithFeedback(12);
  const Feedback<double>& exact = file.primitive.feedback;
  const Feedback<float> rounded = ToRuntime(file.primitive).feedback;
  EXPECT_EQ(rounded.link.view(), exact.link.view());
  ASSERT_EQ(rounded.knot_count, exact.knot_count);
  for (std::size_t i = 0; i < exact.knots().size(); ++i) {
    EXPECT_EQ(rounded.knots_s[i], static_cast<float>(exact.knots_s[i]));
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_EQ(rounded.joints[j].angle_gain[i], static_cast<float>(exact.joints[j].angle_gain[i]));
      EXPECT_EQ(rounded.joints[j].rate_gain[i], static_cast<float>(exact.joints[j].rate_gain[i]));
    }
  }
  EXPECT_EQ(rounded.knots().back(), ToRuntime(file.primitive).duration_s);
  EXPECT_EQ(rounded.error_min_rad, 0.0625F);
  EXPECT_EQ(rounded.error_full_rad, 0.125F);
  EXPECT_EQ(rounded.error_max_rad, 0.75F);
  EXPECT_EQ(rounded.fade_out_s, 0.1F);
  EXPECT_EQ(rounded.joints[1].chain, 1.0F);
  file.primitive.feedback.knots_s[1] = 1e-60;
  file.primitive.feedback.knots_s[2] = 2e-60;
  EXPECT_THROW((void)ToRuntime(file.primitive), std::invalid_argument);
}

}  // namespace
}  // namespace tumbler
