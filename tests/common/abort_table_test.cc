// The table of aborts in a primitive's file.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/files/primitive_rounding.h"
#include "common/files/primitive_toml.h"
#include "common/files/toml_reader.h"
#include "tests/support/files.h"
#include "tests/support/random_aborts.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

PrimitiveFile ShippedHandstand() {
  PrimitiveFile file = LoadPrimitive(testing::SourcePath("primitives/handstand.toml"));
  file.primitive.aborts = {};
  return file;
}

/// A table with every way.
PrimitiveFile WithEveryWay() {
  PrimitiveFile file = ShippedHandstand();
  AbortTable<double>& aborts = file.primitive.aborts;
  aborts.span_count = 4;
  aborts.span_storage[0] = {0.125, AbortWay::kCatch, 0, 0, {}};
  aborts.span_storage[1] = {0.25, AbortWay::kFold, 0, 0.75, {-1.5, 1.25}};
  aborts.span_storage[2] = {0.5, AbortWay::kRollOut, 0.0078125, 0, {}};
  aborts.span_storage[3] = {file.primitive.duration_s, AbortWay::kDamp, 0, 0, {}};
  return file;
}

/// The text with something else in place of what is there, in its table of aborts or after it.
std::string EditedAborts(const std::string& text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from, text.find("[[abort]]"));
  EXPECT_NE(at, std::string::npos) << from;
  return fmt::format("{}{}{}", text.substr(0, at), to, text.substr(at + from.size()));
}

template <typename Scalar>
void ExpectSameTable(const AbortTable<Scalar>& a, const AbortTable<Scalar>& b) {
  ASSERT_EQ(a.span_count, b.span_count);
  for (std::size_t i = 0; i < a.spans().size(); ++i) {
    EXPECT_EQ(a.span_storage[i].until_s, b.span_storage[i].until_s);
    EXPECT_EQ(a.span_storage[i].way, b.span_storage[i].way);
    EXPECT_EQ(a.span_storage[i].late_max_s, b.span_storage[i].late_max_s);
    EXPECT_EQ(a.span_storage[i].limits_share, b.span_storage[i].limits_share);
    EXPECT_EQ(a.span_storage[i].position_rad, b.span_storage[i].position_rad);
  }
}

TEST(AbortTable, IsReadBackBitForBitAndPartOfTheHash) {
  std::mt19937 random(8);
  for (int spans = 1; spans <= kMaxAbortSpans; ++spans) {
    PrimitiveFile file = ShippedHandstand();
    const std::string bare = ContentHash(file);
    file.primitive.aborts = testing::RandomAborts(file.primitive, spans, random);
    const std::string text = ToToml(file);
    ExpectSameTable(ParsePrimitive(text, "p.toml").primitive.aborts, file.primitive.aborts);
    EXPECT_NE(ContentHash(file), bare);
    file.primitive.aborts.span_storage[0].until_s *= 0.99;
    if (spans > 1) {
      EXPECT_NE(ContentHash(file), ContentHash(ParsePrimitive(text, "p.toml")));
    }
  }
}

TEST(AbortTable, TheSpanOfATimeIsTheOneThatEndsAfterItAndBeyondTheEndsTheOutermost) {
  const AbortTable<double> aborts = WithEveryWay().primitive.aborts;
  EXPECT_EQ(aborts.At(-1).way, AbortWay::kCatch);
  EXPECT_EQ(aborts.At(0).way, AbortWay::kCatch);
  EXPECT_EQ(aborts.At(0.1249999).way, AbortWay::kCatch);
  EXPECT_EQ(aborts.At(0.125).way, AbortWay::kFold);
  EXPECT_EQ(aborts.At(0.4999999).way, AbortWay::kRollOut);
  EXPECT_EQ(aborts.At(0.5).way, AbortWay::kDamp);
  EXPECT_EQ(aborts.At(100).way, AbortWay::kDamp);
  EXPECT_EQ(aborts.At(std::numeric_limits<double>::quiet_NaN()).way, AbortWay::kCatch);
}

TEST(AbortTable, EveryNumberOfItIsRoundedToTheNearestFloat) {
  std::mt19937 random(9);
  PrimitiveFile file = ShippedHandstand();
  file.primitive.aborts = testing::RandomAborts(file.primitive, kMaxAbortSpans, random);
  const Primitive<float> runtime = ToRuntime(file.primitive);
  AbortTable<float> expected;
  expected.span_count = kMaxAbortSpans;
  for (std::size_t i = 0; i < kMaxAbortSpans; ++i) {
    const AbortSpan<double>& span = file.primitive.aborts.span_storage[i];
    AbortSpan<float>& rounded = expected.span_storage[i];
    rounded.until_s = static_cast<float>(span.until_s);
    rounded.way = span.way;
    rounded.late_max_s = static_cast<float>(span.late_max_s);
    rounded.limits_share = static_cast<float>(span.limits_share);
    for (std::size_t j = 0; j < kMaxJoints; ++j)
      rounded.position_rad[j] = static_cast<float>(span.position_rad[j]);
  }
  ExpectSameTable(runtime.aborts, expected);
  EXPECT_EQ(expected.spans().back().until_s, runtime.duration_s);
}

TEST(AbortTable, ThatRoundingWouldDistortIsRefused) {
  PrimitiveFile file = WithEveryWay();
  file.primitive.aborts.span_storage[0].until_s = 0.25 - 1e-9;
  EXPECT_THAT([&] { static_cast<void>(ToRuntime(file.primitive)); },
              ::testing::ThrowsMessage<std::invalid_argument>(HasSubstr("rounds to no time")));
  file = WithEveryWay();
  file.primitive.aborts.span_storage[1].limits_share = 1e-60;
  EXPECT_THAT([&] { static_cast<void>(ToRuntime(file.primitive)); },
              ::testing::ThrowsMessage<std::invalid_argument>(HasSubstr("rounds to zero")));
}

TEST(AbortTable, AWrongOneIsRefusedWithLineKeyAndWhatIsAllowed) {
  struct Edit {
    const char* from;
    const char* to;
    std::vector<const char*> fragments;
  };
  const std::vector<Edit> edits = {
      {"from_s = 0.0", "from_s = 0.001", {"abort[0].from_s: is 0.001", "where the span before"}},
      {"from_s = 0.125", "from_s = 0.12", {"abort[1].from_s: is 0.12; allowed: 0.125"}},
      {"to_s = 0.25", "to_s = 0.125", {"abort[1].to_s: is 0.125; allowed: above from_s"}},
      {"to_s = 0.25", "to_s = 0.9", {"abort[1].to_s: is 0.9", "up to duration_s, which is 0.723"}},
      {"to_s = 0.723", "to_s = 0.6", {"abort[3].to_s: is 0.6; the last span ends at duration_s"}},
      {"to_s = 0.5\n", "to_s = nan\n", {"abort[2].to_s"}},
      {"way = \"catch\"", "way = \"hold\"", {"abort[0].way: is 'hold'", "roll-out"}},
      {"late_max_s = 0.0078125", "late_max_s = -0.1", {"abort[2].late_max_s: is -0.1"}},
      {"late_max_s = 0.0078125", "late_max_s = 1.1", {"abort[2].late_max_s: is 1.1"}},
      {"late_max_s = 0.0078125\n", "", {"abort[2].late_max_s: is missing"}},
      {"way = \"catch\"",
       "way = \"catch\"\nlate_max_s = 0.01",
       {"abort[0].late_max_s: is not a key"}},
      {"limits_share = 0.75", "limits_share = 0.0", {"abort[1].limits_share: is 0"}},
      {"limits_share = 0.75", "limits_share = 1.5", {"abort[1].limits_share: is 1.5"}},
      {"limits_share = 0.75\n", "", {"abort[1].limits_share: is missing"}},
      {"way = \"damp\"",
       "way = \"damp\"\nlimits_share = 0.5",
       {"abort[3].limits_share: is not a key"}},
      {"[-1.5, 1.25]", "[-1.5]", {"abort[1].joint_positions_rad: holds 1 numbers; expected 2"}},
      {"[-1.5, 1.25]",
       "[-1.5, 2.95]",
       {"abort[1].joint_positions_rad: joint 'leg2' is at 2.95 rad; allowed: -2.9 ... 2.9 rad"}},
  };
  const std::string text = ToToml(WithEveryWay());
  for (const Edit& edit : edits) {
    try {
      ParsePrimitive(EditedAborts(text, edit.from, edit.to), "p.toml");
      ADD_FAILURE() << edit.to << " was accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), ::testing::MatchesRegex("p\\.toml:[0-9]+: .+"));
      for (const char* const fragment : edit.fragments)
        EXPECT_THAT(error.what(), HasSubstr(fragment));
    }
  }
}

TEST(AbortTable, AFigureWhoseLargestImpactIsBelowTheMeanIsRefused) {
  PrimitiveFile file = WithEveryWay();
  file.abort_figure.emplace();
  file.abort_figure->robots = 4;
  file.abort_figure->impact_m_s = file.abort_figure->impact_max_m_s = 0.5;
  file.abort_figure->damped_impact_m_s = file.abort_figure->damped_impact_max_m_s = 0.75;
  const std::string text = ToToml(file);
  EXPECT_NO_THROW(static_cast<void>(ParsePrimitive(text, "p.toml")));
  const auto refusal = [&](const char* key, const char* from, const char* to) {
    const std::string edited = EditedAborts(text, from, to);
    EXPECT_THAT([&] { static_cast<void>(ParsePrimitive(edited, "p.toml")); },
                ::testing::ThrowsMessage<FileError>(HasSubstr(key)));
  };
  refusal("abort_figure.impact_max_m_s: is 0.25; allowed: at least the mean, 0.5",
          "\nimpact_max_m_s = 0.5", "\nimpact_max_m_s = 0.25");
  refusal("abort_figure.damped_impact_max_m_s: is 0.5; allowed: at least the mean, 0.75",
          "damped_impact_max_m_s = 0.75", "damped_impact_max_m_s = 0.5");
}

TEST(AbortTable, WithTooManySpansIsRefusedByReaderAndWriter) {
  std::string spans;
  for (int i = 0; i < kMaxAbortSpans - 3; ++i)
    spans = fmt::format("{}[[abort]]\nfrom_s = 0.0\nto_s = 0.1\nway = \"catch\"\n", spans);
  const std::string text = EditedAborts(ToToml(WithEveryWay()), "[drives]", spans + "[drives]");
  EXPECT_THAT([&] { static_cast<void>(ParsePrimitive(text, "p.toml")); },
              ::testing::ThrowsMessage<FileError>(HasSubstr("has 9 entries; allowed: up to 8")));
  PrimitiveFile file = WithEveryWay();
  for (const int count : {-1, kMaxAbortSpans + 1}) {
    file.primitive.aborts.span_count = count;
    EXPECT_THROW(ToToml(file), std::invalid_argument);
  }
}

TEST(AbortTable, AChangeByHandKeepsIt) {
  const std::string text = ToToml(WithEveryWay());
  const std::string edited = EditedAborts(text, "root_x_m = 0.0", "root_x_m = 0.5");
  const PrimitiveFile read = ParsePrimitive(SignEdited(edited, "p.toml", "longer"), "p.toml");
  ExpectSameTable(read.primitive.aborts, WithEveryWay().primitive.aborts);
}

}  // namespace
}  // namespace tumbler
