// Numbers that take the place of others in a TOML text.

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "common/files/toml_reader.h"
#include "offline/studies/toml_edit.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

const char* const kText =
    "# über contact\r\n"
    "count = 12 # points\n"
    "\"ä\" = { b = 1.5,c=2 }\n"
    "rows = [ [1.0, 2.0],\n"
    "  [3, 4e0]]\n"
    "word = \"mu = 3\"\n"
    "[contact]\n"
    "mu=0.3# friction\n"
    "[[cost]]\n"
    "weight = 1\n"
    "[[cost]]\n"
    "weight = 0x10";

TEST(TomlEdit, ReplacesOneNumberAndLeavesAllOtherBytes) {
  const struct {
    const char* path;
    double value;
    const char *before, *after;
  } kCases[] = {
      {"count", 24, "= 12 #", "= 24 #"},
      {"count", 2.5, "= 12 #", "= 2.5 #"},
      {"ä.b", -0.25, "1.5,c", "-0.25,c"},
      {"ä.c", 1e-7, "c=2 }", "c=1e-07 }"},
      {"rows.0.1", 7, "2.0],", "7.0],"},
      {"rows.1.1", 0.1, "4e0]]", "0.1]]"},
      {"contact.mu", 0.4, "mu=0.3#", "mu=0.4#"},
      {"cost.0.weight", 3, "weight = 1\n", "weight = 3\n"},
      {"cost.1.weight", 17, "0x10", "17"},
  };
  for (const auto& c : kCases) {
    EXPECT_EQ(WithNumber(kText, "a.toml", c.path, c.value),
              testing::Replaced(kText, c.before, c.after))
        << c.path;
  }
}

TEST(TomlEdit, WhatIsPutThereReadsBackToTheLastBit) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> exponent(-300, 300);
  for (int i = 0; i < 200; ++i) {
    const double value = std::pow(10.0, exponent(random)) * (i % 2 == 0 ? 1 : -1);
    const std::string edited = WithNumber(kText, "a.toml", "contact.mu", value);
    EXPECT_EQ(NumberAt(edited, "a.toml", "contact.mu"), value);
  }
}

TEST(TomlEdit, SaysWhereNoNumberIs) {
  const auto message = [](const std::string& path) {
    try {
      static_cast<void>(WithNumber(kText, "a.toml", path, 1));
    } catch (const FileError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message("contact.nu"),
            "a.toml:7: contact.nu: is not there, so no number can take its place; write it into "
            "the file first");
  EXPECT_EQ(message("word"), "a.toml:6: word: is no number; allowed: the key of a number");
  for (const char* path : {"", ".", "rows.2", "rows.-1", "rows.0x0", "rows", "contact.mu.x",
                           "cost.weight", "contact."}) {
    EXPECT_NE(message(path), "") << path;
  }
}

}  // namespace
}  // namespace tumbler
