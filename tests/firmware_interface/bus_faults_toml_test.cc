#include "firmware_interface/can/bus_faults_toml.h"

#include <gmock/gmock-more-matchers.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/files/toml_reader.h"
#include "tests/support/docs_tables.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::vector<std::string> kNodes = {"host", "leg1", "leg2"};
const std::string kHead = "format = \"tumbler-bus-faults\"\nversion = 1\n";

TEST(BusFaultsToml, TheExampleIsRead) {
  const BusFaultPlan plan =
      LoadBusFaults(testing::SourcePath("tests/data/bus_faults.toml"), kNodes);
  EXPECT_EQ(plan.seed, 7U);
  ASSERT_EQ(plan.faults.size(), 4U);
  EXPECT_EQ(plan.faults[0].kind, BusFaultKind::kBitErrors);
  EXPECT_EQ(plan.faults[0].probability, 1e-6);
  EXPECT_EQ(plan.faults[0].node, BusFault::kEveryNode);
  EXPECT_EQ(plan.faults[1].kind, BusFaultKind::kLoss);
  EXPECT_EQ(plan.faults[1].node, 0);
  EXPECT_THAT(plan.faults[1].ids, IsEmpty());
  EXPECT_THAT(plan.faults[2].ids, ElementsAre(17U));
  EXPECT_EQ(plan.faults[3].kind, BusFaultKind::kShort);
  EXPECT_EQ(plan.faults[3].start_ns, 2'000'000'000);
  EXPECT_EQ(plan.faults[3].end_ns, 2'010'000'000);
}

TEST(BusFaultsToml, EveryKindHasItsName) {
  const std::vector<std::pair<std::string, BusFaultKind>> kinds = {
      {"loss", BusFaultKind::kLoss},         {"duplicate", BusFaultKind::kDuplicate},
      {"delay", BusFaultKind::kDelay},       {"reorder", BusFaultKind::kReorder},
      {"flip", BusFaultKind::kFlip},         {"bit-errors", BusFaultKind::kBitErrors},
      {"short", BusFaultKind::kShort},       {"disconnect", BusFaultKind::kDisconnect},
      {"stall", BusFaultKind::kStall},       {"link-down", BusFaultKind::kLinkDown},
      {"link-gone", BusFaultKind::kLinkGone}};
  for (const auto& [name, kind] : kinds) {
    std::string text = kHead;
    text.append("[[fault]]\nkind = \"").append(name).append("\"\n");
    if (kind == BusFaultKind::kDelay) text += "delay_s = 0.002\n";
    if (kind == BusFaultKind::kBitErrors) text += "rate = 0.5\n";
    if (kind > BusFaultKind::kShort) text += "node = \"leg2\"\n";
    const BusFaultPlan plan = ParseBusFaults(text, "b.toml", kNodes);
    EXPECT_EQ(plan.seed, 1U);
    EXPECT_EQ(plan.faults.at(0).kind, kind) << name;
    EXPECT_EQ(plan.faults[0].node, kind > BusFaultKind::kShort ? 2 : BusFault::kEveryNode);
    EXPECT_EQ(plan.faults[0].delay_ns, kind == BusFaultKind::kDelay     ? 2'000'000
                                       : kind == BusFaultKind::kReorder ? 10'000'000
                                                                        : 0);
  }
}

TEST(BusFaultsToml, WhatIsWrongIsNamedWithFileLineKeyAndWhatIsAllowed) {
  struct Bad {
    std::string text;
    std::vector<std::string> fragments;
  };
  const std::vector<Bad> all = {
      {"", {"b.toml", "fault"}},
      {"seed = -1\n[[fault]]\nkind = \"short\"\n", {"b.toml:3", "seed"}},
      {"[[fault]]\nkind = \"fire\"\n", {"b.toml:4", "kind", "fire", "loss", "link-gone"}},
      {"[[fault]]\nstart_s = 1\n", {"b.toml:3", "kind"}},
      {"[[fault]]\nkind = \"loss\"\nprobability = 1.5\n", {"b.toml:5", "probability", "0 ... 1"}},
      {"[[fault]]\nkind = \"loss\"\nrate = 0.5\n", {"b.toml:5", "rate"}},
      {"[[fault]]\nkind = \"loss\"\nnode = \"leg3\"\n",
       {"b.toml:5", "node", "leg3", "host, leg1, leg2"}},
      {"[[fault]]\nkind = \"loss\"\nids = [1.5]\n", {"b.toml:5", "ids", "1.5"}},
      {"[[fault]]\nkind = \"loss\"\nids = []\n", {"b.toml:5", "ids", "empty"}},
      {"[[fault]]\nkind = \"loss\"\nids = [536870912]\n", {"b.toml:5", "ids"}},
      {"[[fault]]\nkind = \"delay\"\n", {"b.toml:3", "delay_s"}},
      {"[[fault]]\nkind = \"delay\"\ndelay_s = 0\n", {"b.toml:5", "delay_s"}},
      {"[[fault]]\nkind = \"reorder\"\ndelay_s = 11\n", {"b.toml:5", "delay_s", "10"}},
      {"[[fault]]\nkind = \"bit-errors\"\n", {"b.toml:3", "rate"}},
      {"[[fault]]\nkind = \"bit-errors\"\nrate = nan\n", {"b.toml:5", "rate"}},
      {"[[fault]]\nkind = \"stall\"\n", {"b.toml:3", "node"}},
      {"[[fault]]\nkind = \"link-gone\"\n", {"b.toml:3", "node"}},
      {"[[fault]]\nkind = \"short\"\nnode = \"leg1\"\n", {"b.toml:5", "node"}},
      {"[[fault]]\nkind = \"short\"\nstart_s = -1\n", {"b.toml:5", "start_s"}},
      {"[[fault]]\nkind = \"short\"\nduration_s = 0\n", {"b.toml:5", "duration_s"}}};
  for (const Bad& bad : all) {
    try {
      static_cast<void>(ParseBusFaults(kHead + bad.text, "b.toml", kNodes));
      ADD_FAILURE() << "taken: " << bad.text;
    } catch (const FileError& error) {
      for (const std::string& fragment : bad.fragments) {
        EXPECT_THAT(error.what(), HasSubstr(fragment)) << bad.text;
      }
    }
  }
  EXPECT_THROW(ParseBusFaults("version = 1\n", "b.toml", kNodes), FileError);
  EXPECT_THROW(ParseBusFaults("format = \"tumbler-bus-faults\"\nversion = 2\n", "b.toml", kNodes),
               FileError);
  EXPECT_THROW(LoadBusFaults("/nonexistent/b.toml", kNodes), FileError);
}

TEST(BusFaultsToml, TheTablesOfTheDocumentAreThoseOfTheCode) {
  testing::ExpectTables("docs/formats.md", BusFaultsKeyTables());
}

}  // namespace
}  // namespace tumbler
