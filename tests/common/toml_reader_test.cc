// The strict reader under every file format.

#include "common/files/toml_reader.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

namespace tumbler {
namespace {

using ::testing::HasSubstr;

/// The message with which `read` refuses the text; empty when it takes it.
std::string Refusal(const std::string& text, const std::function<void(TomlTable&)>& read) {
  try {
    TomlTable table = TomlTable::Parse(text, "file.toml");
    read(table);
    table.RejectUnknownKeys();
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

TEST(TomlReader, TakesEveryKindOfValue) {
  TomlTable table = TomlTable::Parse(
      "a = 1.5\nb = 2\nc = true\nd = 'text'\ne = [1, 2.5]\nf = ['x', 'y']\n[g]\nh = 3\n[[i]]\nj = "
      "4\n[[i]]\nj = 5\n",
      "file.toml");
  EXPECT_EQ(table.Number("a", Range::Any()), 1.5);
  EXPECT_EQ(table.Number("b", Range::Any()), 2) << "integers are numbers";
  EXPECT_EQ(table.Integer("b", 0, 10), 2);
  EXPECT_TRUE(table.Boolean("c"));
  EXPECT_EQ(table.String("d"), "text");
  EXPECT_EQ(table.Numbers("e", Range::Any()), (std::vector<double>{1, 2.5}));
  EXPECT_EQ(table.Strings("f"), (std::vector<std::string>{"x", "y"}));
  EXPECT_EQ(table.Table("g").Integer("h", 0, 10), 3);
  std::vector<TomlTable> tables = table.Tables("i");
  ASSERT_EQ(tables.size(), 2U);
  EXPECT_EQ(tables[0].Integer("j", 0, 10), 4);
  EXPECT_EQ(tables[1].Integer("j", 0, 10), 5);
  EXPECT_NO_THROW(table.RejectUnknownKeys());
}

TEST(TomlReader, DefaultsStandInForAbsentKeysOnly) {
  TomlTable table = TomlTable::Parse("a = 1.5\n", "file.toml");
  EXPECT_EQ(table.Number("a", Range::Any(), 7.0), 1.5);
  EXPECT_EQ(table.Number("b", Range::Positive(), 7.0), 7.0);
  EXPECT_EQ(table.Integer("b", 0, 1, 9), 9);
  EXPECT_TRUE(table.Boolean("b", true));
  EXPECT_EQ(table.String("b", "x"), "x");
  EXPECT_FALSE(table.OptionalTable("b").has_value());
  EXPECT_TRUE(table.OptionalTables("b").empty());
  EXPECT_THAT(Refusal("b = 'x'", [](TomlTable& t) { t.Number("b", Range::Any(), 7.0); }),
              HasSubstr("file.toml:1: b: is a string; expected a number"))
      << "a value that is there is never passed over";
}

TEST(TomlReader, AMissingKeyNamesTheOneThatWasMisspelt) {
  const auto refusal = [](const std::string& text) {
    return Refusal(text, [](TomlTable& t) {
      t.Expect("duration_max_s");
      t.Number("settle_s", Range::Any(), 0.0);
      t.Number("duration_s", Range::Positive());
    });
  };
  EXPECT_EQ(refusal("settle_s = 1\nduraton_s = 1\n"),
            "file.toml:1: duration_s: is missing and has no default; did you mean it by "
            "'duraton_s' in line 2? allowed: > 0");
  EXPECT_THAT(refusal("duration = 1\n"), HasSubstr("did you mean it by 'duration' in line 1?"))
      << "its unit was left out";
  EXPECT_THAT(refusal("\n[duration_s_]\n"), HasSubstr("'duration_s_' in line 2?"));
  // What is another key, or something else, is no slip.
  for (const char* other : {"settle_s = 1", "duration_max_s = 1", "speed = 1"})
    EXPECT_THAT(refusal(other), HasSubstr("has no default; allowed: > 0")) << other;
}

TEST(TomlReader, AMissingTableIsShownAsItIsWritten) {
  EXPECT_THAT(Refusal("", [](TomlTable& t) { t.Table("start"); }), HasSubstr("a table, [start]"));
  EXPECT_THAT(Refusal("[a]", [](TomlTable& t) { t.Table("a").Tables("b"); }),
              HasSubstr("tables, each begun by [[a.b]]"));
}

TEST(TomlReader, RangesHoldAtTheirEnds) {
  const auto taken = [](const std::string& value, Range range) {
    return Refusal("a = " + value, [&](TomlTable& t) { t.Number("a", range); }).empty();
  };
  EXPECT_TRUE(taken("0.0", {0, 1}));
  EXPECT_TRUE(taken("1.0", {0, 1}));
  EXPECT_FALSE(taken("1.0000000000000002", {0, 1}));
  EXPECT_FALSE(taken("-5e-324", {0, 1}));
  EXPECT_FALSE(taken("0.0", Range::Positive()));
  EXPECT_TRUE(taken("5e-324", Range::Positive()));
  EXPECT_TRUE(taken("1.7976931348623157e308", Range::Any()));
  for (const char* value : {"nan", "+nan", "-nan", "inf", "+inf", "-inf"}) {
    EXPECT_FALSE(taken(value, Range::Any())) << value;
    EXPECT_FALSE(taken(value, Range::Positive())) << value;
  }
}

TEST(TomlReader, MessagesSayWhichRangeIsAllowed) {
  const auto message = [](Range range) {
    return Refusal("\na = -7.5", [&](TomlTable& t) { t.Number("a", range); });
  };
  EXPECT_EQ(message({0, 1}), "file.toml:2: a: is -7.5; allowed: from 0 ... 1");
  EXPECT_EQ(message({0, 1, true}), "file.toml:2: a: is -7.5; allowed: above 0 ... 1");
  EXPECT_EQ(message(Range::Positive()), "file.toml:2: a: is -7.5; allowed: > 0");
  EXPECT_EQ(message(Range::NonNegative()), "file.toml:2: a: is -7.5; allowed: >= 0");
  EXPECT_EQ(message({std::numeric_limits<double>::lowest(), -8}),
            "file.toml:2: a: is -7.5; allowed: <= -8");
  EXPECT_EQ(Refusal("a = inf", [](TomlTable& t) { t.Number("a", Range::Any()); }),
            "file.toml:1: a: is inf; allowed: any finite number");
}

TEST(TomlReader, IntegersAreNotRounded) {
  const auto read = [](TomlTable& t) { t.Integer("a", -3, 3); };
  EXPECT_EQ(Refusal("a = 3", read), "");
  EXPECT_THAT(Refusal("a = 4", read), HasSubstr("is 4; allowed: from -3 ... 3"));
  EXPECT_THAT(Refusal("a = 2.0", read), HasSubstr("is a number; expected an integer"));
  EXPECT_THAT(Refusal("a = 99999999999999999999", read), HasSubstr("file.toml:1"));
}

TEST(TomlReader, NamesTheFullKeyAndLineOfNestedValues) {
  const std::string text = "[[x]]\n[[x]]\n[x.y]\nz = [1,\n 2,\n 'three']\n";
  EXPECT_EQ(Refusal(text,
                    [](TomlTable& t) {
                      std::vector<TomlTable> x = t.Tables("x");
                      x[1].Table("y").Numbers("z", Range::Any());
                    }),
            "file.toml:6: x[1].y.z[2]: is a string; expected a number; allowed: any finite number");
  EXPECT_EQ(Refusal("[a]\n\n[b]\n", [](TomlTable& t) { t.Table("b").String("c"); }),
            "file.toml:3: b.c: is missing and has no default; allowed: a string");
}

TEST(TomlReader, WrongKindsAreNamed) {
  const auto read = [](const char* value, const std::function<void(TomlTable&)>& how) {
    return Refusal(std::string("a = ") + value, how);
  };
  EXPECT_THAT(read("1", [](TomlTable& t) { t.String("a"); }),
              HasSubstr("is an integer; expected a string"));
  EXPECT_THAT(read("1", [](TomlTable& t) { t.Boolean("a"); }), HasSubstr("expected true or false"));
  EXPECT_THAT(read("1", [](TomlTable& t) { t.Table("a"); }), HasSubstr("expected a table"));
  EXPECT_THAT(read("1", [](TomlTable& t) { t.Tables("a"); }),
              HasSubstr("expected an array of tables"));
  EXPECT_THAT(read("[1]", [](TomlTable& t) { t.Tables("a"); }), HasSubstr("expected a table"));
  EXPECT_THAT(read("[1]", [](TomlTable& t) { t.Strings("a"); }), HasSubstr("expected a string"));
  EXPECT_THAT(read("1", [](TomlTable& t) { t.StringLists("a"); }), HasSubstr("array of arrays"));
  EXPECT_THAT(read("['x']", [](TomlTable& t) { t.StringLists("a"); }),
              HasSubstr("expected an array of strings"));
  EXPECT_THAT(read("[['x', 1]]", [](TomlTable& t) { t.StringLists("a"); }),
              HasSubstr("expected a string"));
  EXPECT_THAT(read("{}", [](TomlTable& t) { t.Number("a", Range::Any()); }),
              HasSubstr("is a table"));
  EXPECT_THAT(read("1979-05-27", [](TomlTable& t) { t.String("a"); }),
              HasSubstr("is a date or time"));
  EXPECT_THAT(read("[1, 2]", [](TomlTable& t) { t.Numbers("a", Range::Any(), 3); }),
              HasSubstr("holds 2 numbers; expected 3"));
}

TEST(TomlReader, ChoicesAreListed) {
  constexpr std::array<std::string_view, 2> kAllowed = {"this", "that"};
  const auto read = [&](TomlTable& t) { t.Choice("a", kAllowed, "this"); };
  EXPECT_EQ(Refusal("a = 'that'", read), "");
  EXPECT_EQ(Refusal("", read), "");
  EXPECT_THAT(Refusal("a = 'This'", read), HasSubstr("is 'This'; allowed: this, that"));
}

TEST(TomlReader, KeysThatNobodyTookAreRefusedAtEveryDepth) {
  const auto read = [](TomlTable& t) {
    t.Integer("a", 0, 9);
    if (t.Has("t")) t.Table("t").Integer("a", 0, 9);
    for (TomlTable& u : t.OptionalTables("u")) u.Integer("a", 0, 9);
  };
  EXPECT_EQ(Refusal("a = 1\n[t]\na = 1\n[[u]]\na = 1", read), "");
  EXPECT_THAT(Refusal("a = 1\nb = 2", read), HasSubstr("file.toml:2: b: is not a key"));
  EXPECT_THAT(Refusal("a = 1\n[t]\na = 1\nb = 1", read),
              HasSubstr("file.toml:4: t.b: is not a key"));
  EXPECT_THAT(Refusal("a = 1\n[[u]]\na = 1\n[[u]]\na = 1\nb = 1", read),
              HasSubstr("file.toml:6: u[1].b"));
  EXPECT_THAT(Refusal("a = 1\n[v]\n", read), HasSubstr("file.toml:2: v: is not a key"));
}

TEST(TomlReader, AKeyThatNobodyTookIsAnsweredWithTheOneThatWasMeant) {
  const auto read = [](TomlTable& t) {
    t.Number("duration_s", Range::Any(), 0.0);
    t.Number("settle_s", Range::Any(), 0.0);
    t.Number("mu", Range::Any(), 0.0);
  };
  EXPECT_THAT(Refusal("setle_s = 1", read), HasSubstr("; did you mean 'settle_s'?"));
  EXPECT_THAT(Refusal("duration = 1", read), HasSubstr("; did you mean 'duration_s'?"));
  EXPECT_THAT(Refusal("nu = 1", read), HasSubstr("; did you mean 'mu'?"));
  EXPECT_THAT(Refusal("friction = 1", read),
              HasSubstr("; also allowed here: duration_s, mu, settle_s"));
  EXPECT_THAT(Refusal("settle_s = 1\nsettle = 1", read),
              HasSubstr("; also allowed here: duration_s, mu"));
  EXPECT_THAT(Refusal("duration_s = 1\nsettle_s = 1\nmu = 1\nsettle = 1", read),
              HasSubstr("; nothing more can be here"));
}

TEST(TomlReader, AKeyOfPartsWithoutEndIsRefusedBeforeItExhaustsTheStack) {
  for (const bool header : {true, false}) {
    std::string key = "a";
    for (int i = 0; i < 2'000'000; ++i) key += ".a";
    const std::string text = header ? "\n[" + key + "]" : "\n" + key + " = 1";
    EXPECT_EQ(Refusal(text, [](TomlTable&) {}), "file.toml:2: a key has more than 1000 parts");
  }
}

TEST(TomlReader, TextWithAByteZeroIsRefused) {
  EXPECT_EQ(Refusal(std::string("a = 1\n#\0", 8), [](TomlTable&) {}),
            "file.toml:2: not valid TOML: there is a byte 0, so this is no text");
}

TEST(TomlReader, MalformedTextIsRefusedWithItsLine) {
  for (const char* text :
       {"a = 1\nb = = 2", "a = 1\na = 2", "\n[a", "\nb = \"open", "\n= 3", "a = 1\nb"}) {
    EXPECT_THAT(Refusal(text, [](TomlTable&) {}), HasSubstr("file.toml:2: not valid TOML")) << text;
  }
  EXPECT_THAT(Refusal("a = '\xff'", [](TomlTable&) {}), HasSubstr("not valid TOML"));
}

TEST(TomlReader, FilesThatCannotBeReadAreNamed) {
  EXPECT_THROW(TomlTable::ParseFile("/absent/file.toml"), FileError);
  try {
    TomlTable::ParseFile("/");
    FAIL();
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("is a directory"));
  }
}

TEST(ExactDecimal, ReadsBackBitForBitAsAFloat) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 20000; ++i) {
    const double value = std::bit_cast<double>(random());
    if (!std::isfinite(value)) continue;
    TomlTable table = TomlTable::Parse("a = " + ExactDecimal(value), "file.toml");
    ASSERT_EQ(std::bit_cast<std::uint64_t>(table.Number("a", Range::Any())),
              std::bit_cast<std::uint64_t>(value))
        << ExactDecimal(value);
  }
  for (const double value : {0.0, -0.0, 1.0, -3.0, 1e22, 1e300, 5e-324}) {
    TomlTable table = TomlTable::Parse("a = " + ExactDecimal(value), "file.toml");
    EXPECT_EQ(std::signbit(table.Number("a", Range::Any())), std::signbit(value));
    EXPECT_THAT(Refusal("a = " + ExactDecimal(value), [](TomlTable& t) { t.Integer("a", -9, 9); }),
                HasSubstr("expected an integer"))
        << "it is to stay a float";
  }
}

}  // namespace
}  // namespace tumbler
