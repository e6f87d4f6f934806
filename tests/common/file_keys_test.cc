// The descriptions of keys: reading, writing and documenting by them.

#include "common/files/file_keys.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/support/docs_tables.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

enum class Colour { kRed, kBlue };

struct Lamp {
  FixedString<8> name;
  double height_m = 0.5;
  float power = 0.25F;
  int bulbs = 20'000;
  std::uint64_t seed = 1;
  bool lit = false;
  Colour colour = Colour::kBlue;
  std::optional<double> limit_nm;
  std::int64_t period_ns = 50'000;
  std::array<double, 2> at_m{};
  std::vector<double> steps;
  std::vector<std::string> rooms;
  std::string note;
  std::string poem;
};

constexpr std::array<std::string_view, 2> kColours = {"red", "blue"};
constexpr std::array kKeys = {
    KeyOf<&Lamp::name>("name", "").Required(),
    KeyOf<&Lamp::height_m>("height_m", {0, 20, true}, "above the floor"),
    KeyOf<&Lamp::power>("power", {-1e3, 1e6}, ""),
    KeyOf<&Lamp::bulbs>("bulbs", {1, 67'108'864}, "").Where([](const Lamp& lamp) {
      return lamp.height_m > 0.1;
    }),
    KeyOf<&Lamp::seed>("seed", Range::NonNegative(), ""),
    KeyOf<&Lamp::lit>("lit", ""),
    KeyOf<&Lamp::colour>("colour", kColours, ""),
    KeyOf<&Lamp::limit_nm>("limit_nm", Range::Positive(), "")
        .Allowed("above 0, to the height",
                 [](const Lamp& lamp) {
                   return Range{0, lamp.height_m, true};
                 }),
    SecondsOf<&Lamp::period_ns>("period_s", {1e-6, 1e-3}, "")
        .Default("{}; red and blue differ",
                 [](Lamp& lamp) { lamp.period_ns = lamp.colour == Colour::kRed ? 7 : 8; }),
    KeyOf<&Lamp::at_m>("at_m", Range::Any(), ""),
    KeyOf<&Lamp::steps>("steps", {1e-6}, ""),
    KeyOf<&Lamp::rooms>("rooms", ""),
    KeyOf<&Lamp::note>("note", ""),
    LongTextOf<&Lamp::poem>("poem", ""),
};

Lamp Read(const std::string& text) {
  Lamp lamp;
  TomlTable table = TomlTable::Parse(text, "lamp.toml");
  ReadKeys(table, kKeys, lamp);
  table.RejectUnknownKeys();
  return lamp;
}
std::string ErrorOf(const std::string& text) {
  try {
    Read(text);
  } catch (const FileError& error) {
    return error.what();
  }
  return "no error";
}

TEST(FileKeys, EveryKindOfValueIsRead) {
  const Lamp lamp = Read(
      "name = 'desk'\nheight_m = 2\npower = 0.5\nbulbs = 3\nseed = 9223372036854775807\nlit = "
      "true\n"
      "colour = 'red'\nlimit_nm = 1.5\nperiod_s = 1e-5\nat_m = [1, 2]\nsteps = [3, 4, 5]\n"
      "rooms = ['hall']\nnote = 'x'\npoem = 'y'\n");
  EXPECT_EQ(lamp.name.view(), "desk");
  EXPECT_EQ(lamp.height_m, 2);
  EXPECT_EQ(lamp.power, 0.5F);
  EXPECT_EQ(lamp.bulbs, 3);
  EXPECT_EQ(lamp.seed, 9223372036854775807U);
  EXPECT_TRUE(lamp.lit);
  EXPECT_EQ(lamp.colour, Colour::kRed);
  EXPECT_EQ(lamp.limit_nm, 1.5);
  EXPECT_EQ(lamp.period_ns, 10'000);
  EXPECT_THAT(lamp.at_m, ElementsAre(1, 2));
  EXPECT_THAT(lamp.steps, ElementsAre(3, 4, 5));
  EXPECT_THAT(lamp.rooms, ElementsAre("hall"));
  EXPECT_EQ(lamp.note, "x");
  EXPECT_EQ(lamp.poem, "y");
}

TEST(FileKeys, WhatIsLeftOutStaysAsItWasOrFollowsFromTheKeysBefore) {
  const Lamp lamp = Read("name = 'desk'\n");
  EXPECT_EQ(lamp.height_m, 0.5);
  EXPECT_EQ(lamp.colour, Colour::kBlue);
  EXPECT_FALSE(lamp.limit_nm.has_value());
  EXPECT_EQ(lamp.period_ns, 8);
  EXPECT_EQ(Read("name = 'desk'\ncolour = 'red'\n").period_ns, 7);
}

TEST(FileKeys, AWrongValueIsRefusedWithWhatIsAllowed) {
  EXPECT_EQ(ErrorOf(""), "lamp.toml:1: name: is missing and has no default; allowed: a string");
  EXPECT_EQ(ErrorOf("name = 'much too long'\n"),
            "lamp.toml:1: name: is 'much too long', 13 bytes; allowed: from 1 ... 8");
  EXPECT_EQ(ErrorOf("name = \"a\\nb\"\n"),
            "lamp.toml:1: name: has a control character, such as the end of a line; take it out");
  EXPECT_EQ(ErrorOf("name = \"a\\u0000b\"\n"),
            "lamp.toml:1: name: has a control character, such as the end of a line; take it out");
  EXPECT_EQ(ErrorOf("name = ''\n"), "lamp.toml:1: name: is '', 0 bytes; allowed: from 1 ... 8");
  EXPECT_EQ(ErrorOf("name = 'a'\nheight_m = 0\n"),
            "lamp.toml:2: height_m: is 0; allowed: above 0 ... 20");
  EXPECT_EQ(ErrorOf("name = 'a'\nseed = -1\n"),
            "lamp.toml:2: seed: is -1; allowed: from 0 ... 9223372036854775807");
  EXPECT_EQ(ErrorOf("name = 'a'\nbulbs = 1.5\n"),
            "lamp.toml:2: bulbs: is a number; expected an integer; allowed: from 1 ... 67108864");
  EXPECT_EQ(ErrorOf("name = 'a'\ncolour = 'green'\n"),
            "lamp.toml:2: colour: is 'green'; allowed: red, blue");
  EXPECT_EQ(ErrorOf("name = 'a'\nat_m = [1]\n"), "lamp.toml:2: at_m: holds 1 numbers; expected 2");
  EXPECT_EQ(ErrorOf("name = 'a'\nheight_m = 2\nlimit_nm = 3\n"),
            "lamp.toml:3: limit_nm: is 3; allowed: above 0 ... 2");
}

TEST(FileKeys, AKeyThatDoesNotApplyIsUnknown) {
  EXPECT_THAT(ErrorOf("name = 'a'\nheight_m = 0.05\nbulbs = 3\n"),
              HasSubstr("lamp.toml:3: bulbs: is not a key that this file can hold"));
}

struct Clock {
  double hour_h = 9;
  int told = 0;  ///< How often the function below was called.
};
void ReadHour(TomlTable& table, std::string_view key, Clock& clock) {
  clock.hour_h = table.Number(key, {1, 12}) + 12;
  ++clock.told;
}
constexpr std::array kClockKeys = {
    KeyOf<&Clock::hour_h>("hour_h", "").ReadBy(ReadHour).Allowed("1 to 12"),
    KeyReadBy<Clock>("alarm_h", ReadHour, "").Default("none").Allowed("1 to 12"),
};

TEST(FileKeys, AFunctionReadsAKeyWhereItIsThereOrRequired) {
  const auto read = [](const std::string& text, const auto& keys) {
    Clock clock;
    TomlTable table = TomlTable::Parse(text, "clock.toml");
    ReadKeys(table, keys, clock);
    table.RejectUnknownKeys();
    return clock;
  };
  EXPECT_EQ(read("", kClockKeys).told, 0);
  EXPECT_EQ(read("hour_h = 3\n", kClockKeys).hour_h, 15);
  EXPECT_EQ(read("hour_h = 3\nalarm_h = 4\n", kClockKeys).told, 2);
  EXPECT_THROW(read("hour_h = 3\n", AllRequired(kClockKeys)), FileError);
  EXPECT_EQ(testing::Markdown({"", "", RowsOf(kClockKeys)}),
            "| key | default | allowed | meaning |\n|---|---|---|---|\n"
            "| `hour_h` | 9 | 1 to 12 | |\n"
            "| `alarm_h` | none | 1 to 12 | |\n");
}

TEST(FileKeys, AFileOfAnotherKindIsRefusedInTheWordsOfItsHeader) {
  const auto error = [](const std::string& text, const FileHeader& header) -> std::string {
    TomlTable table = TomlTable::Parse(text, "clock.toml");
    try {
      ReadHeader(table, header);
    } catch (const FileError& refused) {
      return refused.what();
    }
    return "no error";
  };
  const FileHeader clock{"clock", 2};
  EXPECT_EQ(error("format = 'clock'\nversion = 2\n", clock), "no error");
  EXPECT_EQ(error("format = 'lamp'\n", clock), "clock.toml:1: format: is 'lamp'; allowed: clock");
  EXPECT_EQ(error("version = 2\n", clock),
            "clock.toml:1: format: is missing and has no default; allowed: a string");
  EXPECT_EQ(error("format = 'clock'\nversion = 3\n", clock),
            "clock.toml:2: version: is 3; allowed: from 2 ... 2");
  const FileHeader of_choice{"clock", 2, nullptr, "is {0}; this reads {1}"};
  EXPECT_EQ(error("format = 'clock'\nversion = 1\n", of_choice), "no error");
  EXPECT_EQ(error("format = 'lamp'\n", of_choice),
            "clock.toml:1: format: is 'lamp'; allowed: clock");
  EXPECT_EQ(error("version = 2\n", of_choice),
            "clock.toml:1: format: is missing and has no default; allowed: clock");
  EXPECT_EQ(error("format = 'clock'\nversion = 3\n", of_choice),
            "clock.toml:2: version: is 3; this reads 2");
}

struct Letter {
  FixedString<8> name;
  double weight_kg = 0.1;
  std::int64_t pages = 3;
  std::array<double, 2> size_m = {0.2, 0.3};
  std::vector<double> marks = {1, 2};
  std::string to = "\"you\"";
  std::string text = "one\ntwo\n";
};
constexpr std::array kLetterKeys = {
    KeyOf<&Letter::name>("name", "").Required(),
    KeyOf<&Letter::weight_kg>("weight_kg", ""),
    KeyOf<&Letter::pages>("pages", Range::NonNegative(), ""),
    KeyOf<&Letter::size_m>("size_m", ""),
    KeyOf<&Letter::marks>("marks", ""),
    KeyOf<&Letter::to>("to", ""),
    LongTextOf<&Letter::text>("text", ""),
};

TEST(FileKeys, WhatIsWrittenReadsBack) {
  Letter letter;
  letter.name = FixedString<8>("a");
  TomlWriter writer("a letter");
  WriteKeys(writer, kLetterKeys, letter);
  const std::string text = writer.Take();
  EXPECT_EQ(text,
            "name = \"a\"\nweight_kg = 0.1\npages = 3\nsize_m = [0.2, 0.3]\nmarks = [1.0, 2.0]\n"
            "to = \"\\\"you\\\"\"\ntext = '''\none\ntwo\n'''\n");
  Letter back{};
  back.to = back.text = "";
  TomlTable table = TomlTable::Parse(text, "letter.toml");
  ReadKeys(table, kLetterKeys, back);
  EXPECT_EQ(back.to, letter.to);
  EXPECT_EQ(back.text, letter.text);
  letter.weight_kg = std::numeric_limits<double>::infinity();
  try {
    WriteKeys(writer, kLetterKeys, letter);
    ADD_FAILURE() << "written";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "weight_kg is inf; a letter holds finite numbers");
  }
}

TEST(FileKeys, TheTableForPeopleHasDefaultsAndRanges) {
  EXPECT_EQ(testing::Markdown({"", "", RowsOf(kKeys, "`[lamp]`")}),
            "| key | default | allowed | meaning |\n|---|---|---|---|\n"
            "| `[lamp]` `name` | required | 1 to 8 bytes | |\n"
            "| `[lamp]` `height_m` | 0.5 | above 0, to 20 | above the floor |\n"
            "| `[lamp]` `power` | 0.25 | -1000 to 1e6 | |\n"
            "| `[lamp]` `bulbs` | 20 000 | 1 to 67 108 864 | |\n"
            "| `[lamp]` `seed` | 1 | 0 or more | |\n"
            "| `[lamp]` `lit` | false | | |\n"
            "| `[lamp]` `colour` | `\"blue\"` | `\"red\"`, `\"blue\"` | |\n"
            "| `[lamp]` `limit_nm` | none | above 0, to the height | |\n"
            "| `[lamp]` `period_s` | 5e-5; red and blue differ | 1e-6 to 0.001 | |\n"
            "| `[lamp]` `at_m` | none | | |\n"
            "| `[lamp]` `steps` | none | 1e-6 or more | |\n"
            "| `[lamp]` `rooms`, `note`, `poem` | none | | |\n");
}

}  // namespace
}  // namespace tumbler
