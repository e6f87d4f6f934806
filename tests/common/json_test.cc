#include "common/files/json.h"

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace tumbler {
namespace {

TEST(Json, KeepsTheOrderOfMembersAndSaysWhichKindAValueIs) {
  Json json = {{"z", 1}, {"a", "text"}, {"list", {1, 2.5, nullptr}}, {"on", true}};
  json["b"] = Json::Object();
  EXPECT_EQ(json.Dump(-1), R"({"z":1,"a":"text","list":[1,2.5,null],"on":true,"b":{}})");
  EXPECT_TRUE(json.is_object() && json["z"].is_number() && json["a"].is_text());
  EXPECT_TRUE(json["list"].is_array() && json["list"][2].is_null() && json["on"].is_boolean());
}

TEST(Json, AListOfPairsIsAnObjectOnlyWhereEachBeginsWithAText) {
  EXPECT_TRUE(Json({{"a", 1}, {"b", 2}}).is_object());
  EXPECT_TRUE(Json({{1, 2}, {3, 4}}).is_array());
  EXPECT_TRUE(Json({"a", 1}).is_array());
  EXPECT_TRUE(Json::Array({{"a", 1}}).is_array());
  Json list;
  list.Append({"p50", 12.5});
  list.Append({{"name", "x"}});
  EXPECT_EQ(list.Dump(-1), R"([["p50",12.5],{"name":"x"}])");
}

TEST(Json, IsIndentedByLevel) {
  EXPECT_EQ(Json({{"a", {1}}, {"b", Json::Array()}}).Dump(2),
            "{\n  \"a\": [\n    1\n  ],\n  \"b\": []\n}");
}

TEST(Json, NumbersAreTheShortestThatReadBackTheSame) {
  const std::vector<double> numbers = {0.1, 1.0, -2.5e-300, 1e22, 0.1 + 0.2};
  EXPECT_EQ(Json(numbers).Dump(-1), "[0.1,1.0,-2.5e-300,1e+22,0.30000000000000004]");
  EXPECT_EQ(Json(std::array{0.1F}).Dump(-1), "[0.10000000149011612]");
  EXPECT_EQ(Json({std::numeric_limits<std::int64_t>::min(), std::size_t{7},
                  std::numeric_limits<std::uint64_t>::max()})
                .Dump(-1),
            "[-9223372036854775808,7,18446744073709551615]");
  EXPECT_EQ(Json({NAN, HUGE_VAL}).Dump(-1), "[null,null]");
}

TEST(Json, WhatIsNoUtf8IsReplaced) { EXPECT_EQ(Json("a\xff\"").Dump(-1), "\"a\xEF\xBF\xBD\\\"\""); }

TEST(Json, WhatIsWrittenIsRead) {
  const Json json = {
      {"a", {1, -2, 0.5, 1e300}}, {"b", {{"c", nullptr}, {"d", "\n\"\xC3\xA4"}}}, {"e", false}};
  for (const int indent : {-1, 1, 2}) EXPECT_EQ(Json::Parse(json.Dump(indent)), json);
}

TEST(Json, OfMembersOfOneNameTheLastCounts) {
  EXPECT_EQ(Json::Parse(R"({"a": 1, "b": 2, "a": 3})"), Json({{"a", 3}, {"b", 2}}));
}

TEST(Json, TextThatIsNoJsonOrTooDeepIsNotRead) {
  for (const std::string text : {"", "{", "[1,]", "{\"a\" 1}", "nul", "[1] 2", "\"a\xff\""})
    EXPECT_EQ(Json::Parse(text), std::nullopt) << text;
  const auto nested = [](std::size_t levels) {
    return std::string(levels, '[') + std::string(levels, ']');
  };
  EXPECT_TRUE(Json::Parse(nested(100)).has_value());
  EXPECT_FALSE(Json::Parse(nested(101)).has_value());
  EXPECT_FALSE(Json::Parse(std::string(1'000'000, '[')).has_value());
}

TEST(Json, HandsOutWhatItHoldsAndNothingElse) {
  const Json json = Json::Parse(R"({"n": 7, "x": 7.5, "s": "t", "large": 1e19,
                                    "larger": 9223372036854775808, "list": [1]})")
                        .value();
  EXPECT_EQ(json["n"].integer(), 7);
  EXPECT_EQ(json["n"].number(), 7);
  EXPECT_EQ(json["x"].integer(), std::nullopt);
  EXPECT_EQ(json["larger"].integer(), std::nullopt);
  EXPECT_EQ(json["larger"].number(), 9223372036854775808.0);
  EXPECT_EQ(json["s"].text(), "t");
  EXPECT_EQ(json["list"].elements().size(), 1U);
  EXPECT_EQ(json["n"].elements().size(), 0U);
  EXPECT_EQ(json.Find("absent"), nullptr);
  EXPECT_THROW(static_cast<void>(json["absent"]), std::out_of_range);
  EXPECT_THROW(static_cast<void>(json["list"][1]), std::out_of_range);
  EXPECT_THROW(static_cast<void>(json["s"].number()), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(json["n"].text()), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(json["n"].boolean()), std::invalid_argument);
}

TEST(Json, MergesMembersAndGrowsFromNothing) {
  Json json;
  json["a"]["b"] = 1;
  json.Merge({{"a", 2}, {"c", 3}});
  EXPECT_EQ(json, Json({{"a", 2}, {"c", 3}}));
  EXPECT_THROW(json.Append(1), std::invalid_argument);
  EXPECT_THROW(json["a"]["b"] = 1, std::invalid_argument);
}

TEST(Json, NumbersAreComparedByValue) {
  EXPECT_EQ(Json(2), Json(2.0));
  EXPECT_NE(Json(2), Json("2"));
  std::ostringstream stream;
  stream << Json({1, 2});
  EXPECT_EQ(stream.str(), "[1,2]");
}

TEST(Json, IsNotMadeOfAPathUnasked) {
  EXPECT_FALSE((std::is_convertible_v<std::filesystem::path, Json>));
  EXPECT_TRUE((std::is_convertible_v<std::vector<int>, Json>));
}

}  // namespace
}  // namespace tumbler
